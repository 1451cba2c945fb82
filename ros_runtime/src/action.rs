//! Actions as values, and serving them: ROS 2 makes an action of three services and two topics.
//!
//! The library names and creates the endpoints. Its own server of actions is not used: it never answers a client that
//! asks for the result of a goal that has ended, and treats unknown and ended goals like others when one is to be
//! cancelled.

use std::cell::RefCell;
use std::marker::PhantomData;
use std::rc::Rc;

use futures::StreamExt;
use futures::future::ready;
use futures::stream::{LocalBoxStream, poll_fn, select_all};
use ros2_client::action::{
    ActionServerQosPolicies, CancelGoalRequest, CancelGoalResponse, FeedbackMessage,
    GetResultResponse, GoalId, GoalInfo, GoalStatusEnum, SendGoalResponse,
};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::builtin_interfaces::Time;
use ros2_client::{ActionTypeName, Message, Server};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::arguments::Resource;
use crate::publisher_queue::PublisherQueue;
use crate::service::{Carried, Clients, RequestId, answerable, poll_request, service_qos};
use crate::session::{Session, SessionError, library_name};
use crate::topic::Quality;

/// An action whose goals are `G`, whose results are `R`, and whose feedback is `F`.
#[derive(Debug)]
pub struct Action<G, R, F> {
    name: &'static str,
    package: &'static str,
    type_name: &'static str,
    types: PhantomData<fn(G) -> (R, F)>,
}

impl<G, R, F> Action<G, R, F> {
    /// An action of type `package/action/type_name`, whose name is expanded and remapped like that of a service.
    #[must_use]
    pub const fn new(name: &'static str, package: &'static str, type_name: &'static str) -> Self {
        Self {
            name,
            package,
            type_name,
            types: PhantomData,
        }
    }
}

/// A request of a client of an action, which the [`ActionServer`] answers.
pub enum ActionRequest<G> {
    /// Pursue a goal.
    SendGoal(RequestId, GoalId, G),
    /// Cancel goals.
    CancelGoal(RequestId, GoalInfo),
    /// Report the result of a goal, once it has ended.
    GetResult(RequestId, GoalId),
}

/// Data that travels in an action.
pub trait ActionData: Serialize + DeserializeOwned + Clone + 'static {}

impl<T: Serialize + DeserializeOwned + Clone + 'static> ActionData for T {}

type Library<G, R, F> = ros2_client::ActionServer<Carried<G>, Carried<R>, Carried<F>>;

/// Answers the clients of an action, and publishes on its goals.
pub struct ActionServer<G: ActionData, R: ActionData, F: ActionData> {
    library: Rc<RefCell<Library<G, R, F>>>,
    clients: [Rc<Clients>; 3],
    feedback: PublisherQueue<FeedbackMessage<Carried<F>>>,
    /// The states of all goals.
    pub status: PublisherQueue<GoalStatusArray>,
}

impl<G: ActionData, R: ActionData, F: ActionData> ActionServer<G, R, F> {
    /// Publishes feedback on a goal.
    pub fn publish_feedback(&self, goal_id: GoalId, feedback: F) {
        let feedback = Carried(feedback);
        self.feedback.publish(FeedbackMessage { goal_id, feedback });
    }

    /// Answers whether a goal is pursued, and since when.
    pub fn answer_goal(&self, id: RequestId, accepted: bool, stamp: Time) {
        let response = SendGoalResponse { accepted, stamp };
        self.clients[0].log_failure(&self.library.borrow().send_goal_response(id, response));
    }

    /// Answers which goals are cancelled.
    pub fn answer_cancellation(&self, id: RequestId, response: CancelGoalResponse) {
        self.clients[1].log_failure(&self.library.borrow().send_cancel_response(id, response));
    }

    /// Answers with the state of a goal and its result.
    pub fn answer_result(&self, id: RequestId, status: GoalStatusEnum, result: R) {
        let result = Carried(result);
        let response = GetResultResponse { status, result };
        self.clients[2].log_failure(&self.library.borrow().send_result(id, response));
    }
}

/// An action that is served, and the stream of the requests of its clients.
pub type ServedAction<G, R, F> = (
    ActionServer<G, R, F>,
    LocalBoxStream<'static, ActionRequest<G>>,
);

/// The quality that ROS 2 gives to feedback.
const FEEDBACK: Quality = Quality::ReliableVolatile { depth: 10 };
/// The quality that ROS 2 gives to the states of goals.
const STATUS: Quality = Quality::TransientLocal { depth: 1 };

impl Session {
    /// Serves an action.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn serve_action<G: ActionData, R: ActionData, F: ActionData>(
        &mut self,
        action: &Action<G, R, F>,
    ) -> Result<ServedAction<G, R, F>, SessionError> {
        let name = self.resolve(Resource::Service, action.name)?;
        let parsed = library_name(&name)?;
        let type_name = ActionTypeName::new(action.package, action.type_name);
        let mapping = self.service_mapping.library();
        let qos = ActionServerQosPolicies {
            goal_service: service_qos(),
            result_service: service_qos(),
            cancel_service: service_qos(),
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
        let (feedback, status) = (Rc::clone(&library), Rc::clone(&library));
        let send_feedback = move |sample: FeedbackMessage<Carried<F>>| {
            let library = feedback.borrow();
            library.send_feedback(sample.goal_id, sample.feedback)
        };
        let send_status = move |sample| status.borrow().send_goal_statuses(sample);
        let server = ActionServer {
            library,
            clients,
            feedback: self.queue("feedback", FEEDBACK, Box::new(send_feedback)),
            status: self.queue("status", STATUS, Box::new(send_status)),
        };
        Ok((server, select_all(streams).boxed_local()))
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
