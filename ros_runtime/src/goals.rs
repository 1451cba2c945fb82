//! The goals of an action: the state of each, the clients that wait for its result, and what a request to cancel
//! means. This module knows no DDS.
//!
//! See the design article [Actions](https://design.ros2.org/articles/actions.html).

use std::collections::VecDeque;

use ros2_client::action::{CancelGoalResponse, GoalId, GoalInfo, GoalStatusEnum};
use ros2_client::action_msgs::{CancelGoalResponseEnum, GoalStatus, GoalStatusArray};
use ros2_client::builtin_interfaces::Time;

/// How many ended goals are kept, for clients that ask late for their results.
const ENDED_MAX: usize = 16;

/// How many clients can wait for the result of one goal.
const WAITING_MAX: usize = 64;

struct Goal<R, Q> {
    info: GoalInfo,
    status: GoalStatusEnum,
    result: R,
    waiting: Vec<Q>,
}

impl<R, Q> Goal<R, Q> {
    fn has_ended(&self) -> bool {
        matches!(
            self.status,
            GoalStatusEnum::Succeeded | GoalStatusEnum::Canceled | GoalStatusEnum::Aborted
        )
    }
}

/// The goals that a server knows, in the order in which it accepted them; results are of type `R`, and a `Q` stands for
/// a client that waits for one.
pub struct Goals<R, Q> {
    goals: VecDeque<Goal<R, Q>>,
}

impl<R, Q> Default for Goals<R, Q> {
    fn default() -> Self {
        let goals = VecDeque::new();
        Self { goals }
    }
}

impl<R: Clone + Default, Q> Goals<R, Q> {
    fn find(&mut self, id: GoalId) -> Option<&mut Goal<R, Q>> {
        self.goals.iter_mut().find(|goal| goal.info.goal_id == id)
    }

    /// Whether a goal with this identifier was accepted, and is not forgotten.
    pub fn knows(&self, id: GoalId) -> bool {
        self.goals.iter().any(|goal| goal.info.goal_id == id)
    }

    /// Accepts a goal that is executed at once; false if a goal with its identifier is known.
    pub fn accept(&mut self, id: GoalId, stamp: Time) -> bool {
        if self.knows(id) {
            return false;
        }
        let ended = |goal: &Goal<R, Q>| goal.has_ended();
        if self.goals.iter().filter(|goal| ended(goal)).count() >= ENDED_MAX
            && let Some(oldest) = self.goals.iter().position(ended)
        {
            self.goals.remove(oldest);
        }
        self.goals.push_back(Goal {
            info: GoalInfo { goal_id: id, stamp },
            status: GoalStatusEnum::Executing,
            result: R::default(),
            waiting: Vec::new(),
        });
        true
    }

    /// Ends a goal; returns the clients that waited for its result.
    pub fn end(&mut self, id: GoalId, status: GoalStatusEnum, result: R) -> Vec<Q> {
        let Some(goal) = self.find(id) else {
            return Vec::new();
        };
        goal.status = status;
        goal.result = result;
        std::mem::take(&mut goal.waiting)
    }

    /// Handles a client that asks for the result of a goal. Returns the client with its answer, or `None` if the answer
    /// comes when the goal ends. A goal that is not known has the status "unknown".
    pub fn ask(&mut self, id: GoalId, client: Q) -> Option<(Q, GoalStatusEnum, R)> {
        match self.find(id) {
            Some(goal) if !goal.has_ended() && goal.waiting.len() < WAITING_MAX => {
                goal.waiting.push(client);
                None
            }
            Some(goal) if goal.has_ended() => Some((client, goal.status, goal.result.clone())),
            _ => Some((client, GoalStatusEnum::Unknown, R::default())),
        }
    }

    /// Handles a request to cancel goals: the goal that it names, and all that were accepted up to the time that it
    /// names; all goals if it names neither. Returns the answer; the goals that it lists are being cancelled.
    pub fn cancel(&mut self, meant: &GoalInfo) -> CancelGoalResponse {
        let names_one = meant.goal_id != GoalId::ZERO;
        let names_time = meant.stamp != Time::ZERO;
        let goals_canceling: Vec<GoalInfo> = self
            .goals
            .iter_mut()
            .filter(|goal| !goal.has_ended())
            .filter(|goal| {
                (!names_one && !names_time)
                    || (names_one && goal.info.goal_id == meant.goal_id)
                    || (names_time && goal.info.stamp <= meant.stamp)
            })
            .map(|goal| {
                goal.status = GoalStatusEnum::Canceling;
                goal.info.clone()
            })
            .collect();
        let named = names_one.then(|| self.find(meant.goal_id));
        let return_code = match named {
            _ if !goals_canceling.is_empty() => CancelGoalResponseEnum::None,
            Some(None) => CancelGoalResponseEnum::UnknownGoal,
            Some(Some(_)) => CancelGoalResponseEnum::GoalTerminated,
            None => CancelGoalResponseEnum::Rejected,
        };
        CancelGoalResponse {
            return_code,
            goals_canceling,
        }
    }

    /// The states of all goals.
    pub fn statuses(&self) -> GoalStatusArray {
        GoalStatusArray {
            status_list: self
                .goals
                .iter()
                .map(|goal| GoalStatus {
                    goal_info: goal.info.clone(),
                    status: goal.status,
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id() -> GoalId {
        GoalId::new_random()
    }

    fn time(nanos: i64) -> Time {
        Time::from_nanos(nanos)
    }

    fn statuses(goals: &Goals<&str, u32>) -> Vec<GoalStatusEnum> {
        let list = goals.statuses().status_list;
        list.iter().map(|goal| goal.status).collect()
    }

    #[test]
    fn results_reach_clients_that_asked_early_and_that_ask_late() {
        let mut goals: Goals<&str, u32> = Goals::default();
        let one = id();
        assert!(goals.accept(one, time(1)));
        assert!(!goals.accept(one, time(2)), "it is known");
        assert_eq!(goals.ask(one, 7), None);
        assert_eq!(goals.ask(one, 8), None);
        assert_eq!(goals.end(one, GoalStatusEnum::Succeeded, "done"), [7, 8]);
        let answer = Some((9, GoalStatusEnum::Succeeded, "done"));
        assert_eq!(goals.ask(one, 9), answer);
        let unknown = Some((9, GoalStatusEnum::Unknown, ""));
        assert_eq!(goals.ask(id(), 9), unknown);
    }

    #[test]
    fn requests_to_cancel_name_one_goal_or_a_time_or_mean_all() {
        let (first, second, third) = (id(), id(), id());
        let running = || {
            let mut goals: Goals<&str, u32> = Goals::default();
            for (id, at) in [(first, 1), (second, 2), (third, 3)] {
                goals.accept(id, time(at));
            }
            goals.end(first, GoalStatusEnum::Aborted, "");
            goals
        };
        let cancel = |goal_id, at| {
            let mut goals = running();
            let stamp = time(at);
            let response = goals.cancel(&GoalInfo { goal_id, stamp });
            (response.return_code, statuses(&goals)[1..].to_vec())
        };
        let (none, executing, canceling) = (
            CancelGoalResponseEnum::None,
            GoalStatusEnum::Executing,
            GoalStatusEnum::Canceling,
        );
        assert_eq!(
            cancel(GoalId::ZERO, 0),
            (none, vec![canceling, canceling]),
            "all"
        );
        assert_eq!(cancel(GoalId::ZERO, 2), (none, vec![canceling, executing]));
        assert_eq!(cancel(third, 0), (none, vec![executing, canceling]));
        assert_eq!(cancel(third, 2), (none, vec![canceling, canceling]));
        for (goal, at, code) in [
            (first, 0, CancelGoalResponseEnum::GoalTerminated),
            (id(), 0, CancelGoalResponseEnum::UnknownGoal),
            (GoalId::ZERO, 1, CancelGoalResponseEnum::Rejected),
        ] {
            assert_eq!(cancel(goal, at), (code, vec![executing, executing]));
        }
    }

    #[test]
    fn ended_goals_make_room_and_others_do_not() {
        let mut goals: Goals<&str, u32> = Goals::default();
        let lasting = id();
        goals.accept(lasting, time(0));
        for at in 1..100 {
            let passing = id();
            goals.accept(passing, time(at));
            goals.end(passing, GoalStatusEnum::Aborted, "");
        }
        assert_eq!(statuses(&goals).len(), ENDED_MAX + 1);
        assert_eq!(goals.ask(lasting, 1), None);
    }
}
