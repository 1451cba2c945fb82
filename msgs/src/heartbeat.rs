//! What travels on `heartbeats`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model as model;
use formation_model::{Incarnation, ModuleId, ModuleSize};
use serde::{Deserialize, Serialize};

use crate::bounds::MODULES_MAX;
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};
use crate::epoch::Epoch;
use crate::module_state::{phase_from_wire, phase_to_wire};
use crate::operator::Stop;
use crate::standard::Duration;

/// See `ModuleHeartbeat.msg`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModuleHeartbeat {
    pub module_id: u32,
    pub incarnation: u64,
    pub knows: bool,
    pub voters_digest: u64,
    pub sequence: u64,
    pub uptime: Duration,
    pub epoch: Epoch,
    pub has_digest: bool,
    pub digest: u64,
    pub digest_since: u64,
    pub applied_turns: u32,
    pub steps_done: u32,
    pub phase: u8,
    pub stop: Stop,
}

/// See `Heartbeat.msg`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Heartbeat {
    pub protocol_version: u32,
    pub session: u64,
    pub misses: Vec<u32>,
    pub modules: Vec<ModuleHeartbeat>,
    pub module_size: f64,
}

impl From<&model::Heartbeat> for ModuleHeartbeat {
    fn from(heartbeat: &model::Heartbeat) -> Self {
        Self {
            module_id: heartbeat.module.0,
            incarnation: heartbeat.incarnation.0,
            knows: heartbeat.knows,
            voters_digest: heartbeat.voters,
            sequence: heartbeat.sequence,
            uptime: heartbeat.uptime.into(),
            epoch: heartbeat.epoch.as_ref().into(),
            has_digest: heartbeat.digest.is_some(),
            digest: heartbeat.digest.map_or(0, |digest| digest.0),
            digest_since: heartbeat.digest_since,
            applied_turns: heartbeat.applied_turns,
            steps_done: heartbeat.steps_done,
            phase: phase_to_wire(heartbeat.phase),
            stop: (&heartbeat.stop).into(),
        }
    }
}

impl ModuleHeartbeat {
    fn validated(&self, misses: &Arc<[ModuleId]>) -> Checked<model::Heartbeat> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        let epoch = self.epoch.validated()?;
        let digest = check::digest(epoch, self.has_digest, self.digest)?;
        let contradiction = |field, reason| Err(FieldError::contradiction(field, reason));
        if digest.is_some() == (self.digest_since == 0) {
            return contradiction("digest_since", "must be 0 without a digest, and only then");
        }
        if self.digest_since > self.sequence {
            return contradiction("digest_since", "lies after this heartbeat's sequence");
        }
        if epoch.is_none() && self.applied_turns > 0 {
            return contradiction("applied_turns", "must be 0 without an epoch");
        }
        if digest.is_none() && self.steps_done > 0 {
            return contradiction("steps_done", "must be 0 without a plan");
        }
        Ok(model::Heartbeat {
            module,
            incarnation: Incarnation(self.incarnation),
            knows: self.knows,
            voters: self.voters_digest,
            sequence: self.sequence,
            uptime: self.uptime.validated("uptime")?,
            epoch,
            digest,
            digest_since: self.digest_since,
            applied_turns: self.applied_turns,
            steps_done: self.steps_done,
            phase: phase_from_wire(self.phase)?,
            stop: self.stop.to_core(),
            misses: Arc::clone(misses),
        })
    }
}

impl Heartbeat {
    /// One sample of the heartbeats of modules that a process hosts: what one of them misses, the process misses.
    pub fn new<'a>(
        heartbeats: impl IntoIterator<Item = &'a model::Heartbeat>,
        size: ModuleSize,
    ) -> Self {
        let mut misses = BTreeSet::new();
        let heartbeats = heartbeats.into_iter().inspect(|heartbeat| {
            misses.extend(heartbeat.misses.iter().map(|module| module.0));
        });
        let modules = heartbeats.map(ModuleHeartbeat::from).collect();
        Self {
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            misses: misses.into_iter().collect(),
            modules,
            module_size: size.metres(),
        }
    }

    /// The heartbeats of distinct modules, in the order in which they came.
    pub(crate) fn validated(self, size: ModuleSize) -> Checked<Vec<model::Heartbeat>> {
        check::version(self.protocol_version)?;
        check::module_size(self.module_size, size)?;
        let misses = check::module_ids("misses", &self.misses, MODULES_MAX)?.into();
        let validate = |module: &ModuleHeartbeat| module.validated(&misses);
        let heartbeats = check::entries("modules", &self.modules, MODULES_MAX, validate)?;
        let modules = heartbeats.iter().map(|heartbeat| heartbeat.module);
        check::distinct("modules", modules)?;
        Ok(heartbeats)
    }
}
