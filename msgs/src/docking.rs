//! What travels on `module_N/docking` and `module_N/docking_result`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation::model::ModuleId;
use formation::motion;
use serde::{Deserialize, Serialize};

use crate::bounds::REASON_BYTES_MAX;
use crate::check::{self, Checked, FieldError};
use crate::error::{Fault, MessageError};
use crate::standard::Header;
use crate::topic;

/// See `DockingRequest.msg`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DockingRequest {
    pub header: Header,
    pub module_id: u32,
    pub request: u64,
    pub action: u8,
    pub other_module_id: u32,
}

/// See `DockingResult.msg`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DockingResult {
    pub header: Header,
    pub module_id: u32,
    pub request: u64,
    pub success: bool,
    pub reason: String,
}

impl DockingRequest {
    pub const ACTION_DOCK: u8 = 1;
    pub const ACTION_UNDOCK: u8 = 2;

    /// A module's request, as it goes out.
    #[must_use]
    pub fn new(header: Header, module: ModuleId, request: &motion::DockingRequest) -> Self {
        Self {
            header,
            module_id: module.0,
            request: request.request,
            action: match request.action {
                motion::DockingAction::Dock => Self::ACTION_DOCK,
                motion::DockingAction::Undock => Self::ACTION_UNDOCK,
            },
            other_module_id: request.other.0,
        }
    }
}

impl DockingResult {
    /// The refusal of a result that came on another module's topic.
    #[must_use]
    pub fn of_another(named: ModuleId) -> MessageError {
        FieldError::new("module_id", Fault::WrongModule(named)).on(topic::DOCKING_RESULT)
    }

    pub(crate) fn validated(self) -> Checked<(ModuleId, motion::DockingResult)> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        check::length("reason", &self.reason, REASON_BYTES_MAX)?;
        let outcome = match (self.success, self.reason) {
            (true, _) => Ok(()),
            (false, reason) if reason.is_empty() => Err("it gives no reason".to_owned()),
            (false, reason) => Err(reason),
        };
        let result = motion::DockingResult {
            request: self.request,
            outcome,
        };
        Ok((module, result))
    }
}
