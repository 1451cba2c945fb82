//! The plan that an agent asks for, of its host or of itself.

use std::sync::Arc;

use super::io::Output;
use super::outbox::Outbox;
use super::plans::{ComputedPlan, PlanJob};

/// The plan that an agent has asked for last.
#[derive(Clone, Debug, Default)]
pub(super) struct Plans {
    /// Whether the host computes plans; otherwise the agent does.
    pub by_host: bool,
    asked: Option<PlanJob>,
    computed: Option<Arc<ComputedPlan>>,
}

impl Plans {
    /// The plan of a job if it is known; otherwise the host is asked for it, once.
    /// Enforces T5.
    pub fn get(&mut self, job: PlanJob, outbox: &mut Outbox) -> Option<Arc<ComputedPlan>> {
        let known = self.computed.as_ref();
        if let Some(computed) = known.filter(|computed| computed.answers(&job)) {
            return Some(Arc::clone(computed));
        }
        if !self.by_host {
            return Some(Arc::clone(self.computed.insert(Arc::new(job.run()))));
        }
        if self.asked.as_ref() != Some(&job) {
            self.asked = Some(job.clone());
            outbox.push(Output::Compute(job));
        }
        None
    }

    /// The job that it waits for.
    pub fn asked(&self) -> Option<&PlanJob> {
        self.asked.as_ref()
    }

    /// Takes a plan of the host; returns whether it is the one that was asked for.
    pub fn receive(&mut self, computed: Arc<ComputedPlan>) -> bool {
        let is_asked = |job: &mut PlanJob| computed.answers(job);
        let is_answer = self.asked.take_if(is_asked).is_some();
        if is_answer {
            self.computed = Some(computed);
        }
        is_answer
    }
}

#[cfg(test)]
mod tests {
    use formation_planner::PlannedTurns;

    use super::*;
    use crate::plans::tests::{job, problem};

    #[test]
    fn an_agent_takes_the_plan_that_it_asked_for_only() {
        let mut outbox = Outbox::default();
        let mut plans = Plans {
            by_host: true,
            ..Plans::default()
        };
        let (wanted, other) = (job(4), job(5));
        assert!(plans.get(wanted.clone(), &mut outbox).is_none());
        assert!(plans.get(wanted.clone(), &mut outbox).is_none());
        let asked = std::iter::from_fn(|| outbox.pop()).collect::<Vec<_>>();
        assert!(matches!(&asked[..], [Output::Compute(job)] if *job == wanted));
        assert!(!plans.receive(Arc::new(other.run())));
        assert!(plans.get(wanted.clone(), &mut outbox).is_none());
        let computed = Arc::new(wanted.clone().run());
        assert!(plans.receive(Arc::clone(&computed)));
        assert!(!plans.receive(computed), "it has it");
        let taken = plans.get(wanted, &mut outbox).unwrap();
        assert_eq!(*taken.turns(), PlannedTurns::of(problem(4)));
    }
}
