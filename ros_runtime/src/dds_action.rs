//! Actions over DDS.
//!
//! The library names and creates the endpoints. Its own server of actions is not used: it never answers a client that
//! asks for the result of a goal that has ended, and treats unknown and ended goals like others when one is to be
//! cancelled.

use std::cell::RefCell;
use std::rc::Rc;

use futures::StreamExt;
use futures::future::ready;
use futures::stream::{LocalBoxStream, poll_fn, select_all};
use ros2_client::action::{ActionServerQosPolicies, CancelGoalRequest, FeedbackMessage, GoalInfo};
use ros2_client::{ActionTypeName, Message, Server};
use serde::Deserialize;

use crate::action::{Action, ActionEndpoints, ActionRequest, FEEDBACK, OpenedAction, STATUS};
use crate::dds_graph::DdsGraph;
use crate::dds_service::{Clients, SERVICE, answerable, poll_request};
use crate::ros_context_error::{RosContextError, library_name};
use crate::service::{Carried, RequestId, ServiceData};

type Library<G, R, F> = ros2_client::ActionServer<Carried<G>, Carried<R>, Carried<F>>;

impl DdsGraph {
    /// Serves an action under its fully qualified name.
    pub(crate) fn serve_action<G: ServiceData, R: ServiceData, F: ServiceData>(
        &mut self,
        action: &Action<G, R, F>,
        name: &str,
    ) -> Result<OpenedAction<G, R, F>, RosContextError> {
        let parsed = library_name(name)?;
        let (package, type_name) = action.type_name();
        let type_name = ActionTypeName::new(package, type_name);
        let mapping = self.service_mapping.library();
        let qos = ActionServerQosPolicies {
            goal_service: SERVICE.publisher_qos(),
            result_service: SERVICE.publisher_qos(),
            cancel_service: SERVICE.publisher_qos(),
            feedback_publisher: FEEDBACK.publisher_qos(),
            status_publisher: STATUS.publisher_qos(),
        };
        let library: Library<G, R, F> = self
            .create(&format!("serve the action `{name}`"), |node| {
                node.create_action_server(mapping, &parsed, &type_name, qos)
            })?;
        let library = Rc::new(RefCell::new(library));
        let clients = ["send_goal", "cancel_goal", "get_result"]
            .map(|part| Clients::of(self, &format!("{name}/_action/{part}")));
        let streams = [
            requests(&library, &clients[0], Library::goal_server)
                .map(|(id, request)| ActionRequest::SendGoal(id, request.goal_id, request.goal.0))
                .boxed_local(),
            requests(&library, &clients[1], Library::cancel_server)
                .filter_map(|(id, request)| {
                    let named = named_goals(&request);
                    ready(named.map(|named| ActionRequest::CancelGoal(id, named)))
                })
                .boxed_local(),
            requests(&library, &clients[2], Library::result_server)
                .map(|(id, request)| ActionRequest::GetResult(id, request.goal_id))
                .boxed_local(),
        ];
        let [of_goals, of_cancellations, of_results] = clients;
        let shared = || Rc::clone(&library);
        let (goal, cancellation, result) = (shared(), shared(), shared());
        let (feedback, status) = (shared(), shared());
        let endpoints = ActionEndpoints {
            goal: Box::new(move |id, response| {
                of_goals.log_failure(&goal.borrow().send_goal_response(id, response));
            }),
            cancellation: Box::new(move |id, response| {
                let sent = cancellation.borrow().send_cancel_response(id, response);
                of_cancellations.log_failure(&sent);
            }),
            result: Box::new(move |id, response| {
                of_results.log_failure(&result.borrow().send_result(id, response));
            }),
            feedback: Box::new(move |sample: FeedbackMessage<Carried<F>>| {
                let library = feedback.borrow();
                library.send_feedback(sample.goal_id, sample.feedback)
            }),
            status: Box::new(move |sample| status.borrow().send_goal_statuses(sample)),
        };
        Ok((endpoints, select_all(streams).boxed_local()))
    }
}

/// The requests to one of the services of an action, which the library lends one at a time: `lend` borrows it for every
/// poll.
fn requests<S: 'static, Q: Message + 'static, P: Message + 'static>(
    library: &Rc<RefCell<S>>,
    clients: &Rc<Clients>,
    lend: fn(&mut S) -> &mut Server<Q, P>,
) -> LocalBoxStream<'static, (RequestId, Q)> {
    let library = Rc::clone(library);
    let polled = poll_fn(move |context| poll_request(lend(&mut library.borrow_mut()), context));
    answerable(polled, clients)
}

/// The library keeps the field of a request to cancel private, but serialises it.
#[derive(Deserialize)]
struct Cancellation {
    goal_info: GoalInfo,
}

fn named_goals(request: &CancelGoalRequest) -> Option<GoalInfo> {
    let written = serde_json::to_value(request).ok();
    let read = written.and_then(|written| serde_json::from_value(written).ok());
    if read.is_none() {
        tracing::warn!("dropped a request to cancel, whose field the library does not serialise");
    }
    read.map(|read: Cancellation| read.goal_info)
}

#[cfg(test)]
mod tests {
    use ros2_client::action::GoalId;
    use ros2_client::builtin_interfaces::Time;

    use super::*;

    #[test]
    fn the_goals_of_a_request_to_cancel_are_read() {
        let meant = GoalInfo {
            goal_id: GoalId::new_random(),
            stamp: Time::new(5, 70),
        };
        let info = serde_json::to_value(&meant).unwrap();
        let request = serde_json::json!({"goal_info": info});
        let request: CancelGoalRequest = serde_json::from_value(request).unwrap();
        let read = named_goals(&request).unwrap();
        assert_eq!((read.goal_id, read.stamp), (meant.goal_id, meant.stamp));
    }
}
