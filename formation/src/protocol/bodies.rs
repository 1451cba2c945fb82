//! What this module knows of the bodies of others, and how that comes into rosters.
//!
//! A module may be anywhere between where it was last seen and where its last plan allowed it to go. Motion needs the
//! heartbeats of all members, so each member knows the plan on which another one may have moved. When it leaves an epoch, it
//! records what it knows of the others: that they stand where they froze, if they cannot have set off, or else that they
//! are on the way. Frozen states list the bodies of absent modules, and the convener unites them in the roster.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    BlockedSpot, BodyReport, Epoch, MODULES_MAX, ModuleId, ModulePhase, ModuleRun, ModuleState,
    Pose, Roster, RosterMember, Service, SpotId, Target, Whereabouts, body,
};

use super::Agent;
use super::context::Context;
use super::event::{EpochReason, Event};
use super::peers::Peers;
use super::refusal::Refusal;
use super::stage::{HeldPlan, Stage};

/// The bodies of other modules.
#[derive(Clone, Debug, Default)]
pub(super) struct Bodies {
    known: BTreeMap<ModuleId, BodyReport>,
    /// Rises whenever something becomes known.
    version: u64,
    /// Rises whenever a removal becomes known.
    removals: u64,
    /// An epoch whose roster opens spots on which this module knows bodies, and the modules of these bodies.
    contested: Option<(Epoch, BTreeSet<ModuleId>)>,
    /// Whether this run of this module was reported as removed.
    own_run_is_removed: bool,
    /// The blocked spots that were last reported.
    reported: Vec<BlockedSpot>,
    /// What was last found by [`Context::compare_bodies`].
    compared: Option<((Epoch, u64), Comparison)>,
}

/// How the bodies that are known now differ from those in a roster.
#[derive(Clone, Debug, Default)]
struct Comparison {
    /// The spots that are blocked now and that the roster leaves open.
    newly_blocked: Vec<BlockedSpot>,
    /// The spots that the roster takes for blocked and that are free now, because a body was removed or because one moved
    /// and more modules can take spots.
    freed: Vec<SpotId>,
}

impl Hash for Bodies {
    /// The comparison follows from the rest, and the version only says whether it is up to date.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            known,
            version: _,
            removals: _,
            contested,
            own_run_is_removed,
            reported,
            compared: _,
        } = self;
        (known, contested, own_run_is_removed, reported).hash(state);
    }
}

impl Bodies {
    /// Rises whenever something becomes known.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Rises whenever a removal becomes known.
    pub fn removals(&self) -> u64 {
        self.removals
    }

    /// Keeps a report, unless a later one is known or there are too many.
    fn note(&mut self, report: BodyReport) {
        let known = self.known.get(&report.module);
        let has_room = known.is_some() || self.known.len() < MODULES_MAX;
        if has_room && known.is_none_or(|known| known.compare_age(&report).is_lt()) {
            self.version += 1;
            self.removals += u64::from(report.whereabouts == Whereabouts::Removed);
            self.known.insert(report.module, report);
        }
    }

    /// Keeps where a module shows itself. In the same epoch, that supersedes no knowledge of its plan.
    pub fn note_state(&mut self, state: &ModuleState) {
        let stays = state.epoch.is_some()
            && matches!(state.phase, ModulePhase::Settled | ModulePhase::Spare);
        self.note(BodyReport {
            module: state.module,
            incarnation: state.incarnation,
            epoch: state.epoch,
            sequence: state.sequence,
            whereabouts: if stays {
                Whereabouts::Halted(state.pose)
            } else {
                Whereabouts::Seen(state.pose)
            },
        });
    }

    /// Whether a run was reported as removed.
    pub fn is_removed(&self, run: ModuleRun) -> bool {
        self.known.get(&run.module).is_some_and(|known| {
            known.whereabouts == Whereabouts::Removed && known.incarnation >= run.incarnation
        })
    }

    /// The reports on modules for which `is_wanted` holds, ascending by module.
    fn reports(&self, is_wanted: impl Fn(ModuleId) -> bool) -> Vec<BodyReport> {
        let known = self.known.values();
        let wanted = known.filter(|report| is_wanted(report.module));
        wanted.cloned().collect()
    }

    /// The reports on modules that are not among these members (ascending).
    fn outside(&self, members: &[RosterMember]) -> Vec<BodyReport> {
        self.reports(|module| !body::lists(members, module))
    }

    /// The modules whose bodies a roster of this epoch does not take into account.
    pub fn contested_in(&self, epoch: Epoch) -> Option<EpochReason> {
        let (contested, modules) = self.contested.as_ref()?;
        (*contested == epoch)
            .then(|| EpochReason::BodiesUnlisted(modules.iter().copied().collect()))
    }
}

impl Context {
    /// Records the latest states of all other modules.
    fn note_bodies(&mut self) {
        let Self { bodies, peers, .. } = self;
        for state in peers.states() {
            bodies.note_state(state);
        }
    }

    /// Takes over what another module reports; what it reports of this module is ignored, unless it is a removal.
    fn learn_body(&mut self, report: &BodyReport) {
        if report.module == self.module() {
            let is_own = report.incarnation >= self.own.run.incarnation;
            if is_own && report.whereabouts == Whereabouts::Removed {
                self.note_own_removal();
            }
            return;
        }
        if report.incarnation.0 > self.latest_stamp() {
            return;
        }
        self.bodies.note(report.clone());
        self.exclude_if_removed(report.module);
    }

    /// Considers a module failed whose present run was reported as removed.
    pub fn exclude_if_removed(&mut self, module: ModuleId) {
        if self.bodies.removals() == 0 {
            return;
        }
        let Some(peer) = self.peers.get(module) else {
            return;
        };
        let run = module.run(peer.incarnation);
        if self.bodies.is_removed(run) {
            self.peers.exclude(module, Duration::MAX);
        }
    }

    fn note_own_removal(&mut self) {
        if !std::mem::replace(&mut self.bodies.own_run_is_removed, true) {
            self.emit(Event::RunRemoved);
        }
    }

    /// Whether this run was reported as removed: it takes no part until its process restarts.
    pub fn is_removed(&self) -> bool {
        self.bodies.own_run_is_removed
    }

    /// What a frozen state lists: the bodies and removals of absent modules, of those that a roster left out, and of those
    /// that were reported to block spots.
    pub fn absent_bodies(&mut self) -> Vec<BodyReport> {
        self.note_bodies();
        let liveness = self.liveness();
        let contested = self.bodies.contested.as_ref();
        let blocking = &self.bodies.reported;
        self.bodies.reports(|module| {
            !self.peers.is_live(liveness, module)
                || contested.is_some_and(|(_, modules)| modules.contains(&module))
                || blocking.iter().any(|blocked| blocked.module == module)
        })
    }

    /// Adds what frozen members report of modules that are not frozen themselves.
    pub fn learn_bodies(&mut self, frozen: &[Arc<ModuleState>]) {
        self.note_bodies();
        let modules: BTreeSet<ModuleId> = frozen.iter().map(|state| state.module).collect();
        for report in frozen.iter().flat_map(|state| &state.bodies) {
            if !modules.contains(&report.module) {
                self.learn_body(report);
            }
        }
    }

    /// The reports on modules that are not among these members (ascending), for their roster.
    pub fn bodies_outside(&self, members: &[RosterMember]) -> Vec<BodyReport> {
        if self.bugs.ignore_bodies() {
            return Vec::new();
        }
        self.bodies.outside(members)
    }

    /// Reports which spots are blocked, unless that was reported last; returns whether it was not.
    pub fn report_blocked(&mut self, blocked: Vec<BlockedSpot>) -> bool {
        let is_new = self.bodies.reported != blocked;
        if is_new {
            self.bodies.reported.clone_from(&blocked);
            if !blocked.is_empty() {
                self.emit(Event::SpotsBlocked(blocked));
            }
        }
        is_new
    }

    /// Takes over the bodies in a roster.
    pub fn learn_roster_bodies(&mut self, roster: &Roster) {
        self.note_bodies();
        for report in &roster.bodies {
            if !body::lists(&roster.members, report.module) {
                self.learn_body(report);
            }
        }
    }

    /// Takes over the bodies in a roster, and refuses it if it opens a spot on which this module knows a body.
    pub fn check_bodies(&mut self, roster: &Roster) -> Result<(), Refusal> {
        self.learn_roster_bodies(roster);
        let Some(target) = &roster.target.target else {
            return Ok(());
        };
        let unlisted = self.newly_blocked(roster, target);
        if unlisted.is_empty() || self.bugs.ignore_bodies() {
            self.bodies.contested = None;
            return Ok(());
        }
        let modules = unlisted.iter().map(|blocked| blocked.module).collect();
        self.bodies.contested = Some((roster.epoch, modules));
        Err(Refusal::UnlistedBody)
    }

    /// The spots that a roster leaves open although a body is known to cover them.
    fn newly_blocked(&self, roster: &Roster, target: &Target) -> Vec<BlockedSpot> {
        let known = self.bodies.outside(&roster.members);
        let now = body::blocked_spots(target, &roster.members, &known);
        except(&now, &roster.blocked_spots()).collect()
    }

    /// How the bodies that are known now differ from those in a roster; found again only when something became known.
    fn compare_bodies(&mut self, roster: &Roster) -> Comparison {
        let key = (roster.epoch, self.bodies.version);
        if let Some((known, comparison)) = &self.bodies.compared
            && *known == key
        {
            return comparison.clone();
        }
        let comparison = self.comparison(roster);
        self.bodies.compared = Some((key, comparison.clone()));
        comparison
    }

    fn comparison(&self, roster: &Roster) -> Comparison {
        let Some(target) = &roster.target.target else {
            return Comparison::default();
        };
        let listed = roster.blocked_spots();
        let known = self.bodies.outside(&roster.members);
        let now = body::blocked_spots(target, &roster.members, &known);
        let room = |blocked: &[BlockedSpot]| {
            let part = body::open_part(target, &roster.members, blocked);
            let spots = part.map_or(0, |part| part.spots().len());
            spots.min(active(roster).count())
        };
        let gains = room(&now) > room(&listed);
        let was_removed = |module: ModuleId| {
            let known = self.bodies.known.get(&module);
            known.is_some_and(|known| known.whereabouts == Whereabouts::Removed)
        };
        let freed = except(&listed, &now).filter(|spot| gains || was_removed(spot.module));
        Comparison {
            newly_blocked: except(&now, &listed).collect(),
            freed: freed.map(|blocked| blocked.spot).collect(),
        }
    }

    /// Whether bodies that became known, or were removed, call for another plan.
    pub fn doubt_bodies(
        &mut self,
        roster: &Roster,
        held: Option<&HeldPlan>,
    ) -> Option<EpochReason> {
        if self.bugs.ignore_bodies() {
            return None;
        }
        let comparison = self.compare_bodies(roster);
        if !comparison.freed.is_empty() {
            return Some(EpochReason::SpotsFreed(comparison.freed));
        }
        let mut blocked = comparison.newly_blocked;
        blocked.retain(|blocked| held.is_some_and(|held| held.is_to_fill(blocked.spot, self)));
        (!blocked.is_empty()).then_some(EpochReason::SpotsBlocked(blocked))
    }

    /// Whether these modules, which no roster lists, could fill more spots than its own members, now that they can move.
    pub fn could_fill_more(&self, roster: &Roster, newcomers: &[ModuleId]) -> bool {
        let Some(target) = &roster.target.target else {
            return false;
        };
        if newcomers.is_empty() {
            return false;
        }
        let members = active(roster).count();
        let part = roster.open_target();
        let filled = part.map_or(0, |part| part.spots().len().min(members));
        if filled >= target.spots().len() {
            return false;
        }
        let mut known = self.bodies.outside(&roster.members);
        known.retain(|body| !newcomers.contains(&body.module));
        let blocked = body::blocked_spots(target, &roster.members, &known);
        let open = body::open_part(target, &roster.members, &blocked);
        let open = open.map_or(0, |part| part.spots().len());
        open.min(members + newcomers.len()) > filled
    }
}

/// The entries of a list whose spots are not in another; both ascend by spot.
fn except<'a>(
    some: &'a [BlockedSpot],
    others: &'a [BlockedSpot],
) -> impl Iterator<Item = BlockedSpot> + 'a {
    some.iter().copied().filter(|blocked| {
        let find = others.binary_search_by_key(&blocked.spot, |other| other.spot);
        find.is_err()
    })
}

fn active(roster: &Roster) -> impl Iterator<Item = &RosterMember> {
    let members = roster.members.iter();
    members.filter(|member| member.service == Service::Active)
}

impl Agent {
    /// Records, before an epoch is left, where its other members stand or may be on their way.
    pub(super) fn remember_members(&mut self) {
        for report in self.member_reports(self.stage.has_acted()) {
            self.context.bodies.note(report);
        }
    }

    /// Where the other members of the present roster stand or may be on their way, now that this module has `acted` or not.
    fn member_reports(&self, has_acted: bool) -> Vec<BodyReport> {
        let mut reports = Vec::new();
        let Some(roster) = self.stage.roster() else {
            return reports;
        };
        let is_outside = matches!(self.stage, Stage::Outsider(_));
        let held = self.stage.held_plan();
        let own = self.context.module();
        let places = held.map(HeldPlan::places).unwrap_or_default();
        for member in &roster.members {
            let module = member.module.id;
            if module == own {
                continue;
            }
            let (pose, sequence) = seen_in(roster, member, &self.context.peers);
            let whereabouts = match held {
                _ if is_outside => Whereabouts::Seen(pose),
                Some(held) => {
                    let place = places.get(&module).copied();
                    held.whereabouts((module, place), pose, has_acted, &self.context.peers)
                }
                None => Whereabouts::Halted(pose),
            };
            reports.push(BodyReport {
                module,
                incarnation: member.incarnation,
                epoch: Some(roster.epoch),
                sequence,
                whereabouts,
            });
        }
        reports
    }

    /// What the store holds of the bodies of others: where each may be until the next write, which comes before this module
    /// acts on another plan. A member may act meanwhile, so each may be on its way to the goal that the plan gives it.
    pub(super) fn bodies_to_store(&self) -> Vec<BodyReport> {
        let mut bodies = self.context.bodies.clone();
        for state in self.context.peers.states() {
            bodies.note_state(state);
        }
        for report in self.member_reports(true) {
            bodies.note(report);
        }
        bodies.reports(|_| true)
    }

    /// Takes over the bodies that the store of this module holds.
    pub(super) fn restore_bodies(&mut self, stored: &[BodyReport]) {
        if self.context.bugs.forget_stored_bodies() {
            return;
        }
        for report in stored {
            self.context.bodies.note(report.clone());
        }
    }

    /// Records where a module shows itself that is no member of the present roster. Members are recorded when their epoch is
    /// left.
    pub(super) fn note_body(&mut self, module: ModuleId) {
        let roster = self.stage.roster();
        let is_member = roster.is_some_and(|roster| body::lists(&roster.members, module));
        let Context { bodies, peers, .. } = &mut self.context;
        if let Some(state) = peers.state(module).filter(|_| !is_member) {
            bodies.note_state(state);
        }
    }

    /// Records where a module of another session shows itself. Its epochs are not those of this session.
    pub(super) fn handle_other_session_state(&mut self, state: &ModuleState) {
        let report = BodyReport {
            module: state.module,
            incarnation: state.incarnation,
            epoch: None,
            sequence: state.sequence,
            whereabouts: Whereabouts::Seen(state.pose),
        };
        self.context.learn_body(&report);
    }

    /// The body of a module was taken away: by that report, it stands nowhere any more.
    pub(super) fn handle_removal(&mut self, run: ModuleRun) {
        let before = self.context.bodies.removals();
        self.context.learn_body(&BodyReport {
            module: run.module,
            incarnation: run.incarnation,
            epoch: None,
            sequence: 0,
            whereabouts: Whereabouts::Removed,
        });
        // Reports repeat, for modules that are discovered late.
        if self.context.bodies.removals() > before {
            self.context.emit(Event::BodyRemoved(run.module));
        }
    }

    /// The latest run of another module from which this one received a message, or whose body it knows.
    #[must_use]
    pub fn latest_run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        let context = &self.context;
        let peer = context.peers.get(module).map(|peer| peer.incarnation);
        let body = context.bodies.known.get(&module);
        let incarnation = peer.max(body.map(|body| body.incarnation))?;
        Some(module.run(incarnation))
    }
}

/// Where a member was last seen in the epoch of a roster, and the sequence number of the state that showed it.
fn seen_in(roster: &Roster, member: &RosterMember, peers: &Peers) -> (Pose, u64) {
    let state = peers.state(member.module.id).filter(|state| {
        state.incarnation == member.incarnation && state.epoch == Some(roster.epoch)
    });
    state.map_or((member.module.pose, 0), |state| {
        (state.pose, state.sequence)
    })
}
