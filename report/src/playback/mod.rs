//! What the page's player needs: where everything is at any moment of the film.
//!
//! The film is not in real time. Turns take microseconds and motions take minutes, so turns are stretched, motions
//! shortened where they would take too long, and waits in which nothing can be seen cut; the clock beside the film
//! shows the recorded time.

mod links;
mod pace;
mod sentences;
mod track;

use std::collections::{BTreeMap, BTreeSet};

use formation::event_log::{Entry, Event, Told};
use formation::model::{Decision, ModuleId, ModulePhase, SpotId};
use serde::Serialize;

use crate::frame::Frame;
use crate::pictures::counted;
use crate::subject::Subject;
use links::Links;
use pace::Pace;
use sentences::{begins_again, claim, sets_off, settled};
use track::Track;

/// Keyframes of all modules together, about; more would show nothing more and make the page large.
const KEYFRAMES_MAX: usize = 40_000;
/// Keyframes of one module at least, so that the last ones are always among them.
const KEYFRAMES_MIN: usize = 16;
/// Steps of the film; those beyond are left out, the last ones first.
const STEPS_MAX: usize = 30_000;

/// A film: times are seconds from its beginning, places are pixels on the ground.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Film {
    /// How long it is.
    length: f64,
    /// The side of a module's square.
    side: f64,
    /// The recorded milliseconds at some times; straight between them.
    clock: Vec<(f64, u64)>,
    /// Which part of the work begins when.
    stages: Vec<(f64, &'static str)>,
    /// What happens, one sentence each.
    steps: Vec<Step>,
    modules: Vec<ModuleFilm>,
    spots: Vec<SpotFilm>,
    /// From when until when two modules are docked, and what sort of link that is.
    links: Vec<links::Span>,
}

#[derive(Clone, Debug, Serialize)]
struct Step {
    at: f64,
    text: String,
    /// The modules that are meant, and those that lose their spot.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    acting: Vec<usize>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    evicted: Vec<usize>,
}

#[derive(Clone, Debug, Serialize)]
struct ModuleFilm {
    id: u32,
    /// (time, x, y, turn) where its way bends or its pace changes.
    track: Vec<track::Keyframe>,
    /// What it is doing from when on.
    phases: Vec<(f64, ModulePhase)>,
}

#[derive(Clone, Debug, Serialize)]
struct SpotFilm {
    id: u32,
    x: f64,
    y: f64,
    /// Who holds it by the claims from when on; `None` when it is free.
    holders: Vec<(f64, Option<usize>)>,
}

impl Film {
    /// Makes a film of a course. `end` is its last sentence.
    pub(crate) fn of(subject: &Subject, course: &[Entry], frame: &Frame, end: &str) -> Self {
        let mut cutting = Cutting::new(subject, course, frame);
        for entry in course {
            cutting.take(entry);
        }
        cutting.finish(end)
    }

    /// How many steps it has.
    pub(crate) fn step_count(&self) -> usize {
        self.steps.len()
    }
}

/// A film that is being made.
struct Cutting<'a> {
    subject: &'a Subject,
    frame: &'a Frame,
    pace: Pace,
    now: f64,
    stages: Vec<(f64, &'static str)>,
    steps: Vec<Step>,
    told: Vec<Option<Told>>,
    tracks: Vec<Track>,
    phases: Vec<Vec<(f64, ModulePhase)>>,
    spot_of: BTreeMap<SpotId, usize>,
    holders: Vec<Vec<(f64, Option<usize>)>>,
    /// The spots of placed modules by the claims so far.
    held: BTreeMap<usize, usize>,
    links: Links,
    joined: usize,
    moving: usize,
    agreed: bool,
    /// The acting units that have set off, and those that have settled whole.
    set_off: BTreeSet<ModuleId>,
    arrived: BTreeSet<ModuleId>,
}

impl<'a> Cutting<'a> {
    fn new(subject: &'a Subject, course: &[Entry], frame: &'a Frame) -> Self {
        let count = subject.modules.len();
        let keyframes_max = (KEYFRAMES_MAX / count.max(1)).max(KEYFRAMES_MIN);
        Self {
            subject,
            frame,
            pace: Pace::of(course),
            now: 0.0,
            stages: vec![(0.0, "gathering")],
            steps: Vec::new(),
            told: vec![None; count],
            tracks: subject
                .modules
                .iter()
                .map(|module| Track::new(frame, &module.start, keyframes_max))
                .collect(),
            phases: vec![Vec::new(); count],
            spot_of: subject
                .spots
                .iter()
                .enumerate()
                .map(|(position, spot)| (spot.id, position))
                .collect(),
            holders: vec![Vec::new(); subject.spots.len()],
            held: BTreeMap::new(),
            links: Links::new(subject),
            joined: 0,
            moving: 0,
            agreed: false,
            set_off: BTreeSet::new(),
            arrived: BTreeSet::new(),
        }
    }

    fn take(&mut self, entry: &Entry) {
        self.now = track::time(self.pace.advance(entry, self.moving > 0));
        match &entry.event {
            Event::Gathering(epoch) => {
                self.release_all();
                self.stage("gathering");
                if epoch.number > 1 {
                    self.step(format!(
                        "Epoch {}: all modules halt and gather anew",
                        epoch.number
                    ));
                }
            }
            Event::Roster { modules, .. } => {
                self.release_all();
                self.stage("planning");
                self.step(format!(
                    "The roster is fixed: {} {} part",
                    counted(modules.len(), "module"),
                    if modules.len() == 1 { "takes" } else { "take" }
                ));
                self.hold_pinned(modules);
            }
            Event::Claim {
                turn,
                claimant,
                decision,
                ..
            } => self.take_claim(*turn, *claimant, decision),
            Event::State(told) => self.take_state(told),
            Event::Pose { module, pose } => {
                if let Some(module) = self.subject.position_of(*module) {
                    self.tracks[module].go_on(self.now, self.frame, pose);
                }
            }
        }
    }

    fn stage(&mut self, stage: &'static str) {
        if self.stages.last().is_none_or(|&(_, last)| last != stage) {
            self.stages.push((self.now, stage));
        }
    }

    fn step(&mut self, text: String) {
        self.step_of(text, Vec::new(), Vec::new());
    }

    fn step_of(&mut self, text: String, acting: Vec<usize>, evicted: Vec<usize>) {
        if self.steps.len() < STEPS_MAX {
            self.steps.push(Step {
                at: self.now,
                text,
                acting,
                evicted,
            });
        }
    }

    /// A new epoch: nobody holds a spot any more.
    fn release_all(&mut self) {
        for spot in std::mem::take(&mut self.held).into_values() {
            self.holders[spot].push((self.now, None));
        }
        self.agreed = false;
        self.set_off.clear();
        self.arrived.clear();
    }

    /// Modules that have settled before keep their spots in the new epoch.
    fn hold_pinned(&mut self, members: &[ModuleId]) {
        for member in members {
            let Some(module) = self.subject.position_of(*member) else {
                continue;
            };
            let pin = self.told[module]
                .as_ref()
                .filter(|told| told.phase == ModulePhase::Gathered)
                .and_then(|told| told.spot);
            if let Some(&spot) = pin.and_then(|pin| self.spot_of.get(&pin)) {
                self.held.insert(module, spot);
                self.holders[spot].push((self.now, Some(module)));
            }
        }
    }

    fn take_claim(&mut self, turn: u32, claimant: ModuleId, decision: &Decision) {
        self.stage("planning");
        let position = |module: ModuleId| self.subject.position_of(module);
        let evicted: Vec<usize> = decision
            .evictions
            .iter()
            .filter_map(|eviction| position(eviction.evicted))
            .collect();
        let selected: Vec<(usize, usize)> = decision
            .selections
            .iter()
            .filter_map(|pair| Some((position(pair.module)?, *self.spot_of.get(&pair.spot)?)))
            .collect();
        let mut acting: Vec<usize> = selected
            .iter()
            .map(|&(module, _)| module)
            .filter(|module| !evicted.contains(module))
            .collect();
        acting.extend(position(claimant).filter(|module| !acting.contains(module)));
        let leaving: Vec<usize> = selected
            .iter()
            .map(|&(module, _)| module)
            .chain(evicted.iter().copied())
            .collect();
        let mut freed: BTreeSet<usize> = leaving
            .iter()
            .filter_map(|module| self.held.remove(module))
            .collect();
        for (module, spot) in selected {
            self.held.insert(module, spot);
            self.holders[spot].push((self.now, Some(module)));
            freed.remove(&spot);
        }
        for spot in freed {
            self.holders[spot].push((self.now, None));
        }
        self.step_of(claim(turn, claimant, decision), acting, evicted);
    }

    fn take_state(&mut self, told: &Told) {
        let Some(module) = self.subject.position_of(told.module) else {
            return;
        };
        let before = self.told[module].replace(told.clone());
        let was = before.as_ref().map(|before| before.phase);
        self.tracks[module].stand_or_go(self.now, self.frame, &told.pose, was);
        if was != Some(told.phase) {
            self.phases[module].push((self.now, told.phase));
        }
        if let Some(before) = before {
            self.links
                .leave(self.now, module, &before.links, told, self.subject);
        }
        self.links
            .meet(self.now, module, told, &self.told, self.subject);
        match was {
            None => {
                self.joined += 1;
                if self.joined == self.subject.modules.len() && self.joined > 1 {
                    self.step(format!("All {} modules have joined", self.joined));
                }
            }
            Some(was) if was != ModulePhase::Listening && told.phase == ModulePhase::Listening => {
                self.step_of(begins_again(told.module), vec![module], Vec::new());
            }
            Some(_) => {}
        }
        let was_moving = was == Some(ModulePhase::Moving);
        let is_moving = told.phase == ModulePhase::Moving;
        self.moving = self.moving + usize::from(is_moving) - usize::from(was_moving);
        let is_acting = matches!(
            told.phase,
            ModulePhase::Waiting | ModulePhase::Moving | ModulePhase::Spare
        ) || (told.phase == ModulePhase::Settled && told.unit.is_some());
        if is_acting && !self.agreed && !self.held.is_empty() {
            self.agreed = true;
            self.stage("acting");
            self.step("All modules hold the same plan; they may move now".to_owned());
        }
        if is_moving && !was_moving {
            self.set_off(told);
        }
        if told.phase == ModulePhase::Settled && was.is_some_and(|was| was != told.phase) {
            self.settle(told);
        }
    }

    /// The modules that move with this one, itself included.
    fn unit_of(&self, told: &Told) -> Vec<usize> {
        let lead = told.unit.unwrap_or(told.module);
        let together = |other: &Option<Told>| {
            other
                .as_ref()
                .is_some_and(|other| other.module == told.module || other.unit == Some(lead))
        };
        (0..self.told.len())
            .filter(|&module| together(&self.told[module]))
            .collect()
    }

    fn set_off(&mut self, told: &Told) {
        if self.set_off.insert(told.unit.unwrap_or(told.module)) {
            let unit = self.unit_of(told);
            let text = sets_off(&self.ids(&unit), told.spot);
            self.step_of(text, unit, Vec::new());
        }
    }

    fn settle(&mut self, told: &Told) {
        let lead = told.unit.unwrap_or(told.module);
        // A module that stood on its spot from the start has nothing to tell.
        if !self.set_off.contains(&lead) {
            return;
        }
        let unit = self.unit_of(told);
        let is_whole = unit.iter().all(|&module| {
            self.told[module]
                .as_ref()
                .is_some_and(|told| told.phase == ModulePhase::Settled)
        });
        if is_whole && self.arrived.insert(lead) {
            let text = settled(&self.ids(&unit), told.spot);
            self.step_of(text, unit, Vec::new());
        }
    }

    fn ids(&self, modules: &[usize]) -> Vec<u32> {
        modules
            .iter()
            .map(|&module| self.subject.modules[module].id.0)
            .collect()
    }

    fn finish(mut self, end: &str) -> Film {
        self.now = track::time(self.pace.end());
        self.stages.push((self.now, "done"));
        self.step(end.to_owned());
        let frame = self.frame;
        Film {
            length: self.now,
            side: frame.module_side(),
            clock: self.pace.clock(),
            stages: self.stages,
            steps: self.steps,
            modules: self
                .subject
                .modules
                .iter()
                .zip(self.tracks)
                .zip(self.phases)
                .map(|((module, track), phases)| ModuleFilm {
                    id: module.id.0,
                    track: track.keyframes(),
                    phases,
                })
                .collect(),
            spots: self
                .subject
                .spots
                .iter()
                .zip(self.holders)
                .map(|(spot, holders)| SpotFilm {
                    id: spot.id.0,
                    x: track::pixel(frame.x(&spot.pose)),
                    y: track::pixel(frame.y(&spot.pose)),
                    holders,
                })
                .collect(),
            links: self.links.finish(),
        }
    }
}
