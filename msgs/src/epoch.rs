//! Epochs, and what is kept of earlier ones; several messages carry them.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use std::num::NonZeroU64;

use formation_model as model;
use formation_model::{Incarnation, ModuleId, StoreId, Voter, VoterMemory};
use serde::{Deserialize, Serialize};

use crate::bounds::{MODULES_MAX, QUORUM_BASES_MAX};
use crate::check::{self, Checked, FieldError};
use crate::error::Fault;

/// See `Epoch.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Epoch {
    pub number: u64,
    pub convener: u32,
}

/// See `QuorumBasis.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct QuorumBasis {
    pub epoch: Epoch,
    pub agreed: bool,
    pub module_ids: Vec<u32>,
    pub incarnations: Vec<u64>,
    pub stores: Vec<u64>,
}

impl From<&model::Epoch> for Epoch {
    fn from(epoch: &model::Epoch) -> Self {
        Self {
            number: epoch.number,
            convener: epoch.convener.0,
        }
    }
}

impl From<Option<&model::Epoch>> for Epoch {
    fn from(epoch: Option<&model::Epoch>) -> Self {
        epoch.map_or_else(Self::default, Self::from)
    }
}

impl Epoch {
    /// The epoch, or none.
    pub(crate) fn validated(self) -> Checked<Option<model::Epoch>> {
        if self.number == 0 {
            return Ok(None);
        }
        Ok(Some(model::Epoch {
            number: self.number,
            convener: check::id("epoch.convener", self.convener, ModuleId)?,
        }))
    }

    /// The epoch, where there must be one.
    pub(crate) fn required(self) -> Checked<model::Epoch> {
        self.validated()?
            .ok_or_else(|| FieldError::new("epoch", Fault::NoEpoch))
    }
}

impl From<&model::QuorumBasis> for QuorumBasis {
    fn from(basis: &model::QuorumBasis) -> Self {
        let memories = || {
            basis.members.iter().map(|voter| match voter.memory {
                VoterMemory::Volatile(incarnation) => (incarnation.0, 0),
                VoterMemory::Stored(store) => (0, store.0.get()),
            })
        };
        Self {
            epoch: Epoch::from(&basis.epoch),
            agreed: basis.agreed,
            module_ids: basis.members.iter().map(|voter| voter.module.0).collect(),
            incarnations: memories().map(|(incarnation, _)| incarnation).collect(),
            stores: memories().map(|(_, store)| store).collect(),
        }
    }
}

impl QuorumBasis {
    fn validated(&self) -> Checked<model::QuorumBasis> {
        let modules = check::module_ids("module_ids", &self.module_ids, MODULES_MAX)?;
        for (field, list) in [
            ("incarnations", &self.incarnations),
            ("stores", &self.stores),
        ] {
            if list.len() != modules.len() {
                let reason = "must have as many entries as module_ids";
                return Err(FieldError::contradiction(field, reason));
            }
        }
        let memories = self.incarnations.iter().zip(&self.stores);
        Ok(model::QuorumBasis {
            epoch: self.epoch.required()?,
            agreed: self.agreed,
            members: modules
                .into_iter()
                .zip(memories)
                .map(|(module, (&incarnation, &raw))| Voter {
                    module,
                    memory: store(raw).map_or(
                        VoterMemory::Volatile(Incarnation(incarnation)),
                        VoterMemory::Stored,
                    ),
                })
                .collect(),
        })
    }
}

/// A store; 0 stands for none.
pub(crate) fn store(raw: u64) -> Option<StoreId> {
    NonZeroU64::new(raw).map(StoreId)
}

/// The number of a store, 0 without one.
pub(crate) fn store_to_wire(store: Option<StoreId>) -> u64 {
    store.map_or(0, |store| store.0.get())
}

/// The bases of distinct epochs.
pub(crate) fn quorum_bases(field: &str, raw: &[QuorumBasis]) -> Checked<Vec<model::QuorumBasis>> {
    let bases = check::entries(field, raw, QUORUM_BASES_MAX, QuorumBasis::validated)?;
    check::distinct(field, bases.iter().map(|basis| basis.epoch))?;
    Ok(bases)
}
