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

use formation_model::{
    BlockedSpot, BodyReport, Epoch, Incarnation, MODULES_MAX, ModuleId, ModulePhase, ModuleRun,
    ModuleState, Removal, Roster, RosterMember, Service, SpotId, Target, Whereabouts,
    blocked_spots, body,
};

use super::removals;
use crate::context::Context;
use crate::event::{EpochReason, Event};
use crate::refusal::Refusal;

/// The most bodies of other sessions that are kept, so that they take no room from those of this one.
const OTHER_SESSIONS_MAX: usize = 1_024;

/// The bodies of other modules.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bodies {
    pub(crate) known: BTreeMap<ModuleId, BodyReport>,
    /// The modules in `known` whose bodies belong to other sessions.
    of_other_sessions: BTreeSet<ModuleId>,
    /// Rises whenever something becomes known.
    pub(crate) version: u64,
    /// Rises whenever a removal that took effect is over.
    removals: u64,
    /// An epoch whose roster opens spots on which this module knows bodies, and the modules of these bodies.
    contested: Option<(Epoch, BTreeSet<ModuleId>)>,
    /// The modules whose runs send under earlier numbers than former ones had, with the number of the former.
    pub(crate) outdated: BTreeMap<ModuleId, Incarnation>,
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
    /// The spots that the roster takes for blocked and that are free now, or once a roster lists the removals that are due, if more
    /// modules can take spots then.
    freed: Vec<BlockedSpot>,
    /// Bodies that may stand where the roster does not say.
    displaced: Vec<BodyReport>,
}

impl Hash for Bodies {
    /// The comparison follows from the rest, and the version only says whether it is up to date.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            known,
            of_other_sessions,
            version: _,
            removals: _,
            contested,
            outdated,
            reported,
            compared: _,
        } = self;
        (known, of_other_sessions, contested, outdated, reported).hash(state);
    }
}

impl Bodies {
    /// Rises whenever something becomes known.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Rises whenever a removal that took effect is over.
    pub fn removals(&self) -> u64 {
        self.removals
    }

    /// What follows from the bodies is to be found again.
    pub fn mark_changed(&mut self) {
        self.version += 1;
    }

    /// The removal of a module's body is over.
    pub fn forget_removal(&mut self, module: ModuleId) {
        self.version += 1;
        self.removals += 1;
        self.known.remove(&module);
    }

    /// Keeps a report, unless a later one is known or there are too many.
    ///
    /// Reports on modules of other sessions name no epoch, even where a roster passes them on. One that names an epoch takes the
    /// place of a report on a module of another session that has the same number.
    /// Enforces B1.
    pub fn note(&mut self, report: BodyReport) {
        let is_of_this_session = report.epoch.is_some();
        let is_of_other_session = self.of_other_sessions.contains(&report.module);
        let is_new = match self.get(report.module) {
            Some(known) => {
                (is_of_other_session && is_of_this_session) || known.compare_age(&report).is_lt()
            }
            None => self.known.len() - self.of_other_sessions.len() < MODULES_MAX,
        };
        if is_new {
            if is_of_this_session {
                self.of_other_sessions.remove(&report.module);
            }
            self.insert(report);
        }
    }

    /// Keeps a report on a module of another session. It never takes the place of one on a module of this session, which may
    /// have the same number; then the result is `false`.
    /// Enforces B6.
    pub fn note_of_other_session(&mut self, report: BodyReport) -> bool {
        debug_assert_eq!(
            report.epoch, None,
            "its epochs are not those of this session"
        );
        let is_new = match self.get(report.module) {
            Some(known) if known.epoch.is_some() => return false,
            Some(known) => known.compare_age(&report).is_lt(),
            None => self.of_other_sessions.len() < OTHER_SESSIONS_MAX,
        };
        if is_new {
            self.of_other_sessions.insert(report.module);
            self.insert(report);
        }
        true
    }

    fn insert(&mut self, report: BodyReport) {
        self.version += 1;
        self.known.insert(report.module, report);
    }

    /// Keeps where a module shows itself. In the same epoch, that supersedes no knowledge of its plan.
    pub fn note_state(&mut self, state: &ModuleState) {
        self.note(report_of(state));
    }

    /// Keeps reports that ascend by module as [`Self::note`] does: one walk along all bodies in place of a search for each.
    pub fn note_ascending(&mut self, reports: impl Iterator<Item = BodyReport>) {
        let mut unknown = Vec::new();
        let mut known = self.known.iter_mut().peekable();
        for report in reports {
            let is_before = |&(&module, _): &(&ModuleId, _)| module < report.module;
            while known.next_if(is_before).is_some() {}
            let is_of_it = |&(&module, _): &(&ModuleId, _)| module == report.module;
            let Some((_, known)) = known
                .next_if(is_of_it)
                .filter(|_| !self.of_other_sessions.contains(&report.module))
            else {
                unknown.push(report);
                continue;
            };
            if known.compare_age(&report).is_lt() {
                self.version += 1;
                *known = report;
            }
        }
        for report in unknown {
            self.note(report);
        }
    }

    /// Keeps where modules show themselves, in ascending order.
    pub fn note_states<'a>(&mut self, states: impl Iterator<Item = &'a Arc<ModuleState>>) {
        self.note_ascending(states.map(|state| report_of(state)));
    }

    /// The run of a module whose body was removed, with those of all earlier ones.
    pub fn removed_run(&self, module: ModuleId) -> Option<ModuleRun> {
        let known = self.get(module)?;
        (known.whereabouts == Whereabouts::Removed).then(|| known.run())
    }

    /// The latest report on each module, ascending by module.
    fn known(&self) -> impl Iterator<Item = (ModuleId, &BodyReport)> {
        self.known.iter().map(|(&module, report)| (module, report))
    }

    /// The latest report on each module, ascending by module.
    pub fn into_reports(self) -> impl Iterator<Item = BodyReport> {
        self.known.into_values()
    }

    /// The latest reports on modules of this session, ascending by module.
    pub fn of_this_session(&self) -> impl Iterator<Item = &BodyReport> {
        let known = self.known.values();
        known.filter(|report| !self.of_other_sessions.contains(&report.module))
    }

    /// What is known of a module's body.
    pub fn get(&self, module: ModuleId) -> Option<&BodyReport> {
        self.known.get(&module)
    }

    /// The reports on modules for which `is_wanted` holds; both the questions and the reports ascend by module.
    pub fn reports(&self, mut is_wanted: impl FnMut(ModuleId) -> bool) -> Vec<BodyReport> {
        let known = self.known.values();
        let wanted = known.filter(|report| is_wanted(report.module));
        wanted.cloned().collect()
    }

    /// The reports on modules that are not among these members (ascending).
    pub fn outside(&self, members: &[RosterMember]) -> Vec<BodyReport> {
        let mut members = members.iter().map(|member| member.module.id).peekable();
        self.reports(|module| {
            while members.next_if(|&id| id < module).is_some() {}
            members.peek() != Some(&module)
        })
    }

    /// The modules whose bodies a roster of this epoch does not take into account.
    pub fn contested_in(&self, epoch: Epoch) -> Option<EpochReason> {
        let (contested, modules) = self.contested.as_ref()?;
        (*contested == epoch)
            .then(|| EpochReason::BodiesUnlisted(modules.iter().copied().collect()))
    }
}

/// What a state shows of its module's body.
fn report_of(state: &ModuleState) -> BodyReport {
    let stays =
        state.epoch.is_some() && matches!(state.phase, ModulePhase::Settled | ModulePhase::Spare);
    BodyReport {
        module: state.module,
        incarnation: state.incarnation,
        epoch: state.epoch,
        sequence: state.sequence,
        whereabouts: if stays {
            Whereabouts::Halted(state.pose)
        } else {
            Whereabouts::Seen(state.pose)
        },
    }
}

impl Context {
    /// Records the latest states of all other modules.
    fn note_bodies(&mut self) {
        let Self { bodies, peers, .. } = self;
        bodies.note_states(peers.states());
    }

    /// Takes over what another module reports; what it reports of this module is ignored.
    fn learn_body(&mut self, report: &BodyReport) {
        debug_assert_ne!(
            report.whereabouts,
            Whereabouts::Removed,
            "that is a proposal"
        );
        if report.module == self.module() || !self.is_plausible(report.incarnation.0) {
            return;
        }
        // What others report of a later run than the one that sends to this module is about one that has fallen silent.
        let liveness = self.liveness();
        let followed = self.peers.get(report.module);
        let followed = followed.filter(|peer| liveness.includes(peer));
        if followed.is_some_and(|peer| peer.incarnation < report.incarnation) {
            return;
        }
        self.bodies.note(report.clone());
    }

    /// What a frozen state lists: the bodies and removals of absent modules, of those that a roster left out, of those that
    /// were reported to block spots, of those whose run has an earlier number than a former one, and of those that were reported as
    /// removed and live.
    pub fn absent_bodies(&mut self) -> Vec<BodyReport> {
        self.note_bodies();
        let liveness = self.liveness();
        let contested = self.bodies.contested.as_ref();
        let blocking = &self.bodies.reported;
        let bodies = self.peers.along(self.bodies.known());
        let listed = bodies.filter(|&(module, report, peer)| {
            !peer.is_some_and(|peer| liveness.includes(peer))
                || contested.is_some_and(|(_, modules)| modules.contains(&module))
                || blocking.iter().any(|blocked| blocked.module == module)
                || self.bodies.outdated.contains_key(&module)
                || self.removals.is_refuted(report.run())
                || self.is_missed(module)
        });
        listed
            .map(|(_, report, _)| self.bodies.under_former_number(report))
            .collect()
    }

    /// The module finds no path: it takes no spot until one of the absent bodies is gone that are known now.
    /// Enforces X13.
    pub fn cannot_move_past_bodies(&mut self, reason: Event) {
        let was_retired = self.robot.service == Service::Retired;
        self.cannot_move(reason);
        // One that was retired stays out of service.
        let mut absent = self.absent_bodies();
        absent.retain(|body| {
            let is_live = self.peers.is_live(self.liveness(), body.module);
            let stands =
                body.whereabouts != Whereabouts::Removed && !self.is_removable(body.module);
            !is_live && stands && !self.bodies.of_other_sessions.contains(&body.module)
        });
        self.robot.kept_by = (!was_retired).then_some(absent);
    }

    /// Takes spots again if one of the bodies is gone, or stands elsewhere, past which this module found no path.
    /// Enforces X13.
    pub fn move_again(&mut self) {
        let Some(kept_by) = &self.robot.kept_by else {
            return;
        };
        let known = |body: &BodyReport| {
            let is_live = self.peers.is_live(self.liveness(), body.module);
            let known = self.bodies.get(body.module);
            let limit = self.spot_limit();
            let stands =
                known.is_some_and(|known| known.whereabouts.is_near(&body.whereabouts, limit));
            !is_live && stands && !self.is_removable(body.module)
        };
        if self.robot.service != Service::MotionFailed || kept_by.iter().all(known) {
            return;
        }
        self.robot.kept_by = None;
        self.robot.service = Service::Active;
        self.mark_state_changed();
        self.emit(Event::MayMoveAgain);
    }

    /// Adds what frozen members report of modules that are not frozen themselves; this one has been frozen since `frozen_at`.
    pub fn learn_bodies(&mut self, frozen: &[Arc<ModuleState>], frozen_at: Duration) {
        self.note_bodies();
        self.learn_refutations(frozen, frozen_at);
        let modules: BTreeSet<ModuleId> = frozen.iter().map(|state| state.module).collect();
        for report in frozen.iter().flat_map(|state| &state.bodies) {
            let stands = report.whereabouts != Whereabouts::Removed;
            if stands && !modules.contains(&report.module) {
                self.learn_body(report);
            }
        }
        self.learn_proposals(frozen);
        self.learn_later_removals(frozen);
    }

    /// The reports on modules that are not among these members (ascending), for their roster of this epoch.
    pub fn bodies_outside(&self, members: &[RosterMember], epoch: Epoch) -> Vec<BodyReport> {
        let bodies = self.bodies.outside(members).into_iter();
        bodies
            .map(|report| self.listed_in_roster(report, epoch))
            .collect()
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

    /// Takes over the bodies in a roster. The removals in it are proposals until the members agree.
    pub fn learn_roster_bodies(&mut self, roster: &Roster) {
        self.note_bodies();
        for report in &roster.bodies {
            if blocked_spots::lists(&roster.members, report.module) {
                continue;
            }
            if report.whereabouts != Whereabouts::Removed {
                self.learn_body(report);
            } else if report.run() == self.own.run {
                self.emit(Event::RunRemoved(roster.epoch));
            } else {
                self.learn_removal(Removal::of_body(report.run()));
            }
        }
    }

    /// Takes over the bodies in a roster, and refuses it if it opens a spot on which this module knows a body, or if paths may lead
    /// through one.
    /// Enforces B3.
    pub fn check_bodies(&mut self, roster: &Roster) -> Result<(), Refusal> {
        self.learn_roster_bodies(roster);
        let Comparison {
            newly_blocked,
            displaced,
            ..
        } = self.comparison(roster);
        let blocking = newly_blocked.iter().map(|blocked| blocked.module);
        let displaced = displaced.iter().map(|body| body.module);
        let modules: BTreeSet<ModuleId> = blocking.chain(displaced).collect();
        if modules.is_empty() {
            self.bodies.contested = None;
            return Ok(());
        }
        self.bodies.contested = Some((roster.epoch, modules));
        Err(Refusal::UnlistedBody)
    }

    /// Those of the known bodies that may stand where a roster does not say, and so in the way of its paths. Modules of another
    /// session may move at any time, whatever a roster says.
    fn displaced(&self, roster: &Roster, known: &[BodyReport]) -> Vec<BodyReport> {
        let others = &self.bodies.of_other_sessions;
        let known = known.iter().filter(|body| !others.contains(&body.module));
        let displaced = known.filter(|body| !body::account_for(&roster.bodies, body));
        displaced.cloned().collect()
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

    /// Whether a module's body was removed, or a roster may say so.
    pub fn is_removable(&self, module: ModuleId) -> bool {
        let known = self.bodies.get(module);
        known.is_some_and(|known| {
            known.whereabouts == Whereabouts::Removed || self.removals.is_due(known.run())
        })
    }

    fn comparison(&self, roster: &Roster) -> Comparison {
        let Some(target) = &roster.target.target else {
            return Comparison::default();
        };
        let listed = roster.blocked_spots();
        let mut known = self.bodies.outside(&roster.members);
        // What the roster lists as removed stands nowhere, unless this module has heard it since.
        known.retain(|body| {
            self.removals.is_refuted(body.run()) || !removals::lists(roster, body.run())
        });
        let now = roster.blocked_by(&known);
        let mut left = known.clone();
        left.retain(|body| !self.removals.is_due(body.run()));
        let soon = roster.blocked_by(&left);
        let room = |bodies: &[BodyReport]| roster.open_part_by(bodies).map_or(0, |part| part.room);
        let gains = || room(&left) > room(&roster.bodies);
        let mut freed: Vec<BlockedSpot> = except(&listed, &soon).collect();
        if !freed.is_empty() && !gains() {
            freed.clear();
        }
        freed.extend(self.covered_by_due(&known, target, &[&listed, &now]));
        Comparison {
            newly_blocked: except(&now, &listed).collect(),
            freed,
            displaced: self.displaced(roster, &known),
        }
    }

    /// The spots that members hold although a body stands there whose removal is due: until a roster lists that, two robots seem to
    /// stand on one spot. `blocked` are the spots that nobody holds.
    fn covered_by_due(
        &self,
        known: &[BodyReport],
        target: &Target,
        blocked: &[&[BlockedSpot]],
    ) -> Vec<BlockedSpot> {
        let is_held = |spot: SpotId| !blocked.iter().copied().flatten().any(|it| it.spot == spot);
        let due = known.iter().filter(|body| self.removals.is_due(body.run()));
        due.flat_map(|body| {
            let spots = target.spots().iter();
            let covered = spots.filter(|spot| body.covers(&spot.pose) && is_held(spot.id));
            covered.map(|spot| BlockedSpot {
                spot: spot.id,
                module: body.module,
            })
        })
        .collect()
    }

    /// Whether bodies that became known, or were removed, call for another plan, when some spots are yet to be filled and some paths
    /// lie ahead.
    /// Enforces B4.
    pub fn doubt_bodies(
        &mut self,
        roster: &Roster,
        is_to_fill: impl Fn(SpotId, &Self) -> bool,
        is_in_the_way: impl Fn(&BodyReport, &Self) -> bool,
    ) -> Option<EpochReason> {
        let comparison = self.compare_bodies(roster);
        // A body that moved is that of a live module, which a roster may have left out for those that it does not receive.
        let mut freed = comparison.freed;
        freed.retain(|freed| self.is_removable(freed.module) || self.is_wanted(freed.module));
        let freed: Vec<SpotId> = freed.iter().map(|freed| freed.spot).collect();
        if !freed.is_empty() {
            return Some(EpochReason::SpotsFreed(freed));
        }
        let mut blocked = comparison.newly_blocked;
        blocked.retain(|blocked| is_to_fill(blocked.spot, self));
        if !blocked.is_empty() {
            return Some(EpochReason::SpotsBlocked(blocked));
        }
        let displaced = comparison.displaced.iter();
        let in_the_way = displaced.filter(|body| is_in_the_way(body, self));
        let in_the_way: Vec<ModuleId> = in_the_way.map(|body| body.module).collect();
        (!in_the_way.is_empty()).then_some(EpochReason::BodiesUnlisted(in_the_way))
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

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::Pose;

    fn seen(incarnation: u64, epoch: Option<u64>, x: f64) -> BodyReport {
        BodyReport {
            module: ModuleId(4),
            incarnation: Incarnation(incarnation),
            epoch: epoch.map(|number| Epoch {
                number,
                convener: ModuleId(1),
            }),
            sequence: 1,
            whereabouts: Whereabouts::Seen(Pose::from_units(x, 0.0, 0.0).unwrap()),
        }
    }

    #[test]
    fn a_report_of_this_session_replaces_one_of_another_and_never_the_reverse() {
        let mut bodies = Bodies::default();
        assert!(bodies.note_of_other_session(seen(9, None, 1.0)));
        // A roster passes on what another member knew of its earlier run.
        bodies.note(seen(8, None, 2.0));
        assert_eq!(bodies.get(ModuleId(4)), Some(&seen(9, None, 1.0)));
        assert!(
            bodies.note_of_other_session(seen(10, None, 3.0)),
            "it has restarted"
        );
        assert_eq!(bodies.get(ModuleId(4)), Some(&seen(10, None, 3.0)));
        // A member has the same number, and started before.
        bodies.note_ascending([seen(5, Some(1), 4.0)].into_iter());
        assert!(!bodies.note_of_other_session(seen(11, None, 5.0)));
        assert_eq!(bodies.get(ModuleId(4)), Some(&seen(5, Some(1), 4.0)));
    }
}
