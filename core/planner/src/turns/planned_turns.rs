//! All turns of a problem, decided at once: what an agent compares the claims of others with.

use std::sync::Arc;

use super::planning::{ClaimRefused, Planning};
use formation_model::{Decision, MicroUnits, ModuleId, Plan, PlanningProblem};

/// The decisions of all turns of a problem, and the plan to which they lead.
///
/// Both follow from the problem alone, so agents of one process can share the value. Only this module makes one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedTurns {
    problem: Arc<PlanningProblem>,
    /// The claimant of each turn with its decision.
    turns: Vec<(ModuleId, Decision)>,
    plan: Arc<Plan>,
}

impl PlannedTurns {
    /// Takes all turns of a problem.
    #[must_use]
    pub fn of(problem: Arc<PlanningProblem>) -> Self {
        Self::with_values(problem).0
    }

    /// The same, with the values of the spots of the problem's target, by position.
    pub(super) fn with_values(problem: Arc<PlanningProblem>) -> (Self, Vec<MicroUnits>) {
        let mut planning = Planning::new(Arc::clone(&problem));
        let turns = planning.take_all_turns();
        let planned = Self {
            problem,
            turns: turns
                .into_iter()
                .map(|(turn, decision)| (turn.claimant, decision))
                .collect(),
            plan: Arc::new(planning.ordered()),
        };
        (planned, planning.spot_values())
    }

    pub(super) fn last_decision(&mut self) -> Option<&mut (ModuleId, Decision)> {
        self.turns.last_mut()
    }

    /// The problem that was planned for.
    #[must_use]
    pub fn problem(&self) -> &Arc<PlanningProblem> {
        &self.problem
    }

    /// The plan after the last turn.
    #[must_use]
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// The module that decides in a turn, with its decision; `None` after the last turn.
    #[must_use]
    pub fn turn(&self, number: u32) -> Option<(ModuleId, &Decision)> {
        let (claimant, decision) = self.turns.get(usize::try_from(number).ok()?)?;
        Some((*claimant, decision))
    }

    /// The claimant of each turn with its decision, in order.
    #[must_use]
    pub fn decisions(&self) -> &[(ModuleId, Decision)] {
        &self.turns
    }

    /// All turns in order: the number of each, the module that decides, and its decision.
    pub fn turns(&self) -> impl Iterator<Item = (u32, ModuleId, &Decision)> {
        let turns = (0..).zip(&self.turns);
        turns.map(|(number, (claimant, decision))| (number, *claimant, decision))
    }

    /// Checks a claim: it must come from the module whose turn it is, and equal the decision that follows from the problem.
    ///
    /// # Errors
    /// Names the reason.
    /// Enforces T2.
    pub fn check(
        &self,
        turn: u32,
        claimant: ModuleId,
        claimed: &Decision,
    ) -> Result<(), ClaimRefused> {
        let (expected_claimant, expected) = self.turn(turn).ok_or(ClaimRefused::NoTurnLeft)?;
        if claimant != expected_claimant {
            return Err(ClaimRefused::WrongClaimant {
                expected: expected_claimant,
            });
        }
        if claimed != expected {
            return Err(ClaimRefused::DifferentDecision {
                turn,
                expected: Box::new(expected.clone()),
                claimed: Box::new(claimed.clone()),
            });
        }
        Ok(())
    }
}
