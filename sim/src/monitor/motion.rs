//! When a module may move: judged from rosters, heartbeats and states, and from where the drives are.

use std::time::Duration;

use formation_model::text::listed_in_full;
use formation_model::{ModuleId, RosterMember};

use super::{Monitor, PlanKey, ViolationKind};
use crate::cluster::Cluster;

/// Clocks drift by millionths, and each module rounds its own times.
const ROUNDING: Duration = Duration::from_millis(5);

impl Monitor {
    /// A voter of the roster that showed another plan before this one, so lately that somebody who is no member may still move by that.
    fn showed_another(&self, plan: PlanKey, at: Duration) -> Option<ModuleId> {
        let roster = &self.rosters.get(&plan.0)?.roster;
        let shown = self.shown.get(&plan)?;
        let is_recent = |module: &ModuleId| {
            let first = shown.get(module);
            let others = self.last_shown.get(module).into_iter().flatten();
            let mut others = others
                .filter(|(other, _)| **other != plan && self.leaves_out_members(plan, **other));
            others.any(|(_, last)| Some(last) < first && at + ROUNDING < *last + self.lease)
        };
        let members = roster.members.iter().map(|member| member.module.id);
        let mut voters = members.filter(|module| roster.voters.named.contains(module));
        voters.find(is_recent)
    }

    /// Whether a roster leaves out a member of that of another plan.
    fn leaves_out_members(&self, plan: PlanKey, other: PlanKey) -> bool {
        let members = |plan: PlanKey| Some(&self.rosters.get(&plan.0)?.roster.members);
        let (Some(members), Some(others)) = (members(plan), members(other)) else {
            return true;
        };
        let mut others = others.iter().map(|member| member.module.id);
        others.any(|other| RosterMember::find(members, other).is_none())
    }

    /// A drive received a goal: its plan is the only one in motion, all members agreed to it long enough ago, and none has
    /// left it for long.
    pub(super) fn check_departure(
        &mut self,
        at: Duration,
        module: ModuleId,
        plan: Option<PlanKey>,
        cluster: &Cluster,
    ) {
        let Some(plan) = plan else {
            let detail = format!("{module} moves without a plan");
            return self.violate(at, ViolationKind::MotionWithoutAgreement, detail);
        };
        // A machine that was suspended does not know it before the heartbeat of another shows it.
        let has_just_woken = cluster.has_just_woken(module);
        for other in cluster.running() {
            let moves_on_another = cluster
                .plan_in_motion(other)
                .is_some_and(|other| other != plan);
            if moves_on_another && !has_just_woken && !cluster.has_just_woken(other) {
                let detail = format!("{module} on {} while {other} moves on another", plan.0);
                self.violate(at, ViolationKind::TwoPlansInMotion, detail);
            }
        }
        let shown = self.shown.get(&plan);
        let Some((roster, shown)) = self.rosters.get(&plan.0).zip(shown) else {
            let detail = format!("{module} on {}, which no module showed", plan.0);
            return self.violate(at, ViolationKind::MotionWithoutAgreement, detail);
        };
        let shows = |member: &&ModuleId| shown.contains_key(member);
        let missing = roster.members.iter().filter(|member| !shows(member));
        let missing: Vec<ModuleId> = missing.copied().collect();
        if !missing.is_empty() {
            let missing = listed_in_full(missing);
            let detail = format!("{module} on {}; {missing} never agreed", plan.0);
            return self.violate(at, ViolationKind::MotionWithoutAgreement, detail);
        }
        let left_for_long = roster.members.iter().copied().find(|member| {
            self.left.get(member).is_some_and(|&(epoch, since)| {
                epoch != Some(plan.0) && at > since + self.lease + self.margin
            })
        });
        if self.begun.insert(plan)
            && let Some(voter) = self.showed_another(plan, at)
        {
            let detail = format!("{module} on {}, and {voter} showed another", plan.0);
            self.violate(at, ViolationKind::MotionBeforeLease, detail);
        }
        if let Some(member) = left_for_long.filter(|_| !has_just_woken) {
            let detail = format!("{module} on {} long after {member} left it", plan.0);
            self.violate(at, ViolationKind::MotionOnStalePlan, detail);
        }
    }
}
