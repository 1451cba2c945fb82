//! What a picture shows: the latest word of everyone, and the way that each module came.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    Epoch, Incarnation, Message, MicroUnits, ModuleId, ModuleState, Pose, SpotClaim, SpotId, Target,
};

/// A trail keeps so many corners; the oldest go.
const CORNERS_MAX: usize = 64;
/// A corner that lies so near the line between its neighbours is none.
const STRAIGHT: MicroUnits = MicroUnits(20_000);

/// One module as it is drawn.
#[derive(Debug)]
pub(super) struct Figure {
    pub state: Arc<ModuleState>,
    /// Where it came along, oldest first; it ends where the module stands.
    pub trail: Vec<Pose>,
    /// When it was last heard.
    heard: Duration,
    /// Whether it was heard lately.
    pub is_live: bool,
}

/// All that is drawn.
#[derive(Debug)]
pub(super) struct Scene {
    suspicion: Duration,
    target: Option<Arc<Target>>,
    revision: u64,
    figures: BTreeMap<ModuleId, Figure>,
    /// The claims of the latest epoch, by turn.
    claims: BTreeMap<u32, Arc<SpotClaim>>,
    claims_of: Option<Epoch>,
    changed: bool,
}

impl Scene {
    /// A module that was not heard for `suspicion` is no longer live.
    pub(super) fn new(suspicion: Duration) -> Self {
        Self {
            suspicion,
            target: None,
            revision: 0,
            figures: BTreeMap::new(),
            claims: BTreeMap::new(),
            claims_of: None,
            changed: false,
        }
    }

    pub(super) fn target(&self) -> Option<&Arc<Target>> {
        self.target.as_ref()
    }

    /// The frame of all poses; `map` until a target says otherwise.
    pub(super) fn frame_id(&self) -> &str {
        self.target
            .as_ref()
            .map_or("map", |target| target.frame_id())
    }

    pub(super) fn figures(&self) -> &BTreeMap<ModuleId, Figure> {
        &self.figures
    }

    /// Whether there is anything that the last picture did not show.
    pub(super) fn has_changed(&self) -> bool {
        self.changed
    }

    pub(super) fn was_drawn(&mut self) {
        self.changed = false;
    }

    /// Who claims which spot, after all claims of the latest epoch that were heard, whatever their order.
    pub(super) fn claimed(&self) -> BTreeMap<ModuleId, SpotId> {
        let mut claimed = BTreeMap::new();
        for claim in self.claims.values() {
            for eviction in &claim.decision.evictions {
                claimed.remove(&eviction.evicted);
            }
            for selection in &claim.decision.selections {
                claimed.insert(selection.module, selection.spot);
            }
        }
        claimed
    }

    pub(super) fn hear(&mut self, now: Duration, message: Message) {
        match message {
            Message::Target(announcement) => {
                if announcement.revision >= self.revision && announcement.target != self.target {
                    self.revision = announcement.revision;
                    self.target.clone_from(&announcement.target);
                    self.changed = true;
                }
            }
            Message::ModuleState(state) => self.hear_state(now, state),
            Message::Claim(claim) => {
                if Some(claim.epoch) > self.claims_of {
                    self.claims_of = Some(claim.epoch);
                    self.claims.clear();
                }
                if Some(claim.epoch) == self.claims_of {
                    self.claims.insert(claim.turn, claim);
                    self.changed = true;
                }
            }
            Message::Heartbeat(heartbeat) => {
                self.note_alive(now, heartbeat.module, heartbeat.incarnation);
            }
            Message::Roster(_) | Message::Eviction(_) => {}
        }
    }

    fn hear_state(&mut self, now: Duration, state: Arc<ModuleState>) {
        let figure = self.figures.entry(state.module).or_insert_with(|| Figure {
            state: Arc::clone(&state),
            trail: vec![state.pose],
            heard: now,
            is_live: true,
        });
        let run = |state: &ModuleState| (state.incarnation, state.sequence);
        if run(&state) < run(&figure.state) {
            return;
        }
        if state.incarnation != figure.state.incarnation {
            figure.trail.clear();
        }
        lengthen(&mut figure.trail, state.pose);
        figure.state = state;
        figure.heard = now;
        figure.is_live = true;
        self.changed = true;
    }

    fn note_alive(&mut self, now: Duration, module: ModuleId, incarnation: Incarnation) {
        if let Some(figure) = self.figures.get_mut(&module)
            && figure.state.incarnation == incarnation
        {
            figure.heard = now;
            self.changed |= !figure.is_live;
            figure.is_live = true;
        }
    }

    /// Lets time pass: modules that fell silent are no longer live.
    pub(super) fn advance(&mut self, now: Duration) {
        for figure in self.figures.values_mut() {
            if figure.is_live && now.saturating_sub(figure.heard) > self.suspicion {
                figure.is_live = false;
                self.changed = true;
            }
        }
    }
}

/// Adds a pose to a trail; of a straight way only the ends are kept.
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
pub(super) mod tests {
    use formation::model::{
        ConfigurationId, Decision, EvictionRecord, Heartbeat, ModulePhase, Scenario, Service,
        SpotSelection, TargetAnnouncement,
    };

    use super::*;

    pub(in crate::visualisation) fn pose(x: f64, y: f64) -> Pose {
        Pose::from_units(x, y, 0.0).unwrap()
    }

    pub(in crate::visualisation) fn state(module: u32, sequence: u64, pose: Pose) -> ModuleState {
        ModuleState {
            module: ModuleId(module),
            incarnation: Incarnation(1),
            sequence,
            epoch: None,
            digest: None,
            phase: ModulePhase::Moving,
            service: Service::Active,
            pose,
            links: [ModuleId(module ^ 1)].into(),
            configuration: Some(ConfigurationId(1)),
            leader: None,
            spot: None,
            unit: None,
            settled_since: 0,
            waited_for: Vec::new(),
            agreed_on: Vec::new(),
            quorum_bases: Vec::new(),
        }
    }

    fn claim(number: u64, turn: u32, pairs: &[(u32, u32)], evicted: &[u32]) -> Message {
        let evictions = evicted.iter().map(|&module| EvictionRecord {
            evicted: ModuleId(module),
            by: ModuleId(99),
            from: SpotId(1),
            to: None,
        });
        Message::Claim(Arc::new(SpotClaim {
            epoch: Epoch {
                number,
                convener: ModuleId(1),
            },
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
                detached: Vec::new(),
            },
        }))
    }

    /// Two docked modules, one of which claims a spot of a pair.
    pub(in crate::visualisation) fn scene() -> Scene {
        let scenario = Scenario::from_yaml(
            "target: {frame_id: hall, spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}
singletons: [{id: 2, x: 0.0, y: 0.0}]",
        )
        .unwrap();
        let mut scene = Scene::new(Duration::from_secs(5));
        let announcement = TargetAnnouncement {
            revision: 1,
            name: String::new(),
            target: Some(Arc::clone(scenario.problem().target())),
            parameters: *scenario.problem().parameters(),
            expected_modules: None,
        };
        scene.hear(Duration::ZERO, Message::Target(Arc::new(announcement)));
        for (module, x) in [(2, 0.0), (3, 1.0)] {
            let state = state(module, 1, pose(x, 0.0));
            scene.hear(Duration::ZERO, Message::ModuleState(Arc::new(state)));
        }
        scene.hear(Duration::ZERO, claim(1, 0, &[(2, 1)], &[]));
        scene
    }

    #[test]
    fn claims_count_in_the_order_of_turns_and_of_the_latest_epoch_alone() {
        let mut scene = scene();
        let claimed = |scene: &Scene| -> Vec<(u32, u32)> {
            let claimed = scene.claimed().into_iter();
            claimed.map(|(module, spot)| (module.0, spot.0)).collect()
        };
        scene.hear(Duration::ZERO, claim(1, 2, &[(4, 1)], &[3]));
        scene.hear(Duration::ZERO, claim(1, 1, &[(2, 2), (3, 1)], &[2]));
        assert_eq!(claimed(&scene), [(2, 2), (4, 1)]);
        scene.hear(Duration::ZERO, claim(2, 0, &[(9, 1)], &[]));
        scene.hear(Duration::ZERO, claim(1, 3, &[(5, 2)], &[]));
        assert_eq!(claimed(&scene), [(9, 1)]);
    }

    #[test]
    fn of_a_straight_way_a_trail_keeps_the_ends() {
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
    fn a_module_that_falls_silent_is_drawn_anew_and_its_return_too() {
        let mut scene = scene();
        scene.was_drawn();
        scene.advance(Duration::from_secs(5));
        assert!(!scene.has_changed());
        scene.advance(Duration::from_secs(6));
        assert!(scene.has_changed());
        assert!(!scene.figures()[&ModuleId(2)].is_live);
        scene.was_drawn();
        let beat = Heartbeat {
            module: ModuleId(2),
            incarnation: Incarnation(1),
            sequence: 2,
            uptime: Duration::ZERO,
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            phase: ModulePhase::Moving,
        };
        scene.hear(Duration::from_secs(7), Message::Heartbeat(beat));
        assert!(scene.has_changed());
        assert!(scene.figures()[&ModuleId(2)].is_live);
    }

    #[test]
    fn an_older_state_changes_nothing() {
        let mut scene = scene();
        let newer = state(2, 5, pose(2.0, 2.0));
        scene.hear(Duration::ZERO, Message::ModuleState(Arc::new(newer)));
        scene.was_drawn();
        let older = state(2, 4, pose(9.0, 9.0));
        scene.hear(Duration::ZERO, Message::ModuleState(Arc::new(older)));
        assert!(!scene.has_changed());
        assert_eq!(scene.figures()[&ModuleId(2)].state.pose, pose(2.0, 2.0));
    }
}
