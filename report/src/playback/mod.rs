//! The film that the page and the animated picture play: the state of all modules, spots and links at every time.
//!
//! The film is not in real time, because turns take microseconds and motions take minutes: turns are lengthened, long
//! motions shortened, and waits in which nothing moves cut. The clock next to the film shows the recorded time.

mod links;
mod pace;
mod track;

use std::collections::BTreeMap;

use formation_event_log::{Entry, LogEvent, ModuleSnapshot, Scene, SceneChange};
use formation_model::{FormationStage, ModuleId, ModulePhase, SpotId};
use serde::Serialize;

use crate::frame::Frame;
use crate::subject::Subject;
use links::Links;
pub(crate) use links::{Fate, Span};
use pace::Pace;
use track::{Corner, corners};
pub(crate) use track::{Keyframe, Track};

/// The approximate maximum of keyframes of all modules on a page; more make it large without visible effect.
pub(crate) const KEYFRAMES_MAX: usize = 40_000;
/// The minimum limit of keyframes of one module, which keeps the last ones.
const KEYFRAMES_MIN: usize = 16;
/// The approximate maximum of corners of all planned paths; a module whose path has more than its share is shown the way that it
/// went instead.
const CORNERS_MAX: usize = 100_000;
/// The maximum number of steps; further steps are left out.
const STEPS_MAX: usize = 30_000;

/// A film: times are seconds from its beginning, places are pixels on the ground.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Film {
    /// The length in seconds.
    pub(crate) length: f64,
    /// When the first module moves, at which the player begins; 0 if none does.
    begin: f64,
    /// The side of a module's square.
    side: f64,
    /// The length of a unit.
    unit: f64,
    /// The recorded milliseconds at some times, between which the player interpolates.
    clock: Vec<(f64, u64)>,
    /// The stages, each with the time at which it begins.
    pub(crate) stages: Vec<(f64, FormationStage)>,
    /// The steps, each a sentence.
    pub(crate) steps: Vec<FilmStep>,
    /// Whether modules follow the planned paths, each with the time from which it holds.
    planned: Vec<(f64, bool)>,
    pub(crate) modules: Vec<ModuleFilm>,
    pub(crate) spots: Vec<SpotFilm>,
    /// The links, each with the times at which it begins and ends.
    pub(crate) links: Vec<Span>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct FilmStep {
    at: f64,
    text: String,
    /// The modules that act, and those that lose their spot.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    acting: Vec<usize>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    evicted: Vec<usize>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct ModuleFilm {
    pub(crate) id: u32,
    /// The keyframes of its path.
    pub(crate) track: Track,
    /// The corners of its planned path.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    path: Vec<Corner>,
    /// Its phases, each with the time at which it begins.
    pub(crate) phases: Vec<(f64, ModulePhase)>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct SpotFilm {
    id: u32,
    x: f64,
    y: f64,
    /// The clockwise angle in degrees.
    #[serde(skip_serializing_if = "is_zero")]
    turn: f64,
    /// Its holders by the claims, each with the time from which it holds the spot; `None` when the spot is free.
    pub(crate) holders: Vec<(f64, Option<usize>)>,
}

impl Film {
    /// Makes a film of a course, of about `keyframes_max` keyframes at most. `end` is its last sentence.
    pub(crate) fn of(
        subject: &Subject,
        course: &[Entry],
        frame: &Frame,
        end: &str,
        keyframes_max: usize,
    ) -> Self {
        let mut cutting = Cutting::new(subject, course, frame, keyframes_max);
        for entry in course {
            cutting.take(entry);
        }
        cutting.finish(end)
    }

    /// The time of the film at a share of the recorded time from the first motion to the end.
    #[expect(clippy::cast_precision_loss, reason = "a few hours at most")]
    pub(crate) fn moment(&self, share: f64) -> f64 {
        let recorded = |at: f64| {
            let after = self.clock.partition_point(|&(time, _)| time <= at);
            between(at, self.around(after), |&(time, ms)| (time, ms as f64))
        };
        let last = self.clock.last().map_or(0, |&(_, ms)| ms) as f64;
        let from = recorded(self.begin);
        let wanted = from + (last - from) * share;
        let after = self.clock.partition_point(|&(_, ms)| (ms as f64) < wanted);
        between(wanted, self.around(after), |&(time, ms)| (ms as f64, time))
    }

    /// The entries of the clock before and after a position, the same one at its ends.
    fn around(&self, after: usize) -> [&(f64, u64); 2] {
        const NEVER: &(f64, u64) = &(0.0, 0);
        let last = self.clock.len().saturating_sub(1);
        [after.saturating_sub(1), after]
            .map(|index| self.clock.get(index.min(last)).unwrap_or(NEVER))
    }
}

/// What belongs to `at`, on the line between two points.
fn between<T>(at: f64, ends: [&T; 2], point: impl Fn(&T) -> (f64, f64)) -> f64 {
    let [(from, low), (to, high)] = ends.map(point);
    match to > from {
        true => low + (high - low) * ((at - from) / (to - from)).clamp(0.0, 1.0),
        false => high,
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(turn: &f64) -> bool {
    *turn == 0.0
}

/// A film that is being made.
struct Cutting<'a> {
    subject: &'a Subject,
    frame: &'a Frame,
    pace: Pace,
    now: f64,
    begin: Option<f64>,
    planned: Vec<(f64, bool)>,
    scene: Scene,
    stages: Vec<(f64, FormationStage)>,
    steps: Vec<FilmStep>,
    modules: Vec<ModuleFilm>,
    spots: Vec<SpotFilm>,
    spot_of: BTreeMap<SpotId, usize>,
    links: Links,
}

impl<'a> Cutting<'a> {
    fn new(subject: &'a Subject, course: &[Entry], frame: &'a Frame, keyframes_max: usize) -> Self {
        let keyframes_max = (keyframes_max / subject.modules.len().max(1)).max(KEYFRAMES_MIN);
        let scene = Scene::default();
        let corners_max = (CORNERS_MAX / subject.modules.len().max(1)).max(KEYFRAMES_MIN);
        let modules = subject.modules.iter().map(|module| ModuleFilm {
            id: module.id.0,
            track: Track::new(frame, &module.start, keyframes_max),
            path: Some(corners(frame, &module.path))
                .filter(|path| path.len() <= corners_max)
                .unwrap_or_default(),
            phases: Vec::new(),
        });
        let spots = subject.spots.iter().map(|spot| SpotFilm {
            id: spot.id.0,
            x: track::pixel(frame.x(&spot.pose)),
            y: track::pixel(frame.y(&spot.pose)),
            turn: track::pixel(Frame::turn(&spot.pose)),
            holders: Vec::new(),
        });
        let spot_ids = subject.spots.iter().map(|spot| spot.id);
        Self {
            subject,
            frame,
            pace: Pace::of(course),
            now: 0.0,
            begin: None,
            planned: Vec::new(),
            stages: vec![(0.0, scene.stage())],
            scene,
            steps: Vec::new(),
            modules: modules.collect(),
            spots: spots.collect(),
            spot_of: spot_ids.zip(0..).collect(),
            links: Links::new(subject),
        }
    }

    fn take(&mut self, entry: &Entry) {
        self.now = track::time(self.pace.advance(entry, self.scene.is_moving()));
        // Modules that are not part of the subject are not shown.
        match &entry.event {
            LogEvent::State(snapshot) => match self.subject.position_of(snapshot.module) {
                Some(module) => self.show_state(module, snapshot),
                None => return,
            },
            LogEvent::Pose { module, pose } => match self.subject.position_of(*module) {
                Some(module) => self.modules[module].track.go_on(self.now, self.frame, pose),
                None => return,
            },
            LogEvent::Roster { problem, .. } => {
                let is_planned = *problem == Some(self.subject.problem);
                self.planned.push((self.now, is_planned));
            }
            LogEvent::Gathering(_) | LogEvent::Claim { .. } => {}
        }
        let joined = self.scene.modules().len();
        let changes = self.scene.apply(entry);
        for (spot, holder) in changes.holders {
            let holder = holder.and_then(|module| self.subject.position_of(module));
            if let Some(&spot) = self.spot_of.get(&spot) {
                self.spots[spot].holders.push((self.now, holder));
            }
        }
        self.enter(self.scene.stage());
        if self.begin.is_none() && self.scene.is_moving() {
            self.begin = Some(self.now);
        }
        let all = self.subject.modules.len();
        if joined < all && self.scene.modules().len() == all && all > 1 {
            self.step(format!("All {all} modules have joined"), None);
        }
        for step in changes.steps {
            self.step(step.to_string(), Some(&step));
        }
    }

    fn enter(&mut self, stage: FormationStage) {
        if self.stages.last().is_none_or(|&(_, last)| last != stage) {
            self.stages.push((self.now, stage));
        }
    }

    fn step(&mut self, text: String, step: Option<&SceneChange<'_>>) {
        if self.steps.len() < STEPS_MAX {
            let positions = |modules: Vec<ModuleId>| -> Vec<usize> {
                let positions = modules.into_iter();
                positions
                    .filter_map(|module| self.subject.position_of(module))
                    .collect()
            };
            self.steps.push(FilmStep {
                at: self.now,
                text,
                acting: step.map_or_else(Vec::new, |step| positions(step.acting())),
                evicted: step.map_or_else(Vec::new, |step| positions(step.evicted())),
            });
        }
    }

    /// Shows the pose, the phase and the links of a state that the scene does not have yet.
    fn show_state(&mut self, module: usize, snapshot: &ModuleSnapshot) {
        let was = self.scene.phase_of(snapshot.module);
        let film = &mut self.modules[module];
        film.track
            .stand_or_go(self.now, self.frame, &snapshot.pose, was);
        if was != Some(snapshot.phase) {
            film.phases.push((self.now, snapshot.phase));
        }
        self.links
            .change(self.now, module, snapshot, &self.scene, self.subject);
    }

    fn finish(mut self, end: &str) -> Film {
        self.now = track::time(self.pace.end());
        self.enter(FormationStage::Done);
        self.step(end.to_owned(), None);
        Film {
            length: self.now,
            begin: self.begin.unwrap_or(0.0),
            planned: self.planned,
            side: self.frame.module_side(),
            unit: self.frame.scale(),
            clock: self.pace.clock(),
            stages: self.stages,
            steps: self.steps,
            modules: self.modules,
            spots: self.spots,
            links: self.links.finish(),
        }
    }
}
