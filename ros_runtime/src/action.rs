//! Serving an action, which ROS 2 makes of three services and two topics.
//!
//! The library names and makes the endpoints. Its own server for them is not used: it never answers who asks for the result
//! of a goal that has ended, and does not tell goals that are unknown or have ended from others when one is to be
//! cancelled.

use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll};

use futures::StreamExt;
use futures::stream::{LocalBoxStream, poll_fn};
use ros2_client::action::{
    ActionServerQosPolicies, CancelGoalRequest, CancelGoalResponse, FeedbackMessage, GoalId,
    GoalInfo, GoalStatusEnum, SendGoalResponse,
};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::builtin_interfaces::Time;
use ros2_client::{Message, ReadError, Server};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::arguments::Resource;
use crate::outlet::{Declined, Outlet, Sink, declined};
use crate::service::{Carried, Clients, RequestId, passed_on, service_qos};
use crate::session::{Session, SessionError};
use crate::topic::{Quality, Topic};
use crate::traffic::Traffic;

/// An action as ROS 2 names it: `PACKAGE/action/NAME`.
pub trait ActionType: 'static {
    /// The package that defines it.
    const PACKAGE: &'static str;
    /// The action within the package.
    const NAME: &'static str;
    /// What is to be done.
    type Goal: Serialize + DeserializeOwned + Clone + 'static;
    /// What came of it.
    type Result: Serialize + DeserializeOwned + Clone + 'static;
    /// How far it has come.
    type Feedback: Serialize + DeserializeOwned + 'static;
}

/// The library's serving end of an action.
pub type LibraryAction<A> = ros2_client::ActionServer<
    Carried<<A as ActionType>::Goal>,
    Carried<<A as ActionType>::Result>,
    Carried<<A as ActionType>::Feedback>,
>;

type Shared<A> = Rc<RefCell<LibraryAction<A>>>;
type Feedback<A> = FeedbackMessage<Carried<<A as ActionType>::Feedback>>;

/// What a client of an action wants.
pub enum ActionRequest<G> {
    /// That a goal is pursued.
    SendGoal(RequestId, GoalId, G),
    /// That goals are given up.
    CancelGoal(RequestId, GoalInfo),
    /// To know what came of a goal, once it has ended.
    GetResult(RequestId, GoalId),
}

/// The serving end of an action.
pub struct ActionServer<A: ActionType> {
    library: Shared<A>,
    goals: Clients,
    cancellations: Clients,
    results: Clients,
}

/// The ends at which an action tells of its goals.
pub struct ActionOutlets<A: ActionType> {
    feedback: Outlet<Feedback<A>, FeedbackSink<A>>,
    status: Outlet<GoalStatusArray, StatusSink<A>>,
}

struct FeedbackSink<A: ActionType>(Shared<A>);
struct StatusSink<A: ActionType>(Shared<A>);

impl<A: ActionType> Sink<Feedback<A>> for FeedbackSink<A> {
    fn offer(&self, sample: Feedback<A>) -> Result<(), Declined<Feedback<A>>> {
        let library = self.0.borrow();
        library
            .send_feedback(sample.goal_id, sample.feedback)
            .map_err(declined)
    }
}

impl<A: ActionType> Sink<GoalStatusArray> for StatusSink<A> {
    fn offer(&self, sample: GoalStatusArray) -> Result<(), Declined<GoalStatusArray>> {
        let library = self.0.borrow();
        library.send_goal_statuses(sample).map_err(declined)
    }
}

/// The quality that ROS 2 gives to feedback.
const FEEDBACK: Quality = Quality::ReliableVolatile { depth: 10 };
/// The quality that ROS 2 gives to the states of goals.
const STATUS: Quality = Quality::TransientLocal { depth: 1 };

/// The quality that ROS 2 gives to each part of an action.
pub fn action_qos() -> ActionServerQosPolicies {
    ActionServerQosPolicies {
        goal_service: service_qos(),
        result_service: service_qos(),
        cancel_service: service_qos(),
        feedback_publisher: FEEDBACK.publisher_qos(),
        status_publisher: STATUS.publisher_qos(),
    }
}

/// The library keeps to itself what a request to cancel names, but writes it out.
#[derive(Deserialize)]
struct Cancellation {
    goal_info: GoalInfo,
}

fn goals_named(request: &CancelGoalRequest) -> Option<GoalInfo> {
    let written = serde_json::to_value(request).ok()?;
    let read: Cancellation = serde_json::from_value(written).ok()?;
    Some(read.goal_info)
}

/// Looks once whether a request came in, and has the task woken when one does.
fn look<Q, P>(
    server: &Server<Q, P>,
    context: &mut Context<'_>,
) -> Poll<Option<Result<(RequestId, Q), ReadError>>>
where
    Q: Message + 'static,
    P: Message + 'static,
{
    pin!(server.async_receive_request()).poll(context).map(Some)
}

impl<A: ActionType> ActionServer<A> {
    /// Serves `name`, which is expanded and remapped as the name of a service is.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn open(session: &mut Session, name: &str) -> Result<Self, SessionError> {
        let name = session.resolve(Resource::Service, name)?;
        let library = session.action_server::<A>(&name)?;
        let clients = |part: &str| Clients::of(session, &format!("{name}/_action/{part}"));
        Ok(Self {
            goals: clients("send_goal"),
            cancellations: clients("cancel_goal"),
            results: clients("get_result"),
            library: Rc::new(RefCell::new(library)),
        })
    }

    /// Where it tells of its goals.
    pub fn outlets(&self) -> ActionOutlets<A> {
        let shared = || Rc::clone(&self.library);
        ActionOutlets {
            feedback: Outlet::new(
                &Topic::new("feedback", A::PACKAGE, A::NAME, FEEDBACK),
                FeedbackSink(shared()),
            ),
            status: Outlet::new(
                &Topic::new("status", "action_msgs", "GoalStatusArray", STATUS),
                StatusSink(shared()),
            ),
        }
    }

    /// Everything that clients want, for ever.
    pub fn requests(&self) -> [LocalBoxStream<'_, ActionRequest<A::Goal>>; 3] {
        // The library lends its services one at a time, so each is borrowed anew for every look at it.
        let goals = poll_fn(|context| look(self.library.borrow_mut().goal_server(), context));
        let cancellations =
            poll_fn(|context| look(self.library.borrow_mut().cancel_server(), context));
        let results = poll_fn(|context| look(self.library.borrow_mut().result_server(), context));
        [
            passed_on(goals, &self.goals)
                .map(|(id, request)| ActionRequest::SendGoal(id, request.goal_id, request.goal.0))
                .boxed_local(),
            passed_on(cancellations, &self.cancellations)
                .filter_map(|(id, request)| async move {
                    let named = goals_named(&request);
                    if named.is_none() {
                        tracing::warn!("dropped a request to cancel, which the library does not write out any more");
                    }
                    Some(ActionRequest::CancelGoal(id, named?))
                })
                .boxed_local(),
            passed_on(results, &self.results)
                .map(|(id, request)| ActionRequest::GetResult(id, request.goal_id))
                .boxed_local(),
        ]
    }

    /// Says whether a goal is pursued from now on.
    pub fn answer_goal(&self, id: RequestId, accepted: bool, stamp: Time) {
        let response = SendGoalResponse { accepted, stamp };
        let sent = self.library.borrow().send_goal_response(id, response);
        self.goals.note(&sent);
    }

    /// Says which goals are given up.
    pub fn answer_cancellation(&self, id: RequestId, response: CancelGoalResponse) {
        let sent = self.library.borrow().send_cancel_response(id, response);
        self.cancellations.note(&sent);
    }

    /// Says what came of a goal.
    pub fn answer_result(&self, id: RequestId, status: GoalStatusEnum, result: A::Result) {
        let response = ros2_client::action::GetResultResponse {
            status,
            result: Carried(result),
        };
        let sent = self.library.borrow().send_result(id, response);
        self.results.note(&sent);
    }
}

impl<A: ActionType> ActionOutlets<A> {
    /// Tells how far a goal has come.
    pub fn tell(&mut self, goal_id: GoalId, feedback: A::Feedback, traffic: &mut Traffic) {
        let feedback = Carried(feedback);
        self.feedback
            .publish(FeedbackMessage { goal_id, feedback }, traffic);
    }

    /// Tells in which state all goals are.
    pub fn tell_statuses(&mut self, statuses: GoalStatusArray, traffic: &mut Traffic) {
        self.status.publish(statuses, traffic);
    }

    /// Publishes the samples that wait for room.
    pub fn flush(&mut self, traffic: &mut Traffic) {
        self.feedback.flush(traffic);
        self.status.flush(traffic);
    }

    /// Whether samples wait for room.
    pub fn is_waiting(&self) -> bool {
        self.feedback.is_waiting() || self.status.is_waiting()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_to_be_cancelled_is_read() {
        let meant = GoalInfo {
            goal_id: GoalId::new_random(),
            stamp: Time::new(5, 70),
        };
        let info = serde_json::to_value(&meant).unwrap();
        let request = serde_json::json!({"goal_info": info});
        let request: CancelGoalRequest = serde_json::from_value(request).unwrap();
        let read = goals_named(&request).unwrap();
        assert_eq!((read.goal_id, read.stamp), (meant.goal_id, meant.stamp));
    }
}
