//! How a run must end, judged from the latest messages of the modules and where their drives stand.
//!
//! Each group of modules that can reach each other is judged on its own. With a quorum, the group must have formed: one
//! epoch, one digest, every module a member or a spare that knows the epoch, and exactly as many spots filled as there are
//! modules, or connected spots that no body blocks; it may wait if bodies block all spots. Without one, every module must report
//! that it waits for a quorum.

use std::collections::{BTreeMap, BTreeSet};

use formation_model::text::joined;
use formation_model::{
    Digest, Epoch, Heartbeat, ModuleId, ModulePhase, ModuleState, Service, SpotId, Target,
};

use super::bodies::room;
use super::{Latest, Monitor, ViolationKind, stands_on};
use crate::campaign::Ending;
use crate::cluster::Cluster;

/// The state of one group.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    /// It holds a formation of this epoch, and all spots are filled that can be.
    Formed(Epoch),
    /// It holds a formation, but not the right number of spots is filled.
    Hole { filled: usize, wanted: usize },
    /// It holds a formation, but these modules on adjacent spots are not docked.
    Undocked(ModuleId, ModuleId),
    /// All of its modules report that they wait for a quorum.
    Waiting,
    /// No module in it could take a spot, or knows a target.
    Idle,
    /// Something else.
    Unfinished,
}

impl Monitor {
    fn latest(&self, cluster: &Cluster, module: ModuleId) -> Option<&Latest> {
        self.latest.get(&cluster.run_of(module)?)
    }

    fn heartbeat(&self, cluster: &Cluster, module: ModuleId) -> Option<&Heartbeat> {
        self.latest(cluster, module)?.heartbeat.as_ref()
    }

    pub(super) fn state(&self, cluster: &Cluster, module: ModuleId) -> Option<&ModuleState> {
        self.latest(cluster, module)?.state.as_deref()
    }

    fn is_active(&self, cluster: &Cluster, module: ModuleId) -> bool {
        self.state(cluster, module)
            .is_some_and(|state| state.service == Service::Active)
    }

    /// The modules that can reach each other. Of those that are cut off from the publisher, one that has not received the target
    /// since it started takes no part in anything, unless a roster brought it.
    fn groups(&self, cluster: &Cluster) -> Vec<BTreeSet<ModuleId>> {
        let takes_part = |&module: &ModuleId| {
            let heartbeat = self.heartbeat(cluster, module);
            let has_roster = heartbeat.is_some_and(|heartbeat| {
                !matches!(
                    heartbeat.phase,
                    ModulePhase::Listening | ModulePhase::Gathered
                )
            });
            has_roster || knows_target(cluster, module)
        };
        let mut groups = cluster.parts();
        for group in &mut groups {
            // One that may be on its way freezes for no epoch, so it fills no spot and counts for no majority.
            group.retain(|&module| !cluster.is_lost(module));
        }
        for cut_off in groups.iter_mut().skip(1) {
            cut_off.retain(takes_part);
        }
        groups.retain(|group| !group.is_empty());
        groups
    }

    fn part(&self, cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> Part {
        let active = modules
            .iter()
            .filter(|&&module| self.is_active(cluster, module))
            .count();
        if active == 0 || !modules.iter().any(|&module| knows_target(cluster, module)) {
            return Part::Idle;
        }
        if modules
            .iter()
            .all(|&module| self.waits(cluster, modules, module))
        {
            return Part::Waiting;
        }
        let Some((epoch, digest)) = self.common_plan(cluster, modules) else {
            // No roster is closed while no spot is free.
            if self.all_is_blocked(cluster, modules) {
                return Part::Idle;
            }
            return Part::Unfinished;
        };
        let Some(known) = self.rosters.get(&epoch) else {
            return Part::Unfinished;
        };
        let parts = cluster.parts();
        let reachable = parts.first().is_some_and(|part| modules.is_subset(part));
        let current = cluster
            .announcement()
            .is_none_or(|announcement| announcement.target == known.roster.target.target);
        if !known.members.is_subset(modules) || (reachable && !current) {
            return Part::Unfinished;
        }
        let Some(target) = &known.roster.target.target else {
            return Part::Unfinished;
        };
        let mut filled: BTreeMap<SpotId, ModuleId> = BTreeMap::new();
        for &module in modules {
            let (Some(state), Some(standing)) =
                (self.state(cluster, module), cluster.standing(module))
            else {
                return Part::Unfinished;
            };
            if state.phase != ModulePhase::Settled
                || (state.epoch, state.digest) != (Some(epoch), Some(digest))
            {
                continue;
            }
            let place = state.spot.and_then(|spot| target.spot(spot));
            if let Some(place) = place.filter(|place| stands_on(&standing.pose, &place.pose)) {
                filled.insert(place.id, module);
            }
        }
        let wanted = room(&known.roster, target, active);
        if filled.len() < wanted {
            return Part::Hole {
                filled: filled.len(),
                wanted,
            };
        }
        match undocked(cluster, target, &filled) {
            Some((one, other)) => Part::Undocked(one, other),
            None => Part::Formed(epoch),
        }
    }

    /// Whether a module waits for a quorum. Modules that halted for an epoch leave it to their convener to report that.
    fn waits(&self, cluster: &Cluster, group: &BTreeSet<ModuleId>, module: ModuleId) -> bool {
        let phase_and_epoch = |module: ModuleId| {
            let heartbeat = self.heartbeat(cluster, module)?;
            Some((heartbeat.phase, heartbeat.epoch))
        };
        match phase_and_epoch(module) {
            Some((ModulePhase::WaitingForQuorum, _)) => true,
            _ if !knows_target(cluster, module) => true,
            Some((ModulePhase::Gathered, Some(epoch))) => {
                let waiting = Some((ModulePhase::WaitingForQuorum, Some(epoch)));
                group.contains(&epoch.convener) && phase_and_epoch(epoch.convener) == waiting
            }
            _ => false,
        }
    }

    /// The epoch and digest that all modules show; late spares show the epoch only.
    fn common_plan(
        &self,
        cluster: &Cluster,
        modules: &BTreeSet<ModuleId>,
    ) -> Option<(Epoch, Digest)> {
        let mut plans = BTreeSet::new();
        for &module in modules {
            let heartbeat = self.heartbeat(cluster, module)?;
            let epoch = heartbeat.epoch?;
            match (heartbeat.phase, heartbeat.digest) {
                (ModulePhase::Settled | ModulePhase::Spare, digest) => {
                    plans.insert((epoch, digest));
                }
                _ => return None,
            }
        }
        let epochs: BTreeSet<Epoch> = plans.iter().map(|&(epoch, _)| epoch).collect();
        let mut digests = plans
            .iter()
            .filter_map(|&(epoch, digest)| Some((epoch, digest?)));
        let plan = digests.next()?;
        (epochs.len() == 1 && digests.next().is_none()).then_some(plan)
    }

    /// Whether a group surely holds a majority: all voters, or more than half of them that know, or half with the lowest. Those whose
    /// votes a roster removes do not count for it.
    fn surely_has_quorum(&self, cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> bool {
        let Some(announcement) = cluster.announcement() else {
            return false;
        };
        let voters = &announcement.voters;
        if voters.is_empty() {
            let expected = announcement.expected_modules;
            return expected.is_none_or(|expected| modules.len() * 2 > expected as usize);
        }
        let present = voters.iter().filter(|voter| modules.contains(voter));
        let present: Vec<ModuleId> = present.copied().collect();
        let knows = |&&voter: &&ModuleId| {
            let run = cluster.run_of(voter);
            let is_knowing = run.is_some_and(|run| self.knowing.contains(&run));
            let counts = is_knowing || self.knowing_stores.contains(&voter);
            counts && !self.votes_removed.contains(&voter)
        };
        let knowing = present.iter().filter(knows);
        let has_lowest = knowing.clone().next() == voters.first();
        let count = knowing.count() * 2;
        let is_majority = count > voters.len() || (count == voters.len() && has_lowest);
        present.len() == voters.len() || is_majority
    }

    /// How the run has ended, if it has.
    pub fn ending(&self, cluster: &Cluster) -> Ending {
        match self.end(cluster) {
            (_, flaws) if !flaws.is_empty() => Ending::Neither,
            (formed, _) if formed.is_empty() => Ending::WaitingForQuorum,
            _ => Ending::Formed,
        }
    }

    /// Records what is wrong with the end of a run.
    pub fn judge_end(&mut self, cluster: &Cluster) {
        for (kind, detail) in self.end(cluster).1 {
            self.violate(cluster.now(), kind, detail);
        }
    }

    /// The epochs of the formations, and what keeps this moment from being an end.
    fn end(&self, cluster: &Cluster) -> (BTreeSet<Epoch>, Vec<(ViolationKind, String)>) {
        let mut formed = BTreeSet::new();
        let mut flaws = Vec::new();
        for modules in &self.groups(cluster) {
            let (kind, detail) = match self.part(cluster, modules) {
                Part::Formed(epoch) => {
                    formed.insert(epoch);
                    continue;
                }
                Part::Waiting if self.surely_has_quorum(cluster, modules) => {
                    let listed = joined(modules.iter().map(|module| module.0), ", ");
                    (ViolationKind::QuorumDenied, format!("modules {listed}"))
                }
                Part::Waiting | Part::Idle => continue,
                Part::Hole { filled, wanted } => {
                    let detail = format!("{filled} of {wanted} spots are filled");
                    (ViolationKind::Hole, detail)
                }
                Part::Undocked(one, other) => {
                    (ViolationKind::NotDocked, format!("{one} to {other}"))
                }
                Part::Unfinished => {
                    let phases = modules
                        .iter()
                        .filter_map(|&module| Some((module, self.heartbeat(cluster, module)?)))
                        .map(|(module, heartbeat)| {
                            let epoch = heartbeat.epoch.map(|epoch| epoch.number);
                            format!("{} {:?} in {epoch:?}", module.0, heartbeat.phase)
                        });
                    (ViolationKind::NoEnd, joined(phases, ", "))
                }
            };
            flaws.push((kind, detail));
        }
        if formed.len() > 1 {
            flaws.push((ViolationKind::TwoFormations, joined(&formed, " and ")));
        }
        (formed, flaws)
    }
}

/// The first module that does not name the link to one on an adjacent spot.
fn undocked(
    cluster: &Cluster,
    target: &Target,
    filled: &BTreeMap<SpotId, ModuleId>,
) -> Option<(ModuleId, ModuleId)> {
    let adjacent = filled.iter().flat_map(|(&spot, &one)| {
        let neighbours = target.neighbours_of(spot);
        neighbours.filter_map(move |spot| Some((one, *filled.get(&spot)?)))
    });
    let names = |one, other| {
        cluster
            .links(one)
            .is_some_and(|links| links.contains(&other))
    };
    adjacent
        .into_iter()
        .find(|&(one, other)| !names(one, other))
}

fn knows_target(cluster: &Cluster, module: ModuleId) -> bool {
    let announcement = cluster.received_announcement(module);
    announcement.is_some_and(|announcement| announcement.target.is_some())
}
