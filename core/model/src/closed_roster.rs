//! A roster that no longer changes, with what follows from it.

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::blocked_spots::makes_room;
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
    /// [`Roster::problem`], computed once.
    ///
    /// # Errors
    /// Names the contradiction in the roster.
    /// Enforces T5.
    pub fn problem(&self) -> Result<Option<Arc<PlanningProblem>>, ProblemError> {
        self.problem.get_or_init(|| self.roster.problem()).clone()
    }

    /// The digest of its target.
    pub fn target_digest(&self) -> Digest {
        *self
            .target_digest
            .get_or_init(|| digest::of_target(&self.roster.target))
    }
}

impl Roster {
    /// The planning input of this roster: the part of its target that bodies leave open, its active members, and the retired ones
    /// that make way. A pin outside of that part does not count. `None` when there is nothing to form.
    ///
    /// # Errors
    /// Names the contradiction in the roster.
    /// Enforces S1, S6, B3.
    pub fn problem(&self) -> Result<Option<Arc<PlanningProblem>>, ProblemError> {
        let (Some(whole), Some(target)) = (&self.target.target, self.open_target()) else {
            return Ok(None);
        };
        let is_outside =
            |spot: SpotId| whole.position_of(spot).is_some() && target.position_of(spot).is_none();
        let modules = RosterMember::active(&self.members).map(|member| {
            let mut module = member.module.clone();
            module.pin = module.pin.filter(|&spot| !is_outside(spot));
            module
        });
        let modules = modules.collect();
        let making_room = self.members.iter();
        let making_room = making_room.filter(|member| makes_room(whole, member));
        let making_room = making_room.map(|member| member.module.clone()).collect();
        let problem = PlanningProblem::new(target, self.target.parameters, modules)?
            .with_bodies(standing_bodies(self))
            .with_making_room(making_room);
        problem.check_given()?;
        Ok(Some(Arc::new(problem)))
    }
}
