//! What is known of a run, and what of it is sent to the pages.

use std::collections::{BTreeSet, VecDeque};
use std::time::{Duration, Instant};

use formation_event_log::{Entry, Scene, SceneModule};
use formation_model::{FormationStage, ModuleId, ModulePhase};
use formation_studio_server::EventHub;
use formation_verify::{Outcome, Progress};
use serde_json::{Value, json};

use crate::run::{RunLine, RunVerdict, progress_line};

/// The modules are sent at most this often.
pub const MODULES_INTERVAL: Duration = Duration::from_millis(100);
/// How many of the last lines a page gets that connects later.
const LOG_MAX: usize = 50;

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Stage {
    Starting,
    Joined,
    Planned,
    Moving,
    Settled,
    Stopped,
}

impl Stage {
    fn name(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::Joined => "joined",
            Self::Planned => "planned",
            Self::Moving => "moving",
            Self::Settled => "settled",
            Self::Stopped => "stopped",
        }
    }
}

/// A run as far as it was reported.
pub struct Course {
    hub: EventHub,
    is_read_only: bool,
    /// The scenario with which the page begins, or that runs.
    scenario: Option<String>,
    stage: Stage,
    text: String,
    place: Option<(u16, u64)>,
    scene: Scene,
    progress: Option<Progress>,
    dead: BTreeSet<ModuleId>,
    verdict: Option<RunVerdict>,
    log: VecDeque<String>,
    /// When the modules were sent, and whether something changed since.
    sent: (Instant, bool),
}

impl Course {
    pub fn new(hub: EventHub, is_read_only: bool, scenario: Option<String>) -> Self {
        Self {
            hub,
            is_read_only,
            scenario,
            stage: Stage::Stopped,
            text: "nothing runs".to_owned(),
            place: None,
            scene: Scene::default(),
            progress: None,
            dead: BTreeSet::new(),
            verdict: None,
            log: VecDeque::new(),
            sent: (Instant::now(), false),
        }
    }

    pub fn is_read_only(&self) -> bool {
        self.is_read_only
    }

    /// Forgets the run before, as another begins.
    pub fn begin(&mut self, scenario: Option<String>, text: &str) {
        let hub = self.hub.clone();
        *self = Self::new(hub, self.is_read_only, scenario);
        self.stage = Stage::Starting;
        text.clone_into(&mut self.text);
        self.send(&self.state());
    }

    /// Notes that another target is to be formed.
    pub fn begin_target(&mut self, scenario: String) {
        self.scenario = Some(scenario);
        self.verdict = None;
        self.set_stage(Stage::Joined, "the next target is announced");
        self.send(&self.state());
    }

    /// The run is over.
    pub fn end(&mut self, text: &str) {
        self.flush(true);
        self.set_stage(Stage::Stopped, text);
    }

    /// Whether there is a run.
    pub fn is_over(&self) -> bool {
        self.stage == Stage::Stopped
    }

    /// Takes in a line of the run.
    pub fn take(&mut self, line: RunLine) {
        match line {
            RunLine::Place { domain, session } => {
                self.place = Some((domain, session));
                self.send(&self.state());
            }
            RunLine::Progress(progress) => self.take_progress(progress),
            RunLine::Entry(entry) => self.take_entry(&entry),
            RunLine::Verdict(verdict) => {
                self.flush(true);
                self.send(&verdict_event(&verdict));
                let text = verdict_text(&verdict);
                if verdict.outcome != Outcome::Failed {
                    self.set_stage(Stage::Settled, &text);
                }
                self.verdict = Some(verdict);
            }
            RunLine::Process { modules, running } => {
                for module in modules {
                    match running {
                        true => self.dead.remove(&module),
                        false => self.dead.insert(module),
                    };
                }
                self.sent.1 = true;
            }
            RunLine::Answer { .. } => {}
        }
        self.flush(false);
    }

    /// Takes in a line for people.
    pub fn log(&mut self, text: String) {
        self.send(&json!({"kind": "log", "text": text}));
        if self.log.len() == LOG_MAX {
            self.log.pop_front();
        }
        self.log.push_back(text);
    }

    /// Sends the modules, if they changed and their time has come.
    pub fn flush(&mut self, at_once: bool) {
        let (at, has_changed) = self.sent;
        if has_changed && (at_once || at.elapsed() >= MODULES_INTERVAL) {
            self.sent = (Instant::now(), false);
            let event = json!({
                "kind": "modules",
                "modules": self.modules(),
                "progress": self.progress,
            });
            self.send(&event);
        }
    }

    /// All that is known, for a page that connects.
    pub fn state(&self) -> Value {
        let (domain, session) = self.place.unzip();
        json!({
            "kind": "state",
            "read_only": self.is_read_only,
            "running": !self.is_over(),
            "stage": self.stage.name(),
            "text": self.text,
            "domain": domain,
            "session": session,
            "progress": self.progress,
            "modules": self.modules(),
            "verdict": self.verdict.as_ref().map(verdict_event),
            "log": self.log,
            "yaml": self.scenario,
        })
    }

    fn send(&self, event: &Value) {
        self.hub.send(&event.to_string());
    }

    fn set_stage(&mut self, stage: Stage, text: &str) {
        if self.stage != stage || self.text != text {
            self.stage = stage;
            text.clone_into(&mut self.text);
            let event = json!({"kind": "stage", "stage": stage.name(), "text": text});
            self.send(&event);
        }
    }

    fn take_progress(&mut self, progress: Progress) {
        let all_joined = progress
            .expected
            .is_none_or(|expected| progress.joined >= expected);
        let stage = match progress.stage {
            FormationStage::WaitingForTarget | FormationStage::Gathering if !all_joined => {
                Stage::Starting
            }
            FormationStage::WaitingForTarget
            | FormationStage::Gathering
            | FormationStage::Planning
            | FormationStage::Agreeing => Stage::Joined,
            FormationStage::Acting if self.scene.is_moving() => Stage::Moving,
            FormationStage::Acting => Stage::Planned,
            FormationStage::Done => Stage::Settled,
        };
        // A verdict on what was formed before says nothing of what is under way. Who begins to watch when all is done knows the verdict
        // before the rest.
        let begins_anew = self.progress.as_ref().is_some_and(|before| {
            let is_later = before.epoch.is_some() && before.epoch != progress.epoch;
            is_later || before.stage == FormationStage::Done
        });
        if stage < Stage::Settled && begins_anew && self.verdict.take().is_some() {
            self.send(&json!({"kind": "verdict", "outcome": null}));
        }
        let text = progress_line(&progress);
        self.progress = Some(progress);
        self.sent.1 = true;
        self.set_stage(stage, &text);
    }

    fn take_entry(&mut self, entry: &Entry) {
        let steps = self.scene.apply(entry).steps;
        let steps: Vec<String> = steps.iter().map(ToString::to_string).collect();
        self.sent.1 = true;
        for step in steps {
            self.log(step);
        }
        if self.stage == Stage::Planned && self.scene.is_moving() {
            let text = self.text.clone();
            self.set_stage(Stage::Moving, &text);
        }
    }

    fn modules(&self) -> Vec<Value> {
        let modules = self.scene.modules().iter();
        modules.map(|(&id, known)| self.module(id, known)).collect()
    }

    fn module(&self, id: ModuleId, known: &SceneModule) -> Value {
        let snapshot = &known.snapshot;
        let pose = snapshot.pose;
        let is_dead = self.dead.contains(&id);
        let (waits_for, why) = match is_dead {
            true => (Vec::new(), "its process has ended"),
            false if !snapshot.in_service => (Vec::new(), "is out of service"),
            false => self.wait(id, snapshot.phase),
        };
        json!({
            "id": id,
            "x": pose.x.to_units(),
            "y": pose.y.to_units(),
            "theta": pose.theta.to_units(),
            "phase": snapshot.phase,
            "spot": snapshot.spot,
            "links": snapshot.links,
            "process": if is_dead { "dead" } else { "running" },
            "in_service": snapshot.in_service,
            "waits_for": waits_for,
            "why": why,
        })
    }

    /// For whom a module waits, and for what.
    fn wait(&self, id: ModuleId, phase: ModulePhase) -> (Vec<ModuleId>, &'static str) {
        let awaited = self.progress.iter().flat_map(|known| &known.waiting_for);
        let awaited = awaited.copied().filter(|&other| other != id).collect();
        match phase {
            ModulePhase::Listening => (Vec::new(), "started, and listens before it takes part"),
            ModulePhase::Gathered => (awaited, "until all members have gathered"),
            ModulePhase::Computing => (Vec::new(), "computes the plan"),
            ModulePhase::Planning => (awaited, "until all turns are taken"),
            ModulePhase::Agreeing => (awaited, "until all members hold the same plan"),
            ModulePhase::Waiting => (
                self.moving_except(id),
                "until those before it by the plan have made room",
            ),
            ModulePhase::WaitingForQuorum => (
                self.dead.iter().copied().collect(),
                "until it hears a majority of the voters",
            ),
            ModulePhase::Moving => (Vec::new(), "moves"),
            ModulePhase::Settled => (Vec::new(), "stands on its spot"),
            ModulePhase::Spare => (Vec::new(), "has no spot in this plan"),
        }
    }

    fn moving_except(&self, id: ModuleId) -> Vec<ModuleId> {
        let modules = self.scene.modules().iter();
        let moving = modules.filter(|(_, known)| known.snapshot.phase == ModulePhase::Moving);
        let others = moving.map(|(&other, _)| other).filter(|&other| other != id);
        others.collect()
    }
}

fn verdict_event(verdict: &RunVerdict) -> Value {
    json!({
        "kind": "verdict",
        "outcome": verdict.outcome,
        "filled_spots": verdict.filled_spots,
        "spots": verdict.spots,
        "open_spots": verdict.open_spots,
        "violations": verdict.violations,
        "collision_free": verdict.collision_free,
        "text": verdict_text(verdict),
    })
}

fn verdict_text(verdict: &RunVerdict) -> String {
    let (filled, spots) = (verdict.filled_spots, verdict.spots);
    match verdict.outcome {
        Outcome::Complete => format!("COMPLETE: all {spots} spots are filled"),
        Outcome::Partial => format!("PARTIAL: {filled} of {spots} spots are filled"),
        Outcome::NotJudged => format!(
            "NOT_JUDGED: {filled} of {spots} spots are filled; poses are not exact enough to tell whether bodies touched"
        ),
        Outcome::Failed => format!("FAILED: {filled} of {spots} spots are filled"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(phase: &str, epoch: u64) -> RunLine {
        let line = json!({"progress": {
            "phase": phase, "epoch": {"number": epoch, "convener": 1}, "joined": 2, "expected": 2, "planned": 2,
            "agreed": 2, "settled": 2, "to_fill": 2, "waiting_for": [],
        }});
        serde_json::from_value(line).unwrap()
    }

    fn verdict() -> RunLine {
        let line = json!({"verdict": {
            "outcome": "COMPLETE", "filled_spots": 2, "spots": 2, "open_spots": [], "violations": [],
            "collision_free": true,
        }});
        serde_json::from_value(line).unwrap()
    }

    #[test]
    fn a_verdict_that_is_known_before_the_rest_stays_until_another_epoch_begins() {
        let mut course = Course::new(EventHub::default(), true, None);
        let lines = [verdict(), progress("agreeing", 1), progress("done", 1)];
        lines.into_iter().for_each(|line| course.take(line));
        assert!(course.verdict.is_some());
        course.take(progress("gathering", 2));
        assert!(course.verdict.is_none());
        let lines = [progress("agreeing", 2), verdict(), progress("acting", 3)];
        lines.into_iter().for_each(|line| course.take(line));
        assert!(course.verdict.is_none());
    }
}
