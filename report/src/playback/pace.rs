//! From recorded time to the time of the film.

use formation_event_log::{Entry, LogEvent, Scene};

use super::track::time;

/// All turns together take about this long, seconds.
const TURNS_S: f64 = 24.0;
/// The bounds of one turn, seconds.
const TURN_MIN_S: f64 = 0.1;
const TURN_MAX_S: f64 = 1.0;
/// All motions together take at most this long, seconds; faster ones keep their own time.
const MOTIONS_MAX_S: f64 = 60.0;
/// The maximum of a wait during which nothing moves, seconds.
const WAIT_MAX_S: f64 = 0.4;
/// The time of the first and the last picture, seconds.
const STAND_S: f64 = 0.6;
/// The minimum distance of clock entries, seconds.
const CLOCK_GAP_S: f64 = 0.05;

/// The pace of the film.
pub(super) struct Pace {
    turn_s: f64,
    motion_scale: f64,
    now: f64,
    recorded_ms: u64,
    after_claim: bool,
    clock: Vec<(f64, u64)>,
}

impl Pace {
    pub(super) fn of(course: &[Entry]) -> Self {
        let turns = course
            .iter()
            .filter(|entry| matches!(entry.event, LogEvent::Claim { .. }))
            .count();
        let first_ms = course.first().map_or(0, |entry| entry.at_ms);
        let motions_s = seconds(moving_ms(course));
        #[expect(clippy::cast_precision_loss, reason = "a number of turns")]
        let turn_s = (TURNS_S / turns.max(1) as f64).clamp(TURN_MIN_S, TURN_MAX_S);
        Self {
            turn_s,
            motion_scale: (MOTIONS_MAX_S / motions_s.max(0.001)).min(1.0),
            now: 0.0,
            recorded_ms: first_ms,
            after_claim: false,
            clock: vec![(0.0, first_ms)],
        }
    }

    /// The time of the film at an entry; `moving` is whether anything moved since the last one.
    pub(super) fn advance(&mut self, entry: &Entry, moving: bool) -> f64 {
        let passed_s = seconds(entry.at_ms.saturating_sub(self.recorded_ms));
        self.recorded_ms = self.recorded_ms.max(entry.at_ms);
        let mut step_s = if moving {
            passed_s * self.motion_scale
        } else {
            passed_s.min(WAIT_MAX_S)
        };
        let is_claim = matches!(entry.event, LogEvent::Claim { .. });
        if is_claim || self.after_claim {
            step_s = step_s.max(self.turn_s);
        }
        if matches!(entry.event, LogEvent::Roster { .. }) {
            step_s = step_s.max(STAND_S);
        }
        self.after_claim = is_claim;
        self.now += step_s;
        let last = self.clock.last().map_or(0.0, |&(at, _)| at);
        if self.now >= last + CLOCK_GAP_S {
            self.clock.push((time(self.now), self.recorded_ms));
        }
        self.now
    }

    /// The end of the film.
    pub(super) fn end(&mut self) -> f64 {
        self.clock.push((time(self.now), self.recorded_ms));
        self.now += STAND_S;
        self.now
    }

    pub(super) fn clock(self) -> Vec<(f64, u64)> {
        self.clock
    }
}

/// The time during which at least one module moved, milliseconds.
fn moving_ms(course: &[Entry]) -> u64 {
    let mut scene = Scene::default();
    let mut last_ms = 0;
    let mut sum_ms = 0;
    for entry in course {
        if scene.is_moving() {
            sum_ms += entry.at_ms.saturating_sub(last_ms);
        }
        last_ms = entry.at_ms;
        scene.apply(entry);
    }
    sum_ms
}

#[expect(clippy::cast_precision_loss, reason = "a few hours at most")]
fn seconds(millis: u64) -> f64 {
    millis as f64 / 1_000.0
}
