//! Reports that bodies were taken away, and what becomes of them.
//!
//! A report is a proposal: it changes nothing about the module that it names. It names a run, and is dropped at the first heartbeat of
//! that run that was sent after it. A proposal whose run this module has not heard for `suspicion` is *due*: frozen states carry it,
//! and the convener lists it in the roster unless another frozen member has heard the run since. A member that hears the run, or has
//! itself listened for less than `suspicion`, refuses the roster. The removal takes effect when all members agree on the roster.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    BodyReport, Epoch, Incarnation, ModuleId, ModuleRun, ModuleState, Removal, Roster, Whereabouts,
    blocked_spots,
};

use crate::context::Context;
use crate::event::{EpochReason, Event};
use crate::refusal::Refusal;

/// A proposal that another member has refuted is not proposed again by reports for this many times `stuck`, so that who repeats a report
/// of a module that only some hear halts the others rarely.
const OVERRULED_FOR: u32 = 2;

/// What has become of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Standing {
    Proposed,
    /// A heartbeat of the run came that was sent after the report.
    Refuted,
    /// Another member had heard the run. Reports are ignored until then.
    Overruled(Duration),
}

/// What is known of the removal of one module's body.
#[derive(Clone, Copy, Debug, Hash)]
struct Report {
    /// The run that was reported as removed, with all earlier ones.
    incarnation: Incarnation,
    since: Duration,
    standing: Standing,
    /// The latest epoch for which this module froze with the proposal.
    proposed_in: Option<Epoch>,
    /// Whether the same report came before and was dropped.
    is_repeated: bool,
    /// Whether it takes the vote of the module as well.
    takes_vote: bool,
}

/// The reports that have not taken effect, at most one a module that sent a message or whose body is known.
#[derive(Clone, Debug, Default, Hash)]
pub(crate) struct Removals {
    reports: BTreeMap<ModuleId, Report>,
    /// The proposals that a roster may list.
    due: BTreeSet<ModuleRun>,
    /// An epoch the roster of which this module refused, and the modules that it lists as removed without right.
    refused: Option<(Epoch, BTreeSet<ModuleId>)>,
}

impl Removals {
    fn takes_vote(&self, run: ModuleRun) -> bool {
        let report = self.reports.get(&run.module);
        report.is_some_and(|report| report.incarnation == run.incarnation && report.takes_vote)
    }

    /// The voters whose votes a roster may list as removed.
    pub fn due_votes(&self) -> impl Iterator<Item = ModuleId> {
        let due = self.due.iter().filter(|run| self.takes_vote(**run));
        due.map(|run| run.module)
    }

    /// Whether a roster may list the removal of this run.
    pub fn is_due(&self, run: ModuleRun) -> bool {
        self.due.contains(&run)
    }

    /// Whether this module has heard the run since it was reported as removed.
    pub fn is_refuted(&self, run: ModuleRun) -> bool {
        let report = self.reports.get(&run.module);
        report.is_some_and(|report| {
            report.standing == Standing::Refuted && report.incarnation >= run.incarnation
        })
    }

    /// The runs of which [`Self::is_refuted`] holds, the latest of each module, ascending.
    fn refuted(&self) -> Vec<ModuleRun> {
        let refuted = self.reports.iter();
        refuted
            .filter(|(_, report)| report.standing == Standing::Refuted)
            .map(|(module, report)| module.run(report.incarnation))
            .collect()
    }

    /// Why this module left a gathering of this epoch, if it refused the roster for a removal.
    pub fn refused_in(&self, epoch: Epoch) -> Option<EpochReason> {
        let (refused, modules) = self.refused.as_ref()?;
        (*refused == epoch).then(|| EpochReason::RemovalsRefused(modules.iter().copied().collect()))
    }
}

/// The runs that a roster lists as removed.
fn listed(roster: &Roster) -> impl Iterator<Item = &BodyReport> {
    let bodies = roster.bodies.iter();
    bodies.filter(|report| {
        report.whereabouts == Whereabouts::Removed
            && !blocked_spots::lists(&roster.members, report.module)
    })
}

/// Whether a roster lists this run as removed, or a later one of its module.
pub(crate) fn lists(roster: &Roster, run: ModuleRun) -> bool {
    let find = roster
        .bodies
        .binary_search_by_key(&run.module, |report| report.module);
    find.is_ok_and(|index| {
        let report = &roster.bodies[index];
        report.whereabouts == Whereabouts::Removed && report.incarnation >= run.incarnation
    })
}

impl Removals {
    /// The removals of a roster that are in effect if its members agree, as far as this module has not refuted them. A store holds them
    /// with the digest of the plan: the members may agree without this module knowing.
    pub fn in_effect_by<'a>(&'a self, roster: &'a Roster) -> impl Iterator<Item = &'a BodyReport> {
        listed(roster).filter(|report| !self.is_refuted(report.run()))
    }
}

impl Context {
    /// Handles a report of somebody that a body was taken away.
    /// Enforces B5.
    pub fn handle_removal_report(&mut self, removal: Removal) {
        let run = removal.run;
        if run.module == self.module() || !self.is_known_run(run) {
            return self.refuse(Some(run.module), Refusal::RemovalOfUnknownRun);
        }
        let report = self.removals.reports.get(&run.module);
        let report = report.filter(|report| report.incarnation == run.incarnation);
        let is_heeded = report.is_none_or(|report| match report.standing {
            Standing::Proposed => removal.takes_vote && !report.takes_vote,
            Standing::Refuted => true,
            Standing::Overruled(until) => self.now >= until,
        });
        if is_heeded {
            let is_new = report.is_none();
            self.propose(removal, !is_new);
        }
    }

    /// Takes over a proposal of another module, unless this one has refuted it itself.
    pub fn learn_removal(&mut self, removal: Removal) {
        let run = removal.run;
        if run.module == self.module() || !(self.is_known_run(run) || self.hears(run)) {
            return;
        }
        let report = self.removals.reports.get(&run.module);
        let report = report.filter(|report| report.incarnation == run.incarnation);
        match report.map(|report| report.standing) {
            None => self.propose(removal, false),
            Some(Standing::Overruled(_)) => self.propose(removal, true),
            Some(Standing::Proposed) if removal.takes_vote && !self.removals.takes_vote(run) => {
                self.propose(removal, true);
            }
            Some(Standing::Proposed | Standing::Refuted) => {}
        }
    }

    fn propose(&mut self, removal: Removal, is_repeated: bool) {
        let Removal { run, takes_vote } = removal;
        let is_body_gone = self.bodies.removed_run(run.module) >= Some(run);
        if is_body_gone && (!takes_vote || self.session.lacks_vote(run.module)) {
            return;
        }
        let report = Report {
            incarnation: run.incarnation,
            since: self.now,
            standing: Standing::Proposed,
            proposed_in: None,
            is_repeated,
            takes_vote,
        };
        self.removals.reports.insert(run.module, report);
        if !is_repeated {
            self.emit(Event::RemovalProposed(run.module));
        }
    }

    /// Whether messages of this run came, or its body is known. What is said of any other run has no effect, and takes no memory.
    fn is_known_run(&self, run: ModuleRun) -> bool {
        let peer = self.peers.get(run.module);
        let body = self.bodies.get(run.module);
        peer.is_some_and(|peer| peer.incarnation == run.incarnation)
            || body.is_some_and(|body| body.incarnation == run.incarnation)
    }

    /// Whether a message of this run, or of an earlier one of its module, was sent within `suspicion`.
    fn hears(&self, run: ModuleRun) -> bool {
        let peer = self.peers.get(run.module);
        let peer = peer.filter(|peer| peer.incarnation <= run.incarnation);
        peer.is_some_and(|peer| self.now <= peer.last_seen() + self.parameters.suspicion)
    }

    /// Whether what was reported of a module, or that it was removed, may end with its next heartbeat.
    pub fn doubts_removal_of(&self, module: ModuleId) -> bool {
        self.removals.reports.contains_key(&module) || self.bodies.removed_run(module).is_some()
    }

    /// A heartbeat of this run came, also if it was refused for a later one: what was reported before it was sent is dropped, and so is a
    /// removal that has taken effect.
    /// Enforces B5.
    pub fn note_heard(&mut self, run: ModuleRun) {
        let peer = self.peers.get(run.module);
        let peer = peer.filter(|peer| peer.incarnation == run.incarnation);
        let sent_at = peer.map_or(self.now, |peer| peer.last_seen());
        // When it was sent is known but for the time that the fastest heartbeat was on its way.
        let on_the_way = self.parameters.heartbeat / 2;
        if let Some(report) = self.removals.reports.get_mut(&run.module)
            && report.standing == Standing::Proposed
            && report.incarnation >= run.incarnation
            && sent_at > report.since + on_the_way
        {
            report.standing = Standing::Refuted;
            let is_news = !report.is_repeated;
            self.bodies.mark_changed();
            if is_news {
                self.emit(Event::RemovalRefuted(run.module));
            }
        }
        let removed = self.bodies.removed_run(run.module);
        if let Some(removed) = removed.filter(|removed| *removed >= run)
            && self.hears(removed)
        {
            self.take_back(removed);
            self.emit(Event::RemovalRefuted(run.module));
        }
    }

    /// A removal that has taken effect is over: the run lives, and its body stands where it shows itself.
    fn take_back(&mut self, removed: ModuleRun) {
        self.bodies.forget_removal(removed.module);
        let Self { bodies, peers, .. } = self;
        if let Some(state) = peers.state(removed.module) {
            bodies.note_state(state);
        }
        let report = Report {
            incarnation: removed.incarnation,
            since: self.now,
            standing: Standing::Refuted,
            proposed_in: None,
            is_repeated: false,
            takes_vote: false,
        };
        self.removals.reports.insert(removed.module, report);
    }

    /// Finds which proposals are due, and asks to be woken when another one may be; returns whether they changed.
    pub fn refresh_removals(&mut self) -> bool {
        if self.removals.reports.is_empty() && self.removals.due.is_empty() {
            return false;
        }
        let removals = std::mem::take(&mut self.removals);
        let Removals {
            mut reports,
            due: before,
            refused,
        } = removals;
        // Once only a later run is known, a report is over. An earlier one that is known may have to refute it.
        reports.retain(|module, report| {
            let run = module.run(report.incarnation);
            let peer = self.peers.get(*module);
            self.is_known_run(run) || peer.is_some_and(|peer| peer.incarnation < run.incarnation)
        });
        let mut due = BTreeSet::new();
        for (module, report) in &reports {
            let run = module.run(report.incarnation);
            let body = self.bodies.get(*module);
            let is_of_body = body.is_some_and(|body| {
                let stands = body.whereabouts != Whereabouts::Removed;
                let is_of_vote = report.takes_vote && !self.session.lacks_vote(*module);
                body.incarnation == run.incarnation && (stands || is_of_vote)
            });
            if report.standing != Standing::Proposed || !is_of_body {
                continue;
            }
            if !self.hears(run) && self.has_listened() {
                due.insert(run);
                continue;
            }
            let suspicion = self.parameters.suspicion;
            let heard_until = self.peers.get(*module).map(|peer| peer.last_seen());
            let heard_until = heard_until.unwrap_or_default() + suspicion;
            // Silence begins after that time.
            let at = heard_until + Duration::from_micros(1);
            self.wake_at(at.max(self.own.started + suspicion));
        }
        let has_changed = due != before;
        if has_changed {
            self.bodies.mark_changed();
        }
        self.removals = Removals {
            reports,
            due,
            refused,
        };
        has_changed
    }

    /// Adds the removals that a frozen state carries. The module has been frozen since `frozen_at`.
    pub fn describe_removals(
        &mut self,
        state: &mut ModuleState,
        epoch: Epoch,
        frozen_at: Duration,
    ) {
        let due = self.removals.due.iter();
        let due = due.map(|&run| Removal {
            run,
            takes_vote: self.removals.takes_vote(run),
        });
        state.proposed_removals = due.collect();
        state.refuted_removals = self.removals.refuted();
        for Removal { run, .. } in &state.proposed_removals {
            // The convener may have closed its roster before a later one.
            if let Some(report) = self.removals.reports.get_mut(&run.module)
                && report.since <= frozen_at
            {
                report.proposed_in = Some(epoch);
            }
        }
    }

    /// As the convener, takes over what frozen members have refuted, of what was reported before `frozen_at`.
    pub fn learn_refutations(&mut self, frozen: &[Arc<ModuleState>], frozen_at: Duration) {
        for &run in frozen.iter().flat_map(|state| &state.refuted_removals) {
            if let Some(removed) = self.bodies.removed_run(run.module)
                && removed <= run
            {
                self.bodies.forget_removal(run.module);
            }
            let report = self.removals.reports.get(&run.module);
            if report.is_some_and(|report| {
                report.standing == Standing::Proposed
                    && report.incarnation <= run.incarnation
                    && report.since <= frozen_at
            }) {
                self.overrule(run.module);
            }
        }
    }

    /// As the convener, takes over the proposals of frozen members that none of them has refuted, once their bodies are known.
    pub fn learn_proposals(&mut self, frozen: &[Arc<ModuleState>]) {
        let refuted: BTreeSet<ModuleId> = frozen
            .iter()
            .flat_map(|state| &state.refuted_removals)
            .map(|run| run.module)
            .collect();
        let present: BTreeSet<ModuleId> = frozen.iter().map(|state| state.module).collect();
        let is_open = |removal: &Removal| {
            !present.contains(&removal.run.module) && !refuted.contains(&removal.run.module)
        };
        for state in frozen {
            let bodies = state.bodies.iter();
            let in_effect = bodies.filter(|body| body.whereabouts == Whereabouts::Removed);
            let in_effect = in_effect.map(|body| Removal::of_body(body.run()));
            let proposed = state.proposed_removals.iter().copied();
            for removal in in_effect.chain(proposed).filter(&is_open) {
                self.learn_removal(removal);
            }
        }
        self.refresh_removals();
    }

    /// As the convener, takes over removals in effect of runs that began after those whose bodies are known here, unless it or a frozen
    /// member has heard the module.
    pub fn learn_later_removals(&mut self, frozen: &[Arc<ModuleState>]) {
        let is_heard = |run: &ModuleRun| {
            let mut refuted = frozen.iter().flat_map(|state| &state.refuted_removals);
            refuted.any(|refuted| refuted.module == run.module)
                || frozen.iter().any(|state| state.module == run.module)
        };
        for report in frozen.iter().flat_map(|state| &state.bodies) {
            let run = report.run();
            let known = self.bodies.get(run.module);
            if report.whereabouts == Whereabouts::Removed
                && known.is_some_and(|known| known.incarnation < run.incarnation)
                && run.module != self.module()
                && !is_heard(&run)
                && !self.hears(run)
            {
                self.bodies.note(report.clone());
            }
        }
    }

    fn overrule(&mut self, module: ModuleId) {
        let until = self.now + self.parameters.stuck * OVERRULED_FOR;
        if let Some(report) = self.removals.reports.get_mut(&module) {
            report.standing = Standing::Overruled(until);
            self.bodies.mark_changed();
            self.emit(Event::RemovalOverruled(module));
        }
    }

    /// What a roster of this epoch says of a body: that it was removed, if that is due.
    pub fn listed_in_roster(&self, report: BodyReport, epoch: Epoch) -> BodyReport {
        let run = report.run();
        if self.removals.is_due(run) {
            removed(run, Some(epoch))
        } else {
            report
        }
    }

    /// Refuses a roster that lists a run as removed that this module hears, or that the roster is the first to list while this module
    /// has not listened for `suspicion`.
    /// Enforces B5.
    pub fn check_removals(&mut self, roster: &Roster) -> Result<(), Refusal> {
        let has_listened = self.has_listened();
        let (mut heard, mut early) = (Vec::new(), Vec::new());
        for report in listed(roster).filter(|report| report.module != self.module()) {
            let run = report.run();
            let is_in_effect = self.bodies.removed_run(run.module) >= Some(run);
            if self.hears(run) || self.removals.is_refuted(run) {
                heard.push(run.module);
            } else if !has_listened && report.epoch == Some(roster.epoch) && !is_in_effect {
                early.push(run.module);
            }
        }
        if heard.is_empty() && early.is_empty() {
            self.removals.refused = None;
            return Ok(());
        }
        for report in listed(roster) {
            self.learn_removal(Removal::of_body(report.run()));
        }
        let refused = heard.iter().chain(&early).copied().collect();
        self.removals.refused = Some((roster.epoch, refused));
        if !heard.is_empty() {
            let (epoch, modules) = (roster.epoch, heard);
            self.emit(Event::RemovalsHeard { epoch, modules });
        }
        if !early.is_empty() {
            let (epoch, modules) = (roster.epoch, early);
            self.emit(Event::RemovalsEarly { epoch, modules });
        }
        Err(Refusal::RemovalOfLiving)
    }

    /// All members agree on a roster: the removals that it lists take effect, and those that it does not list although this module froze
    /// with them were refuted by another member.
    /// Enforces B5.
    pub fn settle_removals(&mut self, roster: &Roster) {
        let in_effect: Vec<BodyReport> = self.removals.in_effect_by(roster).cloned().collect();
        for report in &in_effect {
            let run = report.run();
            let is_news = self.bodies.removed_run(run.module) < Some(run);
            self.bodies.note(report.clone());
            let known = self.removals.reports.get(&run.module);
            if known.is_some_and(|known| known.incarnation <= run.incarnation) {
                self.removals.reports.remove(&run.module);
            }
            if is_news {
                self.emit(Event::BodyRemoved(run.module));
            }
        }
        let standing = roster.bodies.iter().filter(|report| {
            report.whereabouts != Whereabouts::Removed
                && !blocked_spots::lists(&roster.members, report.module)
        });
        for report in standing {
            let run = report.run();
            if self.bodies.removed_run(run.module) >= Some(run) {
                self.bodies.forget_removal(run.module);
                self.bodies.note(report.clone());
                self.emit(Event::RemovalOverruled(run.module));
            }
            let known = self.removals.reports.get(&run.module);
            if known.is_some_and(|known| {
                known.incarnation == run.incarnation
                    && known.standing == Standing::Proposed
                    && known.proposed_in == Some(roster.epoch)
            }) {
                self.overrule(run.module);
            }
        }
        self.refresh_removals();
    }
}

/// That a run was removed, by the roster of this epoch.
fn removed(run: ModuleRun, epoch: Option<Epoch>) -> BodyReport {
    BodyReport {
        module: run.module,
        incarnation: run.incarnation,
        epoch,
        sequence: 0,
        whereabouts: Whereabouts::Removed,
    }
}
