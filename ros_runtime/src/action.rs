//! Actions as values: ROS 2 makes an action of three services and two topics.

use futures::stream::LocalBoxStream;
use ros2_client::action::{
    CancelGoalResponse, FeedbackMessage, GetResultResponse, GoalId, GoalInfo, GoalStatusEnum,
    SendGoalResponse,
};
use ros2_client::action_msgs::GoalStatusArray;
use ros2_client::builtin_interfaces::Time;

use crate::publisher_queue::{PublisherQueue, Sink};
use crate::service::{Carried, RequestId, Served, ServiceData};
use crate::topic::Quality;

/// An action whose goals are `G`, whose results are `R`, and whose feedback is `F`.
pub type Action<G, R, F> = Served<fn(G) -> (R, F)>;

/// A request of a client of an action, which the [`ActionServer`] answers.
pub enum ActionRequest<G> {
    /// Pursue a goal.
    SendGoal(RequestId, GoalId, G),
    /// Cancel goals.
    CancelGoal(RequestId, GoalInfo),
    /// Report the result of a goal, once it has ended.
    GetResult(RequestId, GoalId),
}

/// Sends the answer to the request with this identifier.
pub(crate) type Answer<A> = Box<dyn Fn(RequestId, A)>;

/// The endpoints of an action.
pub(crate) struct ActionEndpoints<R, F> {
    pub goal: Answer<SendGoalResponse>,
    pub cancellation: Answer<CancelGoalResponse>,
    pub result: Answer<GetResultResponse<Carried<R>>>,
    pub feedback: Sink<FeedbackMessage<Carried<F>>>,
    pub status: Sink<GoalStatusArray>,
}

/// What a middleware makes of an action.
pub(crate) type OpenedAction<G, R, F> = (
    ActionEndpoints<R, F>,
    LocalBoxStream<'static, ActionRequest<G>>,
);

/// Answers the clients of an action, and publishes on its goals.
pub struct ActionServer<R: ServiceData, F: ServiceData> {
    pub(crate) goal: Answer<SendGoalResponse>,
    pub(crate) cancellation: Answer<CancelGoalResponse>,
    pub(crate) result: Answer<GetResultResponse<Carried<R>>>,
    pub(crate) feedback: PublisherQueue<FeedbackMessage<Carried<F>>>,
    /// The states of all goals.
    pub status: PublisherQueue<GoalStatusArray>,
}

impl<R: ServiceData, F: ServiceData> ActionServer<R, F> {
    /// Publishes feedback on a goal.
    pub fn publish_feedback(&self, goal_id: GoalId, feedback: F) {
        let feedback = Carried(feedback);
        self.feedback.publish(FeedbackMessage { goal_id, feedback });
    }

    /// Answers whether a goal is pursued, and since when.
    pub fn answer_goal(&self, id: RequestId, accepted: bool, stamp: Time) {
        (self.goal)(id, SendGoalResponse { accepted, stamp });
    }

    /// Answers which goals are cancelled.
    pub fn answer_cancellation(&self, id: RequestId, response: CancelGoalResponse) {
        (self.cancellation)(id, response);
    }

    /// Answers with the state of a goal and its result.
    pub fn answer_result(&self, id: RequestId, status: GoalStatusEnum, result: R) {
        let result = Carried(result);
        (self.result)(id, GetResultResponse { status, result });
    }
}

/// An action that is served, and the stream of the requests of its clients.
pub type ServedAction<G, R, F> = (
    ActionServer<R, F>,
    LocalBoxStream<'static, ActionRequest<G>>,
);

/// The quality that ROS 2 gives to feedback.
pub(crate) const FEEDBACK: Quality = Quality::ReliableVolatile { depth: 10 };
/// The quality that ROS 2 gives to the states of goals.
pub(crate) const STATUS: Quality = Quality::TransientLocal { depth: 1 };
