//! The deliberate bugs. `bugs.patch` has the places where agents ask whether they have one.

use std::sync::Arc;

use formation_model::{Digest, ModuleId, PlanningProblem};

use super::refusal::Refusal;

/// One bug.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Mutation {
    /// Follows rosters of epochs that are over.
    /// Lacks E1.
    AcceptStaleEpoch,
    /// Counts every member as agreed, whatever its digest.
    /// Lacks A1.
    SkipDigestBarrier,
    /// Moves as soon as all members agree.
    /// Lacks A2.
    SkipLeaseWait,
    /// Sets off at once after the last plan, whoever of its members the roster leaves out.
    /// Lacks A2.
    FollowAnyPlan,
    /// Keeps moving when members no longer show agreement.
    /// Lacks A3.
    IgnoreLapse,
    /// Takes a restarted process for the one that it knew.
    /// Lacks G3.
    DropIncarnationCheck,
    /// Applies claims that differ from its own recomputation.
    /// Lacks T2.
    AcceptWithoutRecomputation,
    /// Records claims in the order in which they arrive.
    ApplyOutOfTurn,
    /// Needs no majority of the voters.
    /// Lacks Q1.
    IgnoreQuorum,
    /// Counts a restarted module as if it had forgotten nothing.
    /// Lacks Q2.
    CountForgetful,
    /// Begins a step without waiting for other units.
    /// Lacks X8.
    SkipWaits,
    /// Forgets the spot on which it has settled.
    ForgetPins,
    /// Freezes with the spot of whatever target it knows.
    PinForAnyTarget,
    /// Plans as if no module were docked, and so evicts members of configurations.
    EvictConfigurationMember,
    /// Counts every module that it ever received a heartbeat from as live.
    /// Lacks M1.
    CountDeadAsAlive,
    /// Holds another plan than it should, as a module of another build might.
    DifferentPlan,
    /// Never includes a late module to fill an open spot.
    IgnoreNewcomers,
    /// Plans as if absent modules had no bodies.
    /// Lacks B3.
    IgnoreBodies,
    /// Forgets its pin when it decides to set off, before its drive has a goal.
    ForgetPinBeforeGoal,
    /// Restarts without the bodies that its store holds.
    ForgetStoredBodies,
    /// Drives on, or stays settled, wherever it is measured.
    /// Lacks X14.
    IgnorePlace,
    /// Drops a module as soon as somebody reports its body as removed.
    /// Lacks B5.
    TrustRemovals,
}

/// The bug that an agent has, if any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Bugs {
    pub(super) chosen: Option<Mutation>,
}

impl Bugs {
    pub(super) fn has(self, mutation: Mutation) -> bool {
        self.chosen == Some(mutation)
    }

    /// Modules as they count towards a majority.
    pub(super) fn counted(
        self,
        present: impl Iterator<Item = (ModuleId, bool)>,
    ) -> impl Iterator<Item = (ModuleId, bool)> {
        let all_know = self.has(Mutation::CountForgetful);
        present.map(move |(module, knows)| (module, knows || all_know))
    }

    /// The problem that is planned for; `None` if it contradicts itself.
    pub(super) fn planned(self, problem: Arc<PlanningProblem>) -> Option<Arc<PlanningProblem>> {
        if !self.has(Mutation::EvictConfigurationMember) {
            return Some(problem);
        }
        let mut modules = problem.modules().to_vec();
        for module in &mut modules {
            module.links.clear();
        }
        let target = Arc::clone(problem.target());
        let problem = PlanningProblem::new(target, *problem.parameters(), modules);
        problem.ok().map(Arc::new)
    }

    /// The digest that is shown for a plan with this one.
    pub(super) fn shown(self, digest: Digest) -> Digest {
        if self.has(Mutation::DifferentPlan) {
            Digest(digest.0 ^ 1)
        } else {
            digest
        }
    }

    /// The judgement of a claim.
    pub(super) fn accepted(self, judgement: Result<(), Refusal>) -> Result<(), Refusal> {
        if self.has(Mutation::AcceptWithoutRecomputation) {
            judgement.or_else(|refusal| match refusal {
                Refusal::DifferentDecision => Ok(()),
                _ => Err(refusal),
            })
        } else {
            judgement
        }
    }
}
