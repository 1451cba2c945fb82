//! What travels on `module_N/docking` and `module_N/docking_result`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation_model::{self as model, DockingAction, ModuleId};
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

enumeration! {
    DockingRequest "action": action_to_wire, docking_action => DockingAction {
        ACTION_DOCK DOCK 1 = Dock,
        ACTION_UNDOCK UNDOCK 2 = Undock,
    }
}

impl DockingRequest {
    /// A module's request, as it goes out.
    #[must_use]
    pub fn new(header: Header, module: ModuleId, request: &model::DockingRequest) -> Self {
        Self {
            header,
            module_id: module.0,
            request: request.request,
            action: action_to_wire(request.action),
            other_module_id: request.other.0,
        }
    }
}

impl DockingRequest {
    pub(crate) fn validated(self) -> Checked<(ModuleId, model::DockingRequest)> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        let request = model::DockingRequest {
            request: self.request,
            action: docking_action(self.action)?,
            other: check::id("other_module_id", self.other_module_id, ModuleId)?,
        };
        Ok((module, request))
    }
}

impl DockingResult {
    /// The answer of a module's driver.
    #[must_use]
    pub fn new(header: Header, module: ModuleId, result: model::DockingResult) -> Self {
        Self {
            header,
            module_id: module.0,
            request: result.request,
            success: result.outcome.is_ok(),
            reason: result.outcome.err().unwrap_or_default(),
        }
    }

    /// The refusal of a result that came on another module's topic.
    #[must_use]
    pub fn of_another(named: ModuleId) -> MessageError {
        FieldError::new("module_id", Fault::WrongModule(named)).on(topic::DOCKING_RESULT)
    }

    pub(crate) fn validated(self) -> Checked<(ModuleId, model::DockingResult)> {
        let module = check::id("module_id", self.module_id, ModuleId)?;
        check::length("reason", &self.reason, REASON_BYTES_MAX)?;
        let outcome = match (self.success, self.reason) {
            (true, _) => Ok(()),
            (false, reason) if reason.is_empty() => Err("it gives no reason".to_owned()),
            (false, reason) => Err(reason),
        };
        let result = model::DockingResult {
            request: self.request,
            outcome,
        };
        Ok((module, result))
    }
}
