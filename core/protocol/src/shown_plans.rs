//! Who may still move by a plan that runs of a module showed.
//!
//! By A1 a module moves by a plan only while the heartbeats of all its members show it. So whoever knows which plans it showed within the
//! lease, and that all their members have frozen for the next one, knows as well that nobody is in motion by them.

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{ClosedRoster, Digest, ModuleId, RosterMember};

/// A plan whose digest a run of a module has shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShownPlan {
    digest: Digest,
    roster: Arc<ClosedRoster>,
}

impl Hash for ShownPlan {
    /// The digest identifies the roster as well.
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.digest.hash(state);
    }
}

impl ShownPlan {
    pub(super) fn digest(&self) -> Digest {
        self.digest
    }

    /// Whether all who may move by it are among these members: each by the run that it had, or by one that has taken its place.
    pub(super) fn is_within(
        &self,
        members: &[RosterMember],
        has_succeeded: impl Fn(ModuleId) -> bool,
    ) -> bool {
        self.roster.members.iter().all(|former| {
            let module = former.module.id;
            RosterMember::find(members, module).is_some_and(|member| {
                member.incarnation == former.incarnation || has_succeeded(module)
            })
        })
    }
}

/// What a module says when it freezes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Frozen {
    /// Whether no run of it can have shown a plan within the lease.
    pub is_idle: bool,
    /// The only plan that runs of it can have shown within the lease, if they can have shown one.
    pub last_plan: Option<Digest>,
}

/// The plans that runs of a module showed.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct ShownPlans {
    /// Whether this run has shown one.
    pub has_shown: bool,
    /// The last one, if this run or the one before it in this process showed it.
    last: Option<ShownPlan>,
    /// Until then modules may move by another one, whose members are not known any more.
    others_until: Duration,
    /// As it was when the module froze last.
    pub frozen: Frozen,
}

impl ShownPlans {
    /// What the run before in the same process showed, if there was one.
    pub fn after(last: Option<ShownPlan>) -> Self {
        Self {
            last,
            ..Self::default()
        }
    }

    /// Earlier runs are not remembered: what they showed counts until then.
    pub fn forget_until(&mut self, time: Duration) {
        if self.last.is_none() {
            self.others_until = time;
        }
    }

    /// This run shows the digest of a plan; a plan that it showed before can be in motion for this long.
    pub fn note(&mut self, digest: Digest, roster: &Arc<ClosedRoster>, until: Duration) {
        let shown = ShownPlan {
            digest,
            roster: Arc::clone(roster),
        };
        self.has_shown = true;
        let former = self.last.replace(shown);
        if former.is_some_and(|former| !former.is_within(&roster.members, |_| false)) {
            self.others_until = until;
        }
    }

    /// The last plan, if nobody can move by any other one that runs of the module showed.
    pub fn only_plan(&self, now: Duration) -> Option<&ShownPlan> {
        self.last.as_ref().filter(|_| now >= self.others_until)
    }

    /// The plan that the module named when it froze last.
    pub fn frozen_with(&self) -> Option<&ShownPlan> {
        let last = self.last.as_ref();
        last.filter(|last| self.frozen.last_plan == Some(last.digest))
    }

    /// Whether the module can agree that nobody outside these members is in motion by a plan that runs of it showed before it froze. The
    /// convener, which has the states of all, compares runs as well.
    /// Enforces A2.
    pub fn are_over_in(&self, members: &[RosterMember]) -> bool {
        let last = self.frozen_with();
        self.frozen.is_idle || last.is_some_and(|last| last.is_within(members, |_| true))
    }
}
