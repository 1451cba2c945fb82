//! What travels on `commands`.

use formation_model::{self as model, Incarnation, Message, ModuleId, ModuleRun};
use serde::{Deserialize, Serialize};

use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};

/// See `Stop.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct Stop {
    pub revision: u64,
    pub stopped: bool,
}

impl From<&model::Stop> for Stop {
    fn from(stop: &model::Stop) -> Self {
        Self {
            revision: stop.revision,
            stopped: stop.stopped,
        }
    }
}

impl Stop {
    pub(crate) fn to_core(self) -> model::Stop {
        model::Stop {
            revision: self.revision,
            stopped: self.stopped,
        }
    }
}

/// See `Removal.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct Removal {
    pub module_id: u32,
    pub incarnation: u64,
    pub takes_vote: bool,
}

impl From<&ModuleRun> for Removal {
    fn from(run: &ModuleRun) -> Self {
        Self {
            module_id: run.module.0,
            incarnation: run.incarnation.0,
            takes_vote: false,
        }
    }
}

impl From<&model::Removal> for Removal {
    fn from(removal: &model::Removal) -> Self {
        Self {
            takes_vote: removal.takes_vote,
            ..Self::from(&removal.run)
        }
    }
}

impl Removal {
    /// Enforces B5.
    fn validated(&self) -> Checked<model::Removal> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        // Whoever reports a removal knows which run is gone; a receiver behind a cut does not.
        if self.incarnation == 0 {
            let reason = "0 names no run; give the incarnation that heartbeats or a roster showed";
            return Err(FieldError::contradiction("incarnation", reason));
        }
        Ok(model::Removal {
            run: module.run(Incarnation(self.incarnation)),
            takes_vote: self.takes_vote,
        })
    }
}

/// The removals of distinct modules, ascending.
pub(crate) fn removals(field: &str, raw: &[Removal]) -> Checked<Vec<model::Removal>> {
    let removals = check::entries(field, raw, MODULES_MAX, Removal::validated)?;
    check::ascending(field, removals.iter().map(|removal| removal.run.module))?;
    Ok(removals)
}

/// See `OperatorCommand.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the .msg file documents the fields")]
pub struct OperatorCommand {
    pub protocol_version: u32,
    pub session: u64,
    pub stop: Stop,
    pub removals: Vec<Removal>,
}

impl OperatorCommand {
    /// A sample with these commands, for every session.
    #[must_use]
    pub fn new<'a>(
        stop: model::Stop,
        removals: impl IntoIterator<Item = &'a model::Removal>,
    ) -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            stop: (&stop).into(),
            removals: removals.into_iter().map(Removal::from).collect(),
        }
    }

    /// One message of the core for each command.
    pub(crate) fn validated(self) -> Checked<Vec<Message>> {
        check::version(self.protocol_version)?;
        let validate = Removal::validated;
        let removals = check::entries("removals", &self.removals, MODULES_MAX, validate)?;
        let modules = removals.iter().map(|removal| removal.run.module);
        check::distinct("removals", modules)?;
        let stop = Some(self.stop.to_core()).filter(|stop| stop.revision > 0);
        let stop = stop.into_iter().map(Message::Stop);
        Ok(stop
            .chain(removals.into_iter().map(Message::Removal))
            .collect())
    }
}
