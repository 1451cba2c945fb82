//! The services and the action of the target publisher, and the topics whose samples it needs to answer.

use formation_msgs::{
    FormConfigurationFeedback, FormConfigurationGoal, FormConfigurationResult, QueryStatusRequest,
    QueryStatusResponse, RemoveModuleRequest, RemoveModuleResponse, StopFormationRequest,
    StopFormationResponse, Verdict, WithdrawTargetRequest, WithdrawTargetResponse,
};
use formation_node_support::messages::{Received, subscribe_all, subscribe_verdicts};
use ros_runtime::action::{Action, ActionRequest, ActionServer};
use ros_runtime::inputs::Inputs;
use ros_runtime::ros_context::{RosContext, RosContextError};
use ros_runtime::service::{Call, DeclaredService};

const QUERY_STATUS: DeclaredService<QueryStatusRequest, QueryStatusResponse> =
    DeclaredService::new("query_status", "formation_msgs", "QueryStatus");
const WITHDRAW_TARGET: DeclaredService<WithdrawTargetRequest, WithdrawTargetResponse> =
    DeclaredService::new("withdraw_target", "formation_msgs", "WithdrawTarget");
const STOP_FORMATION: DeclaredService<StopFormationRequest, StopFormationResponse> =
    DeclaredService::new("stop_formation", "formation_msgs", "StopFormation");
const REMOVE_MODULE: DeclaredService<RemoveModuleRequest, RemoveModuleResponse> =
    DeclaredService::new("remove_module", "formation_msgs", "RemoveModule");
const FORM_CONFIGURATION: Action<
    FormConfigurationGoal,
    FormConfigurationResult,
    FormConfigurationFeedback,
> = Action::new("form_configuration", "formation_msgs", "FormConfiguration");

/// Serves the action `FormConfiguration`.
pub(crate) type FormConfigurationServer =
    ActionServer<FormConfigurationResult, FormConfigurationFeedback>;

/// What the process receives.
pub(crate) enum Input {
    Messages(Received),
    Verdict(Verdict),
    QueryStatus(Call<QueryStatusRequest, QueryStatusResponse>),
    WithdrawTarget(Call<WithdrawTargetRequest, WithdrawTargetResponse>),
    StopFormation(Call<StopFormationRequest, StopFormationResponse>),
    RemoveModule(Call<RemoveModuleRequest, RemoveModuleResponse>),
    Action(Box<ActionRequest<FormConfigurationGoal>>),
}

/// Creates the endpoints.
pub(crate) fn open(
    ros: &mut RosContext,
    inputs: &mut Inputs<Input>,
) -> Result<FormConfigurationServer, RosContextError> {
    inputs.add(ros.serve(&QUERY_STATUS)?, Input::QueryStatus);
    inputs.add(ros.serve(&WITHDRAW_TARGET)?, Input::WithdrawTarget);
    inputs.add(ros.serve(&STOP_FORMATION)?, Input::StopFormation);
    inputs.add(ros.serve(&REMOVE_MODULE)?, Input::RemoveModule);
    let (action, requests) = ros.serve_action(&FORM_CONFIGURATION)?;
    inputs.add(requests, |request| Input::Action(Box::new(request)));
    for messages in subscribe_all(ros, 1)? {
        inputs.add(messages, Input::Messages);
    }
    inputs.add(subscribe_verdicts(ros)?, Input::Verdict);
    Ok(action)
}
