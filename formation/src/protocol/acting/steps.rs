//! The steps of the acting phase: agreeing, waiting, moving, docking.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::model::{Digest, ModuleId, ModulePhase, Service, digest};

use super::super::io::{Event, Output};
use super::super::mutation::Mutation;
use super::super::{Agent, SettledOn, Stage};
use super::{Place, Task};

impl Agent {
    /// The members that keep the epoch from going on: taken for dead, they are left out of the next one.
    pub(in crate::protocol) fn stuck_modules(&self) -> Vec<ModuleId> {
        let limit = self.parameters.stuck;
        match &self.stage {
            Stage::Planning(turns) => turns.stuck_claimant(self.now, limit).into_iter().collect(),
            Stage::Acting(acting) if acting.agreed_at.is_none() => {
                if acting.mismatch || self.now.saturating_sub(acting.since) <= limit {
                    return Vec::new();
                }
                acting.lagging(&self.peers, self.now, self.parameters.suspicion)
            }
            Stage::Acting(acting) => {
                let (unit, since) = acting.unit_since;
                let limit = self.parameters.motion_limit + limit;
                let overdue = self.now.saturating_sub(since) > limit;
                match acting.plan.assembly.units.get(unit) {
                    Some(unit) if overdue => acting.unsettled_in(unit, &self.peers),
                    _ => Vec::new(),
                }
            }
            _ => Vec::new(),
        }
    }

    /// Follows what another module says of its links: it docked to this one, or let go of it.
    pub(in crate::protocol) fn adjust_links_to(&mut self, other: ModuleId) {
        let (Stage::Acting(acting), Some(state)) = (
            &self.stage,
            self.peers.get(other).and_then(|peer| peer.state.as_deref()),
        ) else {
            return;
        };
        if state.epoch != self.epoch {
            return;
        }
        let names_us = state.links.contains(&self.module);
        let linked = self.body.links.contains(&other);
        let wanted = acting.wants_link_to(other);
        let acts = matches!(state.phase, ModulePhase::Moving | ModulePhase::Settled);
        if acts && linked && !names_us && !wanted {
            self.body.links.remove(&other);
            self.voice.state_changed = true;
        } else if state.phase == ModulePhase::Settled
            && !linked
            && names_us
            && wanted
            && acting.task == Task::Settled
        {
            self.body.links.insert(other);
            self.voice.state_changed = true;
        }
    }

    /// Sends the drive its goal again: it stops when goals cease to repeat.
    pub(in crate::protocol) fn repeat_goal(&mut self) {
        if let Stage::Acting(acting) = &self.stage
            && matches!(acting.task, Task::Moving { held: false, .. })
            && (self.switch.is(Mutation::IgnoreLapse)
                || acting
                    .lagging(&self.peers, self.now, self.parameters.lease)
                    .is_empty())
            && let Some(goal) = acting.goal()
        {
            self.outputs.push_back(Output::Move(goal));
        }
    }

    /// Agrees, waits, moves and docks, as far as is safe now.
    pub(in crate::protocol) fn advance_acting(&mut self) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let lease = self.parameters.lease;
        if let Some((module, theirs)) = acting.dissenter(&self.peers)
            && !acting.mismatch
        {
            acting.mismatch = true;
            self.convening.mismatches += 1;
            let ours = acting.digest;
            self.emit(Event::DigestMismatch {
                module,
                theirs,
                ours,
            });
            return;
        }
        let mut lagging = acting.lagging(&self.peers, self.now, lease);
        if self.switch.is(Mutation::SkipDigestBarrier) {
            lagging.clear();
        }
        if acting.agreed_at.is_none() {
            if !lagging.is_empty() {
                self.tell_split();
                let Stage::Acting(acting) = &mut self.stage else {
                    return;
                };
                if acting.told_waiting != lagging && self.now > acting.since + lease {
                    acting.told_waiting.clone_from(&lagging);
                    self.emit(Event::WaitingForAgreement(lagging));
                }
                return;
            }
            self.note_agreement();
        }
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let Some(agreed_at) = acting.agreed_at else {
            return;
        };
        // Whoever the roster left out stops within the lease, since members no longer show its epoch.
        let wait = if self.switch.is(Mutation::SkipLeaseWait) {
            Duration::ZERO
        } else {
            lease
        };
        let first_motion = agreed_at + wait;
        if self.now < first_motion {
            self.wake_at(first_motion);
            return;
        }
        self.carry_on(&lagging);
    }

    /// Says who holds which plan, when another epoch has not helped and nothing more will be tried.
    fn tell_split(&mut self) {
        let lasts = self.convening.mismatches > 1;
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let told_at = acting.since + self.parameters.lease;
        if !lasts || !acting.mismatch || acting.told_split {
            return;
        }
        if self.now < told_at {
            self.wake_at(told_at);
            return;
        }
        acting.told_split = true;
        let mut sides: BTreeMap<Digest, Vec<ModuleId>> = BTreeMap::new();
        for &module in acting.incarnations.keys() {
            let shown = if module == acting.module {
                Some((Some(acting.epoch), Some(acting.digest)))
            } else {
                let heartbeat = self.peers.get(module).and_then(|peer| peer.heartbeat);
                heartbeat.map(|heartbeat| (heartbeat.epoch, heartbeat.digest))
            };
            if let Some((Some(epoch), Some(digest))) = shown
                && epoch == acting.epoch
            {
                sides.entry(digest).or_default().push(module);
            }
        }
        self.emit(Event::PlansDiffer(sides.into_iter().collect()));
    }

    fn note_agreement(&mut self) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        acting.agreed_at = Some(self.now);
        acting.told_waiting.clear();
        self.peers
            .agreed(self.now, self.parameters.stuck, |module| {
                acting.incarnations.contains_key(&module)
            });
        let epoch = acting.epoch;
        let basis = acting.roster.quorum_basis();
        let spare = acting.task == Task::Spare;
        let open = acting.open_spots();
        self.quorum.note_agreed(epoch, &basis);
        self.convening.relax(self.parameters.epoch_interval);
        self.convening.mismatches = 0;
        self.voice.state_changed = true;
        self.emit(Event::Agreed(epoch));
        if spare {
            self.emit(Event::Spare);
        }
        if epoch.convener == self.module && !open.is_empty() {
            self.emit(Event::SpotsLeftOpen(open));
        }
    }

    /// One step of this module's task; `lagging` members forbid every motion.
    fn carry_on(&mut self, lagging: &[ModuleId]) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let to_act = acting.unit_to_act(&self.peers);
        let index = to_act.as_ref().map_or(usize::MAX, |(index, _)| *index);
        if acting.unit_since.0 != index || !lagging.is_empty() {
            acting.unit_since = (index, self.now);
        }
        let Some(place) = acting.place.clone() else {
            if lagging.is_empty() {
                self.let_go();
            }
            return;
        };
        if self.service != Service::Active {
            return;
        }
        match acting.task.clone() {
            Task::Waiting => {
                if acting.plan.assembly.units[place.unit].pinned {
                    self.stay(lagging);
                    return;
                }
                match to_act {
                    Some((unit, missing))
                        if unit < place.unit && !self.switch.is(Mutation::MoveOutOfOrder) =>
                    {
                        let told = acting.told_waiting == missing;
                        acting.told_waiting.clone_from(&missing);
                        if !told {
                            self.emit(Event::WaitingFor(missing));
                        }
                    }
                    _ if lagging.is_empty() && !self.parameters.plan_only => self.set_off(&place),
                    _ => {}
                }
            }
            Task::Undocking => {
                let done = self
                    .body
                    .links
                    .iter()
                    .all(|&link| acting.keeps_link_to(link));
                if done && lagging.is_empty() {
                    acting.task = Task::Moving {
                        since: self.now,
                        held: false,
                    };
                    if let Some(goal) = acting.goal() {
                        self.body.moving = true;
                        self.outputs.push_back(Output::Move(goal));
                    }
                }
            }
            Task::Moving { since, held } => self.watch_motion(&place, since, held, lagging),
            Task::Docking => self.dock(&place, lagging),
            Task::Spare | Task::Settled | Task::GivenUp => {}
        }
    }

    /// Stays on its spot, and lets go of whatever the target does not want there, such as a dead neighbour.
    fn stay(&mut self, lagging: &[ModuleId]) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let unwanted: Vec<ModuleId> = self
            .body
            .links
            .iter()
            .copied()
            .filter(|&link| !acting.wants_link_to(link))
            .collect();
        if unwanted.is_empty() {
            acting.task = Task::Settled;
            self.voice.state_changed = true;
        } else if lagging.is_empty() {
            for link in unwanted {
                if self.body.ports_busy.insert(link) {
                    self.outputs.push_back(Output::Undock(link));
                }
            }
        }
    }

    fn set_off(&mut self, place: &Place) {
        let own_heartbeat = self.voice.heartbeat_sequence;
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        acting.note_causes(place, &self.peers, own_heartbeat);
        acting.task = Task::Undocking;
        self.body.settled_on = None;
        let broken: Vec<ModuleId> = self
            .body
            .links
            .iter()
            .copied()
            .filter(|&link| !acting.keeps_link_to(link))
            .collect();
        self.voice.state_changed = true;
        self.emit(Event::MotionBegun(place.spot));
        for link in broken {
            self.body.ports_busy.insert(link);
            self.outputs.push_back(Output::Undock(link));
        }
        self.advance_acting();
    }

    fn watch_motion(&mut self, place: &Place, since: Duration, held: bool, lagging: &[ModuleId]) {
        let overdue_at = since + self.parameters.motion_limit;
        if self.now >= overdue_at {
            self.stand_still();
            self.emit(Event::MotionOverdue(place.spot));
            self.fail_motion();
            return;
        }
        self.wake_at(overdue_at);
        let hold = !lagging.is_empty() && !self.switch.is(Mutation::IgnoreLapse);
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let goal = acting.goal();
        acting.task = Task::Moving { since, held: hold };
        if hold && !held {
            self.stand_still();
            self.emit(Event::AgreementLapsed(lagging.to_vec()));
        } else if !hold
            && !self.body.moving
            && let Some(goal) = goal
        {
            // The drive halted, because agreement lapsed or because it was not told for too long.
            self.body.moving = true;
            self.outputs.push_back(Output::Move(goal));
        } else if hold && let Some(oldest) = self.next_lapse() {
            self.wake_at(oldest);
        }
        if !hold && let Some(lapse) = self.next_lapse() {
            self.wake_at(lapse);
        }
    }

    /// When the oldest heartbeat of a member passes the lease, unless a newer one comes.
    fn next_lapse(&self) -> Option<Duration> {
        let Stage::Acting(acting) = &self.stage else {
            return None;
        };
        let margin = Duration::from_millis(1);
        acting
            .incarnations
            .keys()
            .filter_map(|&module| self.peers.get(module)?.age(self.now))
            .map(|age| self.now + self.parameters.lease.saturating_sub(age) + margin)
            .min()
    }

    fn dock(&mut self, place: &Place, lagging: &[ModuleId]) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let wanted = acting.docks_with(place);
        let missing: Vec<ModuleId> = wanted
            .into_iter()
            .filter(|module| !self.body.links.contains(module))
            .collect();
        if missing.is_empty() {
            acting.task = Task::Settled;
            let target = digest::of_target(&acting.roster.target);
            self.body.settled_on = Some(SettledOn {
                spot: place.spot,
                target,
            });
            self.voice.state_changed = true;
            self.emit(Event::Settled(place.spot));
            return;
        }
        if !lagging.is_empty() {
            return;
        }
        let ready: Vec<ModuleId> = missing
            .into_iter()
            .filter(|&module| acting.is_settled(&self.peers, module))
            .filter(|module| !acting.asked_to_dock.contains(module))
            .collect();
        for module in ready {
            acting.asked_to_dock.insert(module);
            self.body.ports_busy.insert(module);
            self.outputs.push_back(Output::Dock(module));
        }
    }
}
