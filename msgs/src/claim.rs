//! What travels on `claims` and `evictions`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation_model::{self as model, Decision, EvictionNotice, Incarnation, ModuleId, SpotId};
use serde::{Deserialize, Serialize};

use crate::NONE;
use crate::bounds::{MODULES_MAX, SPOTS_MAX};
use crate::check::{self, Checked, FieldError, PROTOCOL_VERSION};
use crate::epoch::Epoch;
use crate::error::Fault;

/// See `SpotSelection.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpotSelection {
    pub spot_id: u32,
    pub module_id: u32,
}

/// See `EvictionRecord.msg`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EvictionRecord {
    pub evicted_module_id: u32,
    pub by_module_id: u32,
    pub from_spot_id: u32,
    pub to_spot_id: u32,
}

/// See `SpotClaim.msg`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpotClaim {
    pub protocol_version: u32,
    pub session: u64,
    pub epoch: Epoch,
    pub turn: u32,
    pub claimant_id: u32,
    pub incarnation: u64,
    pub selections: Vec<SpotSelection>,
    pub evictions: Vec<EvictionRecord>,
    pub detached: Vec<u32>,
    pub swaps: Vec<SpotSelection>,
}

/// See `Eviction.msg`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Eviction {
    pub protocol_version: u32,
    pub session: u64,
    pub epoch: Epoch,
    pub turn: u32,
    pub eviction: EvictionRecord,
}

impl EvictionRecord {
    pub const NONE: u32 = NONE;
}

impl SpotSelection {
    pub(crate) fn new(spot: SpotId, module: ModuleId) -> Self {
        Self {
            spot_id: spot.0,
            module_id: module.0,
        }
    }
}

/// Pairs in ascending order of spot, none with a spot or module of another.
pub(crate) fn selections(field: &str, raw: &[SpotSelection]) -> Checked<Vec<model::SpotSelection>> {
    let selections = check::entries(field, raw, SPOTS_MAX, |selection| {
        Ok(model::SpotSelection {
            spot: check::id("spot_id", selection.spot_id, SpotId)?,
            module: check::id("module_id", selection.module_id, ModuleId)?,
        })
    })?;
    check::ascending(field, selections.iter().map(|selection| selection.spot))?;
    check::distinct(field, selections.iter().map(|selection| selection.module))?;
    Ok(selections)
}

impl From<&model::EvictionRecord> for EvictionRecord {
    fn from(record: &model::EvictionRecord) -> Self {
        Self {
            evicted_module_id: record.evicted.0,
            by_module_id: record.by.0,
            from_spot_id: record.from.0,
            to_spot_id: record.to.map_or(NONE, |spot| spot.0),
        }
    }
}

impl EvictionRecord {
    fn validated(self) -> Checked<model::EvictionRecord> {
        let record = model::EvictionRecord {
            evicted: check::id("evicted_module_id", self.evicted_module_id, ModuleId)?,
            by: check::id("by_module_id", self.by_module_id, ModuleId)?,
            from: check::id("from_spot_id", self.from_spot_id, SpotId)?,
            to: check::optional_id(self.to_spot_id, SpotId),
        };
        if record.by == record.evicted {
            let fault = Fault::Itself(record.evicted.to_string());
            return Err(FieldError::new("by_module_id", fault));
        }
        if record.to == Some(record.from) {
            let fault = Fault::BackToLostSpot(record.from);
            return Err(FieldError::new("to_spot_id", fault));
        }
        Ok(record)
    }
}

impl From<&model::SpotClaim> for SpotClaim {
    fn from(claim: &model::SpotClaim) -> Self {
        let decision = &claim.decision;
        let pairs = |pairs: &[model::SpotSelection]| {
            let pairs = pairs.iter();
            pairs
                .map(|pair| SpotSelection::new(pair.spot, pair.module))
                .collect()
        };
        Self {
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            epoch: Epoch::from(&claim.epoch),
            turn: claim.turn,
            claimant_id: claim.claimant.0,
            incarnation: claim.incarnation.0,
            selections: pairs(&decision.selections),
            evictions: decision
                .evictions
                .iter()
                .map(EvictionRecord::from)
                .collect(),
            detached: decision.detached.iter().map(|module| module.0).collect(),
            swaps: pairs(&decision.swaps),
        }
    }
}

impl SpotClaim {
    pub(crate) fn validated(&self) -> Checked<model::SpotClaim> {
        check::version(self.protocol_version)?;
        check::count("evictions", self.evictions.len(), MODULES_MAX)?;
        Ok(model::SpotClaim {
            epoch: self.epoch.required()?,
            turn: check::turn(self.turn)?,
            claimant: check::id("claimant_id", self.claimant_id, ModuleId)?,
            incarnation: Incarnation(self.incarnation),
            decision: Decision {
                selections: selections("selections", &self.selections)?,
                evictions: check::entries("evictions", &self.evictions, MODULES_MAX, |record| {
                    record.validated()
                })?,
                detached: check::module_ids("detached", &self.detached, MODULES_MAX)?,
                swaps: selections("swaps", &self.swaps)?,
            },
        })
    }
}

impl From<&EvictionNotice> for Eviction {
    fn from(notice: &EvictionNotice) -> Self {
        Self {
            protocol_version: PROTOCOL_VERSION,
            session: 0,
            epoch: Epoch::from(&notice.epoch),
            turn: notice.turn,
            eviction: EvictionRecord::from(&notice.eviction),
        }
    }
}

impl Eviction {
    pub(crate) fn validated(self) -> Checked<EvictionNotice> {
        check::version(self.protocol_version)?;
        let eviction = self.eviction.validated();
        Ok(EvictionNotice {
            epoch: self.epoch.required()?,
            turn: self.turn,
            eviction: eviction.map_err(|error| error.within("eviction"))?,
        })
    }
}
