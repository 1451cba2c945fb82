//! How a run must end, judged from what modules published last and where their drives stand.
//!
//! Each group of modules that can hear each other is judged on its own. Where a quorum lives, the group must have formed:
//! one epoch, one digest, everyone a member or a spare that knows of it, and exactly as many spots filled as there are
//! modules or spots. Elsewhere it must say that it waits for a quorum.

use std::collections::{BTreeMap, BTreeSet};

use formation::model::{
    Digest, Epoch, Heartbeat, ModuleId, ModulePhase, ModuleRun, ModuleState, Service, SpotId,
};

use crate::campaign::Ending;
use crate::cluster::Cluster;
use crate::invariants::{LastWord, ViolationKind, Watch};

/// How one group stands.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    /// It holds a formation of this epoch, and all that should be filled is.
    Formed(Epoch),
    /// It holds a formation, but so many of so many spots are filled.
    Hole(usize, usize),
    /// All of them say that they wait for a quorum.
    Waiting,
    /// Nobody in it could take a spot or say more.
    Idle,
    /// Something else.
    Unfinished,
}

impl Watch {
    fn last_word(&self, cluster: &Cluster, module: ModuleId) -> Option<&LastWord> {
        self.last.get(&(module, cluster.incarnation(module)?))
    }

    fn heartbeat(&self, cluster: &Cluster, module: ModuleId) -> Option<&Heartbeat> {
        self.last_word(cluster, module)?.heartbeat.as_ref()
    }

    fn state(&self, cluster: &Cluster, module: ModuleId) -> Option<&ModuleState> {
        self.last_word(cluster, module)?.state.as_deref()
    }

    fn is_active(&self, cluster: &Cluster, module: ModuleId) -> bool {
        self.state(cluster, module)
            .is_some_and(|state| state.service == Service::Active)
    }

    fn part(&self, cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> Part {
        let active = modules
            .iter()
            .filter(|&&module| self.is_active(cluster, module))
            .count();
        let deaf = modules.iter().all(|&module| !cluster.knows_target(module));
        if active == 0 || deaf {
            return Part::Idle;
        }
        let phase_and_epoch = |module: ModuleId| {
            let heartbeat = self.heartbeat(cluster, module)?;
            Some((heartbeat.phase, heartbeat.epoch))
        };
        // Those that halted for an epoch leave it to its convener to say what it waits for.
        let waits = |module: ModuleId| match phase_and_epoch(module) {
            Some((ModulePhase::WaitingForQuorum, _)) => true,
            _ if !cluster.knows_target(module) => true,
            Some((ModulePhase::Gathered, Some(epoch))) => {
                modules.contains(&epoch.convener)
                    && phase_and_epoch(epoch.convener)
                        == Some((ModulePhase::WaitingForQuorum, Some(epoch)))
            }
            _ => false,
        };
        if modules.iter().all(|&module| waits(module)) {
            return Part::Waiting;
        }
        let Some((epoch, digest)) = self.common_plan(cluster, modules) else {
            return Part::Unfinished;
        };
        let Some(known) = self.rosters.get(&epoch) else {
            return Part::Unfinished;
        };
        let reachable = cluster.parts().first() == Some(modules);
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
            if let Some(place) = place.filter(|place| place.pose == standing.pose) {
                filled.insert(place.id, module);
            }
        }
        let wanted = active.min(target.spots().len());
        if filled.len() == wanted {
            Part::Formed(epoch)
        } else {
            Part::Hole(filled.len(), wanted)
        }
    }

    /// The epoch and digest that all show, or know of if they are spares that came too late for it.
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

    /// Whether a group surely holds a majority of every roster that may count: those for which any member ever showed a
    /// digest, from the last one on that some running member of the group saw agreed. Only active members count in a
    /// roster, in the runs that it lists, for later ones have forgotten what they agreed on; and an exact half with the lowest of them. Before any was agreed, more than half of the expected number is needed as well.
    fn surely_has_quorum(&self, cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> bool {
        let agreed = modules
            .iter()
            .filter_map(|&module| self.last_word(cluster, module)?.agreed)
            .max();
        if agreed.is_none() {
            let expected = cluster
                .announcement()
                .and_then(|announcement| announcement.expected_modules);
            if expected.is_some_and(|expected| modules.len() * 2 <= expected as usize) {
                return false;
            }
        }
        let shown: BTreeSet<Epoch> = self.shown.keys().map(|&(epoch, _)| epoch).collect();
        let bases = shown.into_iter().filter(|&epoch| Some(epoch) >= agreed);
        bases
            .filter_map(|epoch| self.rosters.get(&epoch))
            .all(|known| {
                let remembers = |run: &&ModuleRun| {
                    modules.contains(&run.module)
                        && cluster.incarnation(run.module) == Some(run.incarnation)
                };
                let present = known.active.iter().filter(remembers).count() * 2;
                let lowest = known.active.first().filter(remembers).is_some();
                present > known.active.len() || (present == known.active.len() && lowest)
            })
    }

    /// Whether, and how, everything has come to its end.
    pub fn ending(&self, cluster: &Cluster) -> Ending {
        let mut formed = BTreeSet::new();
        for modules in cluster.parts().iter().filter(|part| !part.is_empty()) {
            match self.part(cluster, modules) {
                Part::Formed(epoch) => {
                    formed.insert(epoch);
                }
                Part::Waiting if !self.surely_has_quorum(cluster, modules) => {}
                Part::Idle => {}
                Part::Waiting | Part::Hole(..) | Part::Unfinished => return Ending::Neither,
            }
        }
        match formed.len() {
            0 => Ending::WaitingForQuorum,
            1 => Ending::Formed,
            _ => Ending::Neither,
        }
    }

    /// Notes what is wrong with the end of a run.
    pub fn judge_end(&mut self, cluster: &Cluster) {
        let mut formed = BTreeSet::new();
        for modules in cluster.parts().iter().filter(|part| !part.is_empty()) {
            let (kind, detail) = match self.part(cluster, modules) {
                Part::Formed(epoch) => {
                    formed.insert(epoch);
                    continue;
                }
                Part::Waiting if self.surely_has_quorum(cluster, modules) => {
                    let detail = format!("modules {}", listed(modules));
                    (ViolationKind::QuorumDenied, detail)
                }
                Part::Waiting | Part::Idle => continue,
                Part::Hole(filled, wanted) => {
                    let detail = format!("{filled} of {wanted} spots are filled");
                    (ViolationKind::Hole, detail)
                }
                Part::Unfinished => {
                    let phases: Vec<String> = modules
                        .iter()
                        .filter_map(|&module| Some((module, self.heartbeat(cluster, module)?)))
                        .map(|(module, heartbeat)| {
                            let epoch = heartbeat.epoch.map_or(0, |epoch| epoch.number);
                            format!("{} {:?} in {epoch}", module.0, heartbeat.phase)
                        })
                        .collect();
                    (ViolationKind::NoEnd, phases.join(", "))
                }
            };
            self.violate(cluster.now(), kind, detail);
        }
        if formed.len() > 1 {
            let named: Vec<String> = formed.iter().map(ToString::to_string).collect();
            self.violate(
                cluster.now(),
                ViolationKind::TwoFormations,
                named.join(" and "),
            );
        }
    }
}

fn listed(modules: &BTreeSet<ModuleId>) -> String {
    let ids: Vec<String> = modules.iter().map(|module| module.0.to_string()).collect();
    ids.join(", ")
}
