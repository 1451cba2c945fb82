//! Whether bodies meet, blocks stay rigid, and steps keep their waits: judged from the poses that modules publish, with the
//! times of their senders.
//!
//! A module publishes a state at every corner, begin and stop of its motion, and where it enters cells for which it waited.
//! Between two states that follow each other it moves on a line, so its body is known at every moment. Judged is what modules do
//! by a plan, and not how a hand or a drive without one moves them.
//!
//! The later of two runs is that of the higher number. If states of the other one come after it, either they are late, or the
//! clock was set back between the two: then it is not known where the module stands, and since when by which clock. So it is
//! not judged until the run of the higher number publishes again.
//!
//! Modules that are docked to each other, directly or through others, are one body: instead of overlap it is judged whether
//! they keep their places to each other from step to step, unless they fold, and whether each begins a step only when the
//! others have done the one before.

mod geometry;
mod track;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use self::geometry::{Body, Placed};
use self::track::{Added, Segment, StepEnd, Track};
use super::parameters::ObserverParameters;
use crate::violation::{VIOLATIONS_MAX, Violation};
use formation_model::{
    BODY_WIDTH, Epoch, MODULES_MAX, MicroUnits, ModuleId, ModuleState, Pose, Target,
};

/// The greatest number of contacts that wait for the next state of a module that stands.
const SUSPICIONS_MAX: usize = 1_024;
/// The greatest number of pairs of modules whose breaches are kept.
const FOUND_MAX: usize = 4 * VIOLATIONS_MAX;

/// What kind of promise was broken, by which modules.
type Pair = (Epoch, Promise, ModuleId, ModuleId);
/// A broken promise with a measure of its gravity.
type Breach = (Pair, i64, Violation);

/// A breach that is kept.
#[derive(Clone, Debug)]
struct Found {
    gravity: i64,
    violation: Violation,
    /// Where the modules were at the end of the segments that show it, if segments do.
    places: Vec<(ModuleId, Placed)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Promise {
    Apart,
    Wait,
    Rigid,
}

/// A segment that meets a module which stood there at its last known state. It counts once the next state of that module
/// shows that it had not left by then, or if no more states are to come.
#[derive(Clone, Debug)]
struct Suspicion {
    segment: Segment,
    standing: ModuleId,
    /// Since when a verdict could say so.
    due_since: Option<Duration>,
}

/// Where the modules of a session were, as far as they published it.
#[derive(Clone, Debug, Default)]
pub(super) struct Bodies {
    /// The greatest difference between the clocks of two processes.
    clock_error: Duration,
    /// How far a pose at the end of a step may be off, in units.
    position_tolerance: f64,
    /// The width of a body, by the target of the latest roster.
    width: MicroUnits,
    /// Whether bodies are round, by the same.
    is_round: bool,
    tracks: BTreeMap<ModuleId, Track>,
    suspicions: Vec<Suspicion>,
    /// The gravest breach of each promise.
    found: BTreeMap<Pair, Found>,
    /// How long each module that moved overlapped others by no more than the stated uncertainty.
    pub(super) unjudged: BTreeMap<ModuleId, Duration>,
    /// The number of segments that were compared with all others.
    pub(super) segments: u64,
}

impl Bodies {
    pub(super) fn new(parameters: &ObserverParameters) -> Self {
        Self {
            clock_error: parameters.clock_error,
            position_tolerance: parameters.position_tolerance.to_units(),
            width: BODY_WIDTH,
            ..Self::default()
        }
    }

    /// The target of a roster states what its bodies look like.
    pub(super) fn note_target(&mut self, target: &Target) {
        self.is_round = target.surroundings().body().is_round();
        self.width = target.surroundings().body_width();
    }

    /// Handles a state. The transport delivers those of one run in their order; what is missing between two is not judged.
    pub(super) fn handle(&mut self, state: &ModuleState) {
        let module = state.module;
        let known = self.tracks.get_mut(&module);
        if let Some(track) = known.filter(|track| track.incarnation >= state.incarnation) {
            if track.incarnation > state.incarnation {
                track.is_doubtful = true;
                self.suspicions.retain(|one| one.standing != module);
            } else if let Some(added) = track.advance(state) {
                self.judge(module, added);
            }
        } else if self.tracks.len() < MODULES_MAX || self.tracks.contains_key(&module) {
            self.suspicions.retain(|one| one.standing != module);
            self.tracks.insert(module, Track::new(state));
            self.suspect_rest(module);
        }
    }

    /// A verdict is due: modules stand where they stood last, but for those that are out of sight, if no other state has come within
    /// `patience`, as their states may be on the way. Returns whether one is waited for.
    pub(super) fn settle(
        &mut self,
        now: Duration,
        patience: Duration,
        out_of_sight: &BTreeSet<ModuleId>,
    ) -> bool {
        let (due, waiting): (Vec<_>, Vec<_>) = std::mem::take(&mut self.suspicions)
            .into_iter()
            .partition(|one| one.due_since.unwrap_or(now).saturating_add(patience) <= now);
        let waiting = waiting.into_iter().map(|one| Suspicion {
            due_since: Some(one.due_since.unwrap_or(now)),
            ..one
        });
        self.suspicions = waiting.collect();
        for Suspicion {
            segment, standing, ..
        } in due
        {
            if out_of_sight.contains(&standing) {
                continue;
            }
            let track = self.tracks.get(&standing);
            if let Some(rest) = track.and_then(|track| track.rest(standing, segment.leg.end)) {
                self.compare(&segment, &rest);
            }
        }
        let mut waiting = self.suspicions.iter();
        waiting.any(|one| !out_of_sight.contains(&one.standing))
    }

    /// The number of states that did not arrive.
    pub(super) fn missed(&self) -> u64 {
        self.tracks.values().map(|track| track.missed).sum()
    }

    /// The breaches in an epoch, of modules of which `counts` says so. It is given whether the module was at a pose.
    pub(super) fn violations(
        &self,
        epoch: Epoch,
        counts: impl Fn(ModuleId, &dyn Fn(Pose) -> bool) -> bool,
    ) -> impl Iterator<Item = Violation> {
        let found = self.found.iter();
        let all_count = move |found: &Found, modules: [ModuleId; 2]| {
            modules.into_iter().all(|module| {
                let mut places = found.places.iter();
                let place = places.find(|(one, _)| *one == module);
                let was_at = |pose: Pose| place.is_none_or(|(_, place)| *place == pose.into());
                counts(module, &was_at)
            })
        };
        found
            .filter(move |((of, _, one, other), found)| {
                *of == epoch && all_count(found, [*one, *other])
            })
            .map(|(_, found)| found.violation.clone())
    }

    /// Judges what a new state of a module adds.
    /// Enforces V5.
    fn judge(&mut self, module: ModuleId, added: Added) {
        let suspicions = std::mem::take(&mut self.suspicions).into_iter();
        let (suspicions, others): (Vec<_>, Vec<_>) =
            suspicions.partition(|one| one.standing == module);
        self.suspicions = others;
        if let Some(segment) = added.segment {
            for Suspicion { segment: other, .. } in suspicions {
                self.compare(&segment, &other);
            }
            self.compare_with_all(&segment);
        }
        self.suspect_rest(module);
        if let Some((epoch, steps)) = added.step {
            self.check_unit(module, epoch, steps);
        }
    }

    fn compare_with_all(&mut self, segment: &Segment) {
        self.segments += 1;
        let leg = segment.leg;
        let mut meets = Vec::new();
        let mut suspicions = Vec::new();
        for (&other, track) in &self.tracks {
            if other == segment.module {
                continue;
            }
            let known = track.segments.iter().rev();
            let known = known.take_while(|one| one.leg.end > leg.begin);
            meets.extend(
                known
                    .filter(|one| leg.moves() || one.leg.moves())
                    .filter(|one| self.is_breach(segment, one))
                    .cloned(),
            );
            let rest = track.rest(other, leg.end);
            suspicions.extend(rest.and_then(|rest| self.suspicion(segment, &rest)));
        }
        for other in meets {
            self.compare(segment, &other);
        }
        self.suspect(suspicions);
    }

    /// Compares where a module stands now with what others did since.
    fn suspect_rest(&mut self, module: ModuleId) {
        let Some(own) = self.tracks.get(&module) else {
            return;
        };
        let others = self.tracks.iter().filter(|&(&other, _)| other != module);
        let since = own.last.at;
        let segments = others.flat_map(|(_, track)| {
            let latest = track.segments.iter().rev();
            latest.take_while(|one| one.leg.end > since)
        });
        let suspicions = segments.filter_map(|segment| {
            let rest = own.rest(module, segment.leg.end)?;
            self.suspicion(segment, &rest)
        });
        self.suspect(suspicions.collect());
    }

    fn suspicion(&self, segment: &Segment, rest: &Segment) -> Option<Suspicion> {
        let meets = segment.leg.moves()
            && self.is_breach(segment, rest)
            && !self.are_docked(segment, rest.module);
        meets.then(|| Suspicion {
            segment: segment.clone(),
            standing: rest.module,
            due_since: None,
        })
    }

    fn suspect(&mut self, suspicions: Vec<Suspicion>) {
        let room = SUSPICIONS_MAX.saturating_sub(self.suspicions.len());
        self.suspicions.extend(suspicions.into_iter().take(room));
    }

    fn is_breach(&self, one: &Segment, other: &Segment) -> bool {
        self.overlap(one, other).is_some()
            || self.early_entry(one, other).is_some()
            || self.is_doubtful(one, other)
    }

    /// Records what two segments show, unless their modules are docked.
    fn compare(&mut self, one: &Segment, other: &Segment) {
        let (found, early) = (self.overlap(one, other), self.early_entry(one, other));
        let is_doubtful = self.is_doubtful(one, other);
        if found.is_none() && early.is_none() && !is_doubtful || self.are_docked(one, other.module)
        {
            return;
        }
        if is_doubtful {
            self.note_unjudged(one, other);
        }
        let places = [one, other].map(|one| (one.module, one.leg.to));
        for breach in found.into_iter().chain(early) {
            self.record(breach, &places);
        }
    }

    fn record(&mut self, (pair, gravity, violation): Breach, places: &[(ModuleId, Placed)]) {
        if self.found.len() >= FOUND_MAX && !self.found.contains_key(&pair) {
            return;
        }
        let found = Found {
            gravity,
            violation,
            places: places.to_vec(),
        };
        let known = self.found.entry(pair).or_insert_with(|| found.clone());
        if gravity > known.gravity || gravity == known.gravity && found.violation < known.violation
        {
            *known = found;
        }
    }

    /// The epoch by whose plan two segments are judged, if what moves in them moves by one.
    fn judged_epoch(one: &Segment, other: &Segment) -> Option<Epoch> {
        let moving = || [one, other].into_iter().filter(|one| one.leg.moves());
        let have_plans = moving().all(|one| one.steps.is_some());
        moving()
            .filter_map(|one| one.epoch)
            .max()
            .filter(|_| have_plans)
    }

    /// By how much two bodies may seem to overlap without a contact: by the clearance, or by the stated tolerances of both poses if
    /// these are more.
    fn uncertainty(&self) -> f64 {
        (1.0 - self.width()).max(2.0 * self.position_tolerance)
    }

    /// Whether two bodies that are not found to touch overlap by more than the clearance explains: the tolerances of their poses may
    /// hide a contact.
    fn is_doubtful(&self, one: &Segment, other: &Segment) -> bool {
        let (width, error) = (self.width(), self.clock_error);
        if self.uncertainty() <= 1.0 - width || Self::judged_epoch(one, other).is_none() {
            return false;
        }
        let deepest = one.leg.deepest(&other.leg, self.body());
        let speed = one.leg.error_speed(&other.leg, width);
        let explained = 1.0 - width + speed * error.as_secs_f64();
        deepest.is_some_and(|(_, depth)| depth > explained) && self.overlap(one, other).is_none()
    }

    /// Adds the time that two segments have in common to that for which those of their modules that move are not judged.
    fn note_unjudged(&mut self, one: &Segment, other: &Segment) {
        let common = one.leg.common(&other.leg);
        let lasted = common.map_or(Duration::ZERO, |(begin, end)| end.saturating_sub(begin));
        for segment in [one, other].into_iter().filter(|one| one.leg.moves()) {
            if self.unjudged.len() < MODULES_MAX || self.unjudged.contains_key(&segment.module) {
                *self.unjudged.entry(segment.module).or_default() += lasted;
            }
        }
    }

    /// Two bodies overlap by more than the clearance, or the tolerances of both, and what an error of the clocks explains.
    fn overlap(&self, one: &Segment, other: &Segment) -> Option<Breach> {
        let epoch = Self::judged_epoch(one, other)?;
        let (width, error) = (self.width(), self.clock_error);
        let (at, depth) = one.leg.deepest(&other.leg, self.body())?;
        let speed = one.leg.error_speed(&other.leg, width);
        if depth <= self.uncertainty() + speed * error.as_secs_f64() {
            return None;
        }
        let depth = MicroUnits::from_units(depth).ok()?;
        let (first, second) = in_order(one.module, other.module);
        let violation = Violation::BodiesOverlap {
            epoch,
            first,
            second,
            depth,
            at,
        };
        Some(((epoch, Promise::Apart, first, second), depth.0, violation))
    }

    /// A module entered a place while another might still be there: the places that they cross overlap, and so do the times
    /// between the states that they published before and after.
    fn early_entry(&self, one: &Segment, other: &Segment) -> Option<Breach> {
        let epoch = Self::judged_epoch(one, other)?;
        let (begin, end) = one.leg.common(&other.leg)?;
        let early = end.saturating_sub(begin);
        let depth = one.leg.swept_depth(&other.leg, self.body())?;
        if early <= self.clock_error || depth <= self.uncertainty() {
            return None;
        }
        let is_later = |one: &Segment, other: &Segment| {
            (one.leg.begin, one.module) > (other.leg.begin, other.module)
        };
        let (entering, there) = match is_later(one, other) {
            true => (one, other),
            false => (other, one),
        };
        // One that stands has arrived before.
        if !entering.leg.moves() {
            return None;
        }
        let violation = Violation::WaitNotKept {
            epoch,
            module: entering.module,
            step: entering.steps?.saturating_add(1),
            other: there.module,
            early,
            at: begin,
        };
        let (first, second) = in_order(entering.module, there.module);
        Some((
            (epoch, Promise::Wait, first, second),
            gravity(early),
            violation,
        ))
    }

    /// Whether two modules may have been docked, directly or through others, while a segment lasted: where states of one between
    /// them are missing, it may have been.
    fn are_docked(&self, segment: &Segment, other: ModuleId) -> bool {
        let mut docked = BTreeSet::from([segment.module]);
        let mut open = vec![segment.module];
        let leg = segment.leg;
        while let Some(next) = open.pop() {
            for link in self.links(next, segment) {
                let track = self.tracks.get(&link);
                if track.is_none_or(|track| !track.is_whole(leg.begin, leg.end)) {
                    return true;
                }
                if self.links(link, segment).contains(&next) && docked.insert(link) {
                    open.push(link);
                }
            }
        }
        docked.contains(&other)
    }

    /// The links that a module named while a segment lasted.
    fn links(&self, module: ModuleId, segment: &Segment) -> BTreeSet<ModuleId> {
        let Some(track) = self.tracks.get(&module) else {
            return BTreeSet::new();
        };
        let segments = track.segments.iter();
        let lasted = segments
            .filter(|one| one.leg.begin < segment.leg.end && segment.leg.begin < one.leg.end);
        let named = lasted.flat_map(|one| one.links.iter().copied());
        let last = Some(&track.last).filter(|last| last.at < segment.leg.end);
        let last = last
            .into_iter()
            .flat_map(|last| last.may_be_docked.iter().copied());
        named.chain(last).collect()
    }

    /// Modules that are docked before and after a step begin it together and keep their places to each other.
    fn check_unit(&mut self, module: ModuleId, epoch: Epoch, steps: u32) {
        let Some(end) = self.end(module, epoch, steps) else {
            return;
        };
        let partners = end.links.iter().copied();
        let breaches: Vec<Breach> = partners
            .filter(|_| steps > 0)
            .filter_map(|partner| Some((partner, self.end(partner, epoch, steps)?)))
            .filter(|(_, other)| other.links.contains(&module))
            .flat_map(|(partner, other)| {
                let pairs = [
                    ((module, end), (partner, other)),
                    ((partner, other), (module, end)),
                ];
                let waits = pairs.map(|(one, other)| self.early_begin(one, other));
                waits
                    .into_iter()
                    .chain([self.torn((module, end), (partner, other))])
            })
            .flatten()
            .collect();
        for breach in breaches {
            self.record(breach, &[]);
        }
    }

    fn end(&self, module: ModuleId, epoch: Epoch, steps: u32) -> Option<&StepEnd> {
        self.tracks.get(&module)?.end(epoch, steps)
    }

    /// A module began a step before a module that is docked to it had done the one before.
    fn early_begin(
        &self,
        (module, end): (ModuleId, &StepEnd),
        (partner, other): (ModuleId, &StepEnd),
    ) -> Option<Breach> {
        let began = end.began?;
        let early = other.at.checked_sub(began)?;
        if early <= self.clock_error {
            return None;
        }
        let violation = Violation::WaitNotKept {
            epoch: end.epoch,
            module,
            step: end.steps.saturating_add(1),
            other: partner,
            early,
            at: began,
        };
        let (first, second) = in_order(module, partner);
        Some((
            (end.epoch, Promise::Wait, first, second),
            gravity(early),
            violation,
        ))
    }

    /// Two docked modules stand to each other after a step as they did not before.
    fn torn(
        &self,
        (module, end): (ModuleId, &StepEnd),
        (partner, other): (ModuleId, &StepEnd),
    ) -> Option<Breach> {
        let before = self.end(module, end.epoch, end.steps - 1)?;
        let other_before = self.end(partner, end.epoch, end.steps - 1)?;
        let were_docked = before.links.contains(&partner) && other_before.links.contains(&module);
        if end.folded || other.folded || !were_docked {
            return None;
        }
        let was = before.placed.sees(&other_before.placed);
        let is = end.placed.sees(&other.placed);
        let tolerance = (1.0 - self.width()).max(2.0 * self.position_tolerance);
        // Halted in mid-step or in a fold they are no rigid body: the first steps bring each to a place of its own.
        if was.off_docked(self.width()) > tolerance {
            return None;
        }
        let off = was
            .deviation(&is, self.width())
            .min(is.off_docked(self.width()));
        if off <= tolerance {
            return None;
        }
        let (first, second) = in_order(module, partner);
        let off = MicroUnits::from_units(off).ok()?;
        let violation = Violation::BlockTorn {
            epoch: end.epoch,
            first,
            second,
            step: end.steps,
            off,
            at: end.at.max(other.at),
        };
        Some(((end.epoch, Promise::Rigid, first, second), off.0, violation))
    }

    fn body(&self) -> Body {
        Body {
            width: self.width(),
            is_round: self.is_round,
        }
    }

    fn width(&self) -> f64 {
        self.width.to_units()
    }
}

fn in_order(one: ModuleId, other: ModuleId) -> (ModuleId, ModuleId) {
    (one.min(other), one.max(other))
}

fn gravity(early: Duration) -> i64 {
    i64::try_from(early.as_micros()).unwrap_or(i64::MAX)
}
