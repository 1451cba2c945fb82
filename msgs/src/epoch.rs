//! Epochs; several messages carry them.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation_model as model;
use formation_model::ModuleId;
use serde::{Deserialize, Serialize};

use crate::check::{self, Checked, FieldError};
use crate::error::Fault;

/// See `Epoch.msg`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Epoch {
    pub number: u64,
    pub convener: u32,
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
