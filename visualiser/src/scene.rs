//! What a picture shows: the event log's scene, and what the pictures add to it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_event_log::{ModuleSnapshot, Recorder, Scene, milliseconds};
use formation_model::{ConfigurationId, Message, MicroUnits, ModuleId, Pose, SpotId, Target};

/// The most corners of a trail; the oldest are dropped.
const CORNERS_MAX: usize = 64;
/// A corner that adds no more than this to the length of the trail is left out.
const STRAIGHT: MicroUnits = MicroUnits(20_000);

/// One module as it is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figure<'a> {
    pub snapshot: &'a ModuleSnapshot,
    pub configuration: Option<ConfigurationId>,
    /// The corners of its path, oldest first; it ends where the module stands.
    pub trail: &'a [Pose],
    /// Whether a message of it arrived within the suspicion time.
    pub is_live: bool,
}

/// What the event log does not have of a module.
#[derive(Debug, Default)]
struct Extra {
    configuration: Option<ConfigurationId>,
    trail: Vec<Pose>,
    is_live: bool,
}

/// All that is drawn.
#[derive(Debug)]
pub(crate) struct DrawnScene {
    suspicion: Duration,
    target: Option<Arc<Target>>,
    revision: Option<u64>,
    recorder: Recorder,
    scene: Scene,
    extras: BTreeMap<ModuleId, Extra>,
    changed: bool,
}

impl DrawnScene {
    /// A module that is silent for longer than `suspicion` is not live.
    pub(crate) fn new(suspicion: Duration) -> Self {
        Self {
            suspicion,
            target: None,
            revision: None,
            recorder: Recorder::new(Duration::ZERO),
            scene: Scene::default(),
            extras: BTreeMap::new(),
            changed: false,
        }
    }

    pub(crate) fn target(&self) -> Option<&Arc<Target>> {
        self.target.as_ref()
    }

    /// The frame of all poses; `map` until a target names another.
    pub(crate) fn frame_id(&self) -> &str {
        self.target
            .as_ref()
            .map_or("map", |target| target.frame_id())
    }

    /// All modules, ascending.
    pub(crate) fn figures(&self) -> impl Iterator<Item = (ModuleId, Figure<'_>)> {
        let modules = self.scene.modules().iter();
        modules.filter_map(|(&module, known)| {
            let extra = self.extras.get(&module)?;
            let figure = Figure {
                snapshot: &known.snapshot,
                configuration: extra.configuration,
                trail: &extra.trail,
                is_live: extra.is_live,
            };
            Some((module, figure))
        })
    }

    /// Whether there is anything that the last picture did not show.
    pub(crate) fn has_changed(&self) -> bool {
        self.changed
    }

    pub(crate) fn was_drawn(&mut self) {
        self.changed = false;
    }

    /// Which module holds which spot by the pins and claims of the latest epoch.
    pub(crate) fn holders(&self) -> &BTreeMap<SpotId, ModuleId> {
        self.scene.holders()
    }

    pub(crate) fn handle(&mut self, now: Duration, message: &Message) {
        if let Message::Target(announcement) = message
            && Some(announcement.revision) > self.revision
        {
            self.revision = Some(announcement.revision);
            self.changed |= announcement.target != self.target;
            self.target.clone_from(&announcement.target);
        }
        let run = match message {
            Message::ModuleState(state) => Some((state.module, state.incarnation)),
            Message::Heartbeat(heartbeat) => Some((heartbeat.module, heartbeat.incarnation)),
            _ => None,
        };
        let is_current = |recorder: &Recorder| {
            run.filter(|&(module, incarnation)| recorder.is_current(module, incarnation))
        };
        let was_current = is_current(&self.recorder).is_some();
        for entry in self.recorder.record(now, message) {
            self.scene.apply(&entry);
            self.changed = true;
        }
        if let Some((module, _)) = is_current(&self.recorder) {
            self.scene.note_received(milliseconds(now), module);
            self.note_run(module, message, was_current);
        }
    }

    /// Keeps what the event log does not have. The trail of an earlier run ends.
    fn note_run(&mut self, module: ModuleId, message: &Message, was_current: bool) {
        let extra = self.extras.entry(module).or_default();
        if !was_current {
            extra.trail.clear();
        }
        if let Message::ModuleState(state) = message {
            extra.configuration = state.configuration;
        }
        if let Some(pose) = self.scene.pose_of(module) {
            lengthen(&mut extra.trail, pose);
        }
        self.changed |= !extra.is_live;
        extra.is_live = true;
    }

    /// Advances the time: modules that fell silent are no longer live.
    pub(crate) fn advance(&mut self, now: Duration) {
        let now_ms = milliseconds(now);
        let suspicion_ms = milliseconds(self.suspicion);
        for (module, extra) in &mut self.extras {
            let known = self.scene.modules().get(module);
            let received_ms = known.map(|known| known.received_ms);
            let is_silent = received_ms.is_none_or(|at| now_ms.saturating_sub(at) > suspicion_ms);
            if extra.is_live && is_silent {
                extra.is_live = false;
                self.changed = true;
            }
        }
    }
}

/// Adds a pose to a trail; of a straight path only the ends are kept.
fn lengthen(trail: &mut Vec<Pose>, pose: Pose) {
    if let [.., before, last] = trail.as_slice() {
        let detour = before.distance_to(last).0 + last.distance_to(&pose).0;
        if detour - before.distance_to(&pose).0 <= STRAIGHT.0 {
            trail.pop();
        }
    }
    if trail
        .last()
        .is_none_or(|last| last.distance_to(&pose).0 > 0)
    {
        trail.push(pose);
    }
    if trail.len() > CORNERS_MAX {
        trail.remove(0);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use formation_model::{
        ClosedRoster, Decision, Epoch, EvictionRecord, Heartbeat, Incarnation, ModulePhase,
        ModuleRun, ModuleState, PlannerParameters, Roster, RosterMessage, Scenario, SpotClaim,
        SpotSelection, TargetAnnouncement, Voters,
    };

    use super::*;

    pub(crate) fn pose(x: f64, y: f64) -> Pose {
        Pose::from_units(x, y, 0.0).unwrap()
    }

    pub(crate) fn state(module: u32, sequence: u64, pose: Pose) -> ModuleState {
        let run = ModuleRun {
            module: ModuleId(module),
            incarnation: Incarnation(1),
        };
        ModuleState {
            sequence,
            phase: ModulePhase::Moving,
            links: [ModuleId(module ^ 1)].into(),
            configuration: Some(ConfigurationId(1)),
            ..ModuleState::standing(run, pose)
        }
    }

    fn figure(scene: &DrawnScene, module: u32) -> Figure<'_> {
        let mut figures = scene.figures();
        let found = figures.find(|(id, _)| *id == ModuleId(module));
        found.unwrap().1
    }

    fn epoch(number: u64) -> Epoch {
        Epoch {
            number,
            convener: ModuleId(1),
        }
    }

    fn roster(number: u64) -> Message {
        Message::Roster(RosterMessage::Plan(Arc::new(ClosedRoster::from(Roster {
            timing: formation_model::Timing {
                heartbeat: Duration::from_millis(500),
                suspicion: Duration::from_secs(5),
                lease: Duration::from_millis(2_500),
            },
            epoch: epoch(number),
            target: TargetAnnouncement {
                voters: Vec::new(),
                revision: 1,
                name: String::new(),
                target: None,
                parameters: PlannerParameters::default(),
                expected_modules: None,
            },
            members: Vec::new(),
            voters: Voters::default(),
            bodies: Vec::new(),
        }))))
    }

    fn claim(number: u64, turn: u32, pairs: &[(u32, u32)], evicted: &[u32]) -> Message {
        let evictions = evicted.iter().map(|&module| EvictionRecord {
            evicted: ModuleId(module),
            by: ModuleId(99),
            from: SpotId(1),
            to: None,
        });
        Message::Claim(Arc::new(SpotClaim {
            epoch: epoch(number),
            turn,
            claimant: ModuleId(1),
            incarnation: Incarnation(1),
            decision: Decision {
                selections: pairs
                    .iter()
                    .map(|&(module, spot)| SpotSelection {
                        spot: SpotId(spot),
                        module: ModuleId(module),
                    })
                    .collect(),
                evictions: evictions.collect(),
                ..Decision::default()
            },
        }))
    }

    /// Two docked modules, one of which claims a spot of a pair.
    pub(crate) fn scene() -> DrawnScene {
        let scenario = Scenario::from_yaml(
            "target: {frame_id: hall, spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}
singletons: [{id: 2, x: 0.0, y: 0.0}]",
        )
        .unwrap();
        let mut scene = DrawnScene::new(Duration::from_secs(5));
        let announcement = TargetAnnouncement::new(scenario.problem(), 1);
        scene.handle(Duration::ZERO, &Message::Target(Arc::new(announcement)));
        for (module, x) in [(2, 0.0), (3, 1.0)] {
            let state = state(module, 1, pose(x, 0.0));
            scene.handle(Duration::ZERO, &Message::ModuleState(Arc::new(state)));
        }
        scene.handle(Duration::ZERO, &roster(1));
        scene.handle(Duration::ZERO, &claim(1, 0, &[(2, 1)], &[]));
        scene
    }

    #[test]
    fn the_target_of_the_highest_revision_is_drawn() {
        let mut scene = scene();
        let first = scene.target().cloned();
        let other = "{target: {map: o}, singletons: [{id: 7, x: 3.0, y: 0.0}]}";
        let other = Scenario::from_yaml(other).unwrap();
        let mut announce = |target: &Option<Arc<Target>>, revision| {
            scene.was_drawn();
            let announcement = TargetAnnouncement {
                target: target.clone(),
                ..TargetAnnouncement::new(other.problem(), revision)
            };
            scene.handle(Duration::ZERO, &Message::Target(Arc::new(announcement)));
            (scene.target().cloned(), scene.has_changed())
        };
        let other = Some(Arc::clone(other.problem().target()));
        assert_eq!(announce(&first, 9), (first.clone(), false));
        assert_eq!(announce(&other, 7), (first.clone(), false), "it is older");
        assert_eq!(announce(&other, 9), (first, false), "it contradicts");
        assert_eq!(announce(&other, 10), (other, true));
        assert_eq!(announce(&None, 11), (None, true));
    }

    #[test]
    fn claims_count_in_the_order_of_turns_and_of_the_latest_epoch_alone() {
        let mut scene = scene();
        let claimed = |scene: &DrawnScene| -> Vec<(u32, u32)> {
            let holders = scene.holders().iter();
            let mut claimed: Vec<(u32, u32)> =
                holders.map(|(spot, module)| (module.0, spot.0)).collect();
            claimed.sort_unstable();
            claimed
        };
        scene.handle(Duration::ZERO, &claim(1, 2, &[(4, 1)], &[3]));
        scene.handle(Duration::ZERO, &claim(1, 1, &[(2, 2), (3, 1)], &[2]));
        assert_eq!(claimed(&scene), [(2, 2), (4, 1)]);
        scene.handle(Duration::ZERO, &claim(2, 0, &[(9, 1)], &[]));
        scene.handle(Duration::ZERO, &roster(2));
        scene.handle(Duration::ZERO, &claim(1, 3, &[(5, 2)], &[]));
        assert_eq!(claimed(&scene), [(9, 1)]);
    }

    #[test]
    fn of_a_straight_path_a_trail_keeps_the_ends() {
        let mut trail = Vec::new();
        for step in 0..50 {
            lengthen(&mut trail, pose(f64::from(step) * 0.1, 0.0));
        }
        assert_eq!(trail, [pose(0.0, 0.0), pose(4.9, 0.0)]);
        lengthen(&mut trail, pose(4.9, 1.0));
        lengthen(&mut trail, pose(4.9, 1.0));
        assert_eq!(trail.len(), 3);
        for step in 0..1_000 {
            lengthen(&mut trail, pose(f64::from(step % 2), f64::from(step)));
        }
        assert_eq!(trail.len(), CORNERS_MAX);
        assert_eq!(trail.last(), Some(&pose(1.0, 999.0)));
    }

    #[test]
    fn silence_and_return_of_a_module_change_the_picture() {
        let mut scene = scene();
        scene.was_drawn();
        scene.advance(Duration::from_secs(5));
        assert!(!scene.has_changed());
        scene.advance(Duration::from_secs(6));
        assert!(scene.has_changed());
        assert!(!figure(&scene, 2).is_live);
        scene.was_drawn();
        let beat = Heartbeat {
            sequence: 2,
            phase: ModulePhase::Moving,
            ..Heartbeat::first(ModuleId(2).run(Incarnation(1)))
        };
        scene.handle(Duration::from_secs(7), &Message::Heartbeat(beat));
        assert!(scene.has_changed());
        assert!(figure(&scene, 2).is_live);
    }

    #[test]
    fn an_older_state_changes_nothing() {
        let mut scene = scene();
        let newer = state(2, 5, pose(2.0, 2.0));
        scene.handle(Duration::ZERO, &Message::ModuleState(Arc::new(newer)));
        scene.was_drawn();
        let older = state(2, 4, pose(9.0, 9.0));
        scene.handle(Duration::ZERO, &Message::ModuleState(Arc::new(older)));
        assert!(!scene.has_changed());
        assert_eq!(figure(&scene, 2).snapshot.pose, pose(2.0, 2.0));
    }
}
