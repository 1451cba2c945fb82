//! The state of a formation after the entries so far; every viewer draws from it.

use std::collections::{BTreeMap, BTreeSet};

use super::{Entry, LogEvent, ModuleSnapshot, SceneChange};
use formation_model::{
    Decision, Epoch, FormationStage, ModuleId, ModulePhase, Pose, SpotId, SpotSelection,
};

/// A formation at one moment, as far as entries describe it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    epoch: Option<Epoch>,
    stage: FormationStage,
    modules: BTreeMap<ModuleId, SceneModule>,
    /// The module of each spot that is pinned or claimed in the epoch, and the other way round.
    holders: BTreeMap<SpotId, ModuleId>,
    spots: BTreeMap<ModuleId, SpotId>,
    decisions: Vec<(ModuleId, Decision)>,
    is_fresh_start: bool,
    moving: BTreeSet<ModuleId>,
    /// The leads of the acting units that set off in the epoch, and of those that settled as a whole.
    departed: BTreeSet<ModuleId>,
    arrived: BTreeSet<ModuleId>,
}

/// A module in a scene.
#[derive(Clone, Debug)]
pub struct SceneModule {
    /// Its latest report.
    pub snapshot: ModuleSnapshot,
    /// When its latest message arrived, in milliseconds since the observation began.
    pub received_ms: u64,
}

/// What one entry changed.
#[derive(Debug, Default)]
pub struct AppliedEntry<'a> {
    /// The spots that another module holds now, or none.
    pub holders: Vec<(SpotId, Option<ModuleId>)>,
    /// What people read of it, in order.
    pub steps: Vec<SceneChange<'a>>,
}

impl Scene {
    /// Takes in the next entry.
    pub fn apply<'a>(&mut self, entry: &'a Entry) -> AppliedEntry<'a> {
        let mut changes = AppliedEntry::default();
        match &entry.event {
            LogEvent::Gathering(epoch) => {
                self.begin(*epoch, &mut changes);
                if epoch.number > 1 {
                    changes.steps.push(SceneChange::Regathering(*epoch));
                }
            }
            LogEvent::Roster { epoch, modules, .. } => {
                self.begin(*epoch, &mut changes);
                self.stage = FormationStage::Planning;
                let members = modules.len();
                changes.steps.push(SceneChange::RosterFixed { members });
                self.hold_pins(modules, &mut changes);
            }
            LogEvent::Claim {
                turn,
                claimant,
                decision,
                ..
            } => {
                // The last claims may arrive after the first motion.
                self.stage = self.stage.max(FormationStage::Planning);
                self.apply_decision(decision, &mut changes);
                self.decisions.push((*claimant, decision.clone()));
                changes.steps.push(SceneChange::Turn {
                    turn: *turn,
                    claimant: *claimant,
                    decision,
                });
            }
            LogEvent::State(snapshot) => self.apply_state(entry.at_ms, snapshot, &mut changes),
            LogEvent::Pose { module, pose } => {
                if let Some(known) = self.modules.get_mut(module) {
                    known.snapshot.pose = *pose;
                    known.received_ms = entry.at_ms;
                }
            }
        }
        changes
    }

    /// Notes that a message of a module arrived that is no entry, such as a heartbeat.
    pub fn note_received(&mut self, at_ms: u64, module: ModuleId) {
        if let Some(known) = self.modules.get_mut(&module) {
            known.received_ms = at_ms;
        }
    }

    /// The newest epoch; `None` before the first.
    #[must_use]
    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch
    }

    /// Which part of the work the entries show.
    #[must_use]
    pub fn stage(&self) -> FormationStage {
        self.stage
    }

    /// The modules that reported a state.
    #[must_use]
    pub fn modules(&self) -> &BTreeMap<ModuleId, SceneModule> {
        &self.modules
    }

    /// The latest report of a module.
    #[must_use]
    pub fn snapshot(&self, module: ModuleId) -> Option<&ModuleSnapshot> {
        self.modules.get(&module).map(|known| &known.snapshot)
    }

    /// The phase of a module.
    #[must_use]
    pub fn phase_of(&self, module: ModuleId) -> Option<ModulePhase> {
        self.snapshot(module).map(|snapshot| snapshot.phase)
    }

    /// The pose of a module.
    #[must_use]
    pub fn pose_of(&self, module: ModuleId) -> Option<Pose> {
        self.snapshot(module).map(|snapshot| snapshot.pose)
    }

    /// Which module holds which spot in the epoch, by pins and claims.
    #[must_use]
    pub fn holders(&self) -> &BTreeMap<SpotId, ModuleId> {
        &self.holders
    }

    /// The decisions of the epoch so far, in the order of turns, each with its claimant.
    #[must_use]
    pub fn decisions(&self) -> &[(ModuleId, Decision)] {
        &self.decisions
    }

    /// Whether no module stood on a spot when the epoch began.
    #[must_use]
    pub fn is_fresh_start(&self) -> bool {
        self.is_fresh_start
    }

    /// Whether any module moves.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        !self.moving.is_empty()
    }

    /// Clears what the epoch before decided.
    fn begin(&mut self, epoch: Epoch, changes: &mut AppliedEntry<'_>) {
        self.stage = FormationStage::Gathering;
        if self.epoch == Some(epoch) {
            return;
        }
        self.epoch = Some(epoch);
        let held = std::mem::take(&mut self.holders);
        changes.holders = held.into_keys().map(|spot| (spot, None)).collect();
        self.spots.clear();
        self.decisions.clear();
        self.departed.clear();
        self.arrived.clear();
        let mut phases = self.modules.values().map(|known| known.snapshot.phase);
        self.is_fresh_start = phases.all(|phase| phase != ModulePhase::Settled);
    }

    /// Members that settled before the epoch keep their spots.
    fn hold_pins(&mut self, members: &[ModuleId], changes: &mut AppliedEntry<'_>) {
        for &module in members {
            let pin = self.snapshot(module).and_then(|snapshot| {
                let is_frozen =
                    matches!(snapshot.phase, ModulePhase::Gathered | ModulePhase::Settled);
                snapshot.spot.filter(|_| is_frozen)
            });
            if let Some(spot) = pin {
                self.is_fresh_start = false;
                self.hold(SpotSelection { spot, module }, changes);
            }
        }
    }

    fn hold(&mut self, taken: SpotSelection, changes: &mut AppliedEntry<'_>) {
        let SpotSelection { spot, module } = taken;
        self.spots.insert(module, spot);
        if let Some(former) = self
            .holders
            .insert(spot, module)
            .filter(|&one| one != module)
        {
            self.spots.remove(&former);
        }
        changes.holders.push((spot, Some(module)));
    }

    fn apply_decision(&mut self, decision: &Decision, changes: &mut AppliedEntry<'_>) {
        let evicted = decision.evictions.iter().map(|eviction| eviction.evicted);
        let selecting = decision.selections.iter().map(|pair| pair.module);
        for module in selecting.chain(evicted) {
            if let Some(spot) = self.spots.remove(&module) {
                self.holders.remove(&spot);
                let is_taken = decision.selections.iter().any(|pair| pair.spot == spot);
                if !is_taken {
                    changes.holders.push((spot, None));
                }
            }
        }
        for &pair in &decision.selections {
            self.hold(pair, changes);
        }
        for pair in &decision.swaps {
            if let Some(former) = self.holders.remove(&pair.spot) {
                self.spots.remove(&former);
            }
        }
        for &pair in &decision.swaps {
            self.hold(pair, changes);
        }
    }

    fn apply_state(
        &mut self,
        at_ms: u64,
        snapshot: &ModuleSnapshot,
        changes: &mut AppliedEntry<'_>,
    ) {
        use ModulePhase::{Listening, Moving, Settled, Spare, Waiting};
        let module = snapshot.module;
        let known = SceneModule {
            snapshot: snapshot.clone(),
            received_ms: at_ms,
        };
        let before = self.modules.insert(module, known);
        let was = before.map(|before| before.snapshot.phase);
        let is = snapshot.phase;
        if is == Moving {
            self.moving.insert(module);
        } else {
            self.moving.remove(&module);
        }
        if is == Listening && was.is_some_and(|was| was != Listening) {
            changes.steps.push(SceneChange::Restarted(module));
        }
        let acts =
            matches!(is, Waiting | Moving | Spare) || is == Settled && snapshot.unit.is_some();
        if acts && self.stage < FormationStage::Acting && !self.holders.is_empty() {
            self.stage = FormationStage::Acting;
            changes.steps.push(SceneChange::Agreed);
        }
        let lead = snapshot.unit.unwrap_or(module);
        if is == Moving && was != Some(Moving) && self.departed.insert(lead) {
            changes.steps.push(SceneChange::SetOff {
                unit: self.unit_of(snapshot),
                spot: snapshot.spot,
            });
        }
        // A module that stood on its spot when the epoch began is no news.
        let settles = is == Settled && was.is_some_and(|was| was != Settled);
        if settles && self.departed.contains(&lead) {
            let unit = self.unit_of(snapshot);
            let is_whole = unit.iter().all(|&one| self.phase_of(one) == Some(Settled));
            if is_whole && self.arrived.insert(lead) {
                let spot = snapshot.spot;
                changes.steps.push(SceneChange::Settled { unit, spot });
            }
        }
    }

    /// The modules that move with this one, itself included.
    fn unit_of(&self, snapshot: &ModuleSnapshot) -> Vec<ModuleId> {
        let lead = snapshot.unit.unwrap_or(snapshot.module);
        let unit = self
            .modules
            .iter()
            .filter(|&(&id, known)| id == snapshot.module || known.snapshot.unit == Some(lead));
        unit.map(|(&id, _)| id).collect()
    }
}

#[cfg(test)]
mod tests;
