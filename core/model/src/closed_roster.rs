//! A roster that no longer changes, with what follows from it.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::{
    Digest, PlanningProblem, ProblemError, Roster, RosterMember, SpotId, digest, standing_bodies,
};

/// A roster that its convener has closed.
///
/// All agents of a process share the value, and what follows from the roster is computed once for all of them.
#[derive(Clone, Debug)]
pub struct ClosedRoster {
    roster: Roster,
    problem: OnceLock<Result<Option<Arc<PlanningProblem>>, ProblemError>>,
    target_digest: OnceLock<Digest>,
}

impl From<Roster> for ClosedRoster {
    fn from(roster: Roster) -> Self {
        Self {
            roster,
            problem: OnceLock::new(),
            target_digest: OnceLock::new(),
        }
    }
}

impl Deref for ClosedRoster {
    type Target = Roster;

    fn deref(&self) -> &Roster {
        &self.roster
    }
}

impl PartialEq for ClosedRoster {
    /// The rest follows from the roster.
    fn eq(&self, other: &Self) -> bool {
        self.roster == other.roster
    }
}

impl Eq for ClosedRoster {}

impl ClosedRoster {
    /// The planning input of this roster: the part of its target that bodies leave open, and its active members. A pin outside
    /// of that part does not count. `None` when there is nothing to form.
    ///
    /// # Errors
    /// Names the contradiction in the roster.
    /// Enforces T5, S1, B3.
    pub fn problem(&self) -> Result<Option<Arc<PlanningProblem>>, ProblemError> {
        self.problem
            .get_or_init(|| problem_of(&self.roster))
            .clone()
    }

    /// The digest of its target.
    pub fn target_digest(&self) -> Digest {
        *self
            .target_digest
            .get_or_init(|| digest::of_target(&self.roster.target))
    }
}

fn problem_of(roster: &Roster) -> Result<Option<Arc<PlanningProblem>>, ProblemError> {
    let (Some(whole), Some(target)) = (&roster.target.target, roster.open_target()) else {
        return Ok(None);
    };
    let is_outside =
        |spot: SpotId| whole.position_of(spot).is_some() && target.position_of(spot).is_none();
    let modules = RosterMember::active(&roster.members).map(|member| {
        let mut module = member.module.clone();
        module.pin = module.pin.filter(|&spot| !is_outside(spot));
        module
    });
    let modules = modules.collect();
    let problem = PlanningProblem::new(target, roster.target.parameters, modules)?;
    let problem = problem.with_bodies(standing_bodies(roster));
    problem.check_given()?;
    Ok(Some(Arc::new(problem)))
}
