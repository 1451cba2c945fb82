//! Actions over Zenoh: three services and two topics.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use futures::StreamExt;
use futures::stream::{LocalBoxStream, select_all};
use ros2_client::action::{GetResultRequest, GoalInfo, SendGoalRequest};
use serde::Deserialize;

use super::ZenohGraph;
use super::endpoints::Asked;
use crate::action::{
    Action, ActionEndpoints, ActionRequest, Answer, FEEDBACK, OpenedAction, STATUS,
};
use crate::ros_context_error::RosContextError;
use crate::service::{Carried, Reply, RequestId, ServiceData};

/// How many requests to one service of an action can wait for their answers: more than goals can have.
const UNANSWERED_MAX: usize = 4_096;

/// `action_msgs/srv/CancelGoal_Request`, whose field the library keeps private.
#[derive(Deserialize)]
struct Cancellation {
    goal_info: GoalInfo,
}

impl ZenohGraph {
    /// Serves an action under its fully qualified name.
    pub(crate) fn serve_action<G: ServiceData, R: ServiceData, F: ServiceData>(
        &mut self,
        action: &Action<G, R, F>,
        name: &str,
    ) -> Result<OpenedAction<G, R, F>, RosContextError> {
        let (package, type_name) = action.type_name();
        let of_type = |part: &str| format!("{package}/action/{type_name}_{part}");
        let place = |part: &str| format!("{name}/_action/{part}");
        let goals = self.typed_server(&place("send_goal"), &of_type("SendGoal"))?;
        let cancel = "action_msgs/srv/CancelGoal";
        let cancellations = self.typed_server(&place("cancel_goal"), cancel)?;
        let results = self.typed_server(&place("get_result"), &of_type("GetResult"))?;
        let (goals, goal) = by_number(goals);
        let (cancellations, cancellation) = by_number(cancellations);
        let (results, result) = by_number(results);
        let feedback = of_type("FeedbackMessage");
        let endpoints = ActionEndpoints {
            goal,
            cancellation,
            result,
            feedback: self.typed_publisher(&place("feedback"), &feedback, FEEDBACK)?,
            status: self.typed_publisher(
                &place("status"),
                "action_msgs/msg/GoalStatusArray",
                STATUS,
            )?,
        };
        let streams = [
            goals
                .map(|(id, request): (_, SendGoalRequest<Carried<G>>)| {
                    ActionRequest::SendGoal(id, request.goal_id, request.goal.0)
                })
                .boxed_local(),
            cancellations
                .map(|(id, request): (_, Cancellation)| {
                    ActionRequest::CancelGoal(id, request.goal_info)
                })
                .boxed_local(),
            results
                .map(|(id, request): (_, GetResultRequest)| {
                    ActionRequest::GetResult(id, request.goal_id)
                })
                .boxed_local(),
        ];
        Ok((endpoints, select_all(streams).boxed_local()))
    }
}

/// The requests, and what answers the one with a number.
fn by_number<Q: 'static, A: 'static>(
    asked: LocalBoxStream<'static, Asked<Q, A>>,
) -> (LocalBoxStream<'static, (RequestId, Q)>, Answer<A>) {
    let unanswered: Rc<RefCell<BTreeMap<RequestId, Reply<A>>>> = Rc::default();
    let waiting = Rc::clone(&unanswered);
    let requests = asked.map(move |(id, request, reply)| {
        let mut waiting = waiting.borrow_mut();
        waiting.insert(id, reply);
        if waiting.len() > UNANSWERED_MAX {
            waiting.pop_first();
        }
        (id, request)
    });
    let answer = move |id, answer| {
        let reply = unanswered.borrow_mut().remove(&id);
        if let Some(reply) = reply {
            reply(answer);
        }
    };
    (requests.boxed_local(), Box::new(answer))
}
