//! What is known of a run while it is watched.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use formation::event_log::{Entry, Event, Told};
use formation::model::{ActingUnit, Decision, Epoch, ModuleId, ModulePhase, SpotId};

use super::super::processes::id_list;
use super::super::progress::Progress;
use crate::plan::CheckedPlan;

/// So many of the last happenings are kept.
pub const LOG_MAX: usize = 20;

/// How a spot is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotStatus {
    /// Nobody has it.
    Free,
    /// A module has it by the claims.
    Claimed(ModuleId),
    /// Its module is on the way.
    Awaited(ModuleId),
    /// Its module has settled.
    Filled(ModuleId),
}

/// Somebody whose turn it is, or who waits for others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Waiting {
    /// The modules.
    pub modules: Vec<ModuleId>,
    /// For whom they wait.
    pub waits_for: Vec<ModuleId>,
}

/// A run as far as it was heard of.
pub struct Watched<'a> {
    pub name: &'a str,
    plan: &'a CheckedPlan,
    pub progress: Progress,
    pub epoch: Option<Epoch>,
    /// The position of the initial configuration of each module that is in one.
    configurations: BTreeMap<ModuleId, usize>,
    told: BTreeMap<ModuleId, Told>,
    holders: BTreeMap<SpotId, ModuleId>,
    /// How many turns were taken.
    pub turns: usize,
    /// Whether every claim so far is the one that the offline plan has.
    as_planned: bool,
    set_off: BTreeSet<ModuleId>,
    log: VecDeque<(u64, String)>,
}

impl<'a> Watched<'a> {
    pub fn new(name: &'a str, plan: &'a CheckedPlan) -> Self {
        Self {
            name,
            plan,
            progress: Progress {
                expected: plan.problem.modules().len(),
                ..Progress::default()
            },
            epoch: None,
            configurations: plan
                .problem
                .configurations()
                .iter()
                .enumerate()
                .flat_map(|(position, configuration)| {
                    let modules = configuration.modules.iter();
                    modules.map(move |&module| (module, position))
                })
                .collect(),
            told: BTreeMap::new(),
            holders: BTreeMap::new(),
            turns: 0,
            as_planned: true,
            set_off: BTreeSet::new(),
            log: VecDeque::new(),
        }
    }

    pub fn plan(&self) -> &CheckedPlan {
        self.plan
    }

    pub fn show(&mut self, progress: &Progress) {
        self.progress = progress.clone();
    }

    pub fn hear(&mut self, entry: &Entry) {
        match &entry.event {
            Event::Gathering(epoch) => {
                self.begin(*epoch);
                if epoch.number > 1 {
                    self.note(
                        entry.at_ms,
                        format!("epoch {}: all gather anew", epoch.number),
                    );
                }
            }
            Event::Roster { epoch, modules } => {
                self.begin(*epoch);
                self.note(
                    entry.at_ms,
                    format!("the roster has {} modules", modules.len()),
                );
                self.hold_pinned();
            }
            Event::Claim {
                turn,
                claimant,
                decision,
                ..
            } => {
                self.compare(*claimant, decision);
                self.apply(decision);
                self.turns += 1;
                self.note(entry.at_ms, claim_text(*turn, *claimant, decision));
            }
            Event::State(told) => self.take_state(entry.at_ms, told),
            Event::Pose { .. } => {}
        }
    }

    /// The last happenings, the latest last.
    pub fn log(&self) -> impl DoubleEndedIterator<Item = (u64, &str)> + ExactSizeIterator {
        self.log.iter().map(|(at_ms, text)| (*at_ms, text.as_str()))
    }

    fn note(&mut self, at_ms: u64, text: String) {
        if self.log.len() == LOG_MAX {
            self.log.pop_front();
        }
        self.log.push_back((at_ms, text));
    }

    fn begin(&mut self, epoch: Epoch) {
        if self.epoch != Some(epoch) {
            self.epoch = Some(epoch);
            self.holders.clear();
            self.turns = 0;
            self.set_off.clear();
            // The offline plan is that of everybody's start.
            self.as_planned = self
                .told
                .values()
                .all(|told| told.phase != ModulePhase::Settled);
        }
    }

    fn hold_pinned(&mut self) {
        let pinned = self
            .told
            .values()
            .filter(|told| matches!(told.phase, ModulePhase::Gathered | ModulePhase::Settled));
        let held: Vec<(SpotId, ModuleId)> = pinned
            .filter_map(|told| Some((told.spot?, told.module)))
            .collect();
        self.as_planned &= held.is_empty();
        self.holders.extend(held);
    }

    fn compare(&mut self, claimant: ModuleId, decision: &Decision) {
        let planned = self.plan.outcome.decisions.get(self.turns);
        self.as_planned &=
            planned.is_some_and(|(turn, planned)| turn.claimant == claimant && planned == decision);
    }

    fn apply(&mut self, decision: &Decision) {
        let moving: BTreeSet<ModuleId> = decision
            .selections
            .iter()
            .map(|pair| pair.module)
            .chain(decision.evictions.iter().map(|eviction| eviction.evicted))
            .collect();
        self.holders.retain(|_, holder| !moving.contains(holder));
        for pair in &decision.selections {
            self.holders.insert(pair.spot, pair.module);
        }
    }

    fn take_state(&mut self, at_ms: u64, told: &Told) {
        let before = self.told.insert(told.module, told.clone());
        let lead = told.unit.unwrap_or(told.module);
        if told.phase == ModulePhase::Moving && self.set_off.insert(lead) {
            let unit = self.unit_of(told);
            let verb = if unit.len() == 1 { "sets" } else { "set" };
            self.note(at_ms, format!("{} {verb} off", named(&unit)));
        }
        let has_settled = told.phase == ModulePhase::Settled
            && before.is_some_and(|before| before.phase != ModulePhase::Settled);
        if has_settled && self.set_off.contains(&lead) {
            let unit = self.unit_of(told);
            if unit.iter().all(|module| self.is_settled(*module)) {
                let verb = if unit.len() == 1 { "has" } else { "have" };
                self.note(at_ms, format!("{} {verb} settled", named(&unit)));
            }
        }
    }

    /// The modules that move with this one, itself included.
    fn unit_of(&self, told: &Told) -> Vec<ModuleId> {
        let lead = told.unit.unwrap_or(told.module);
        let others = self
            .told
            .values()
            .filter(|other| other.module == told.module || other.unit == Some(lead));
        others.map(|other| other.module).collect()
    }

    fn is_settled(&self, module: ModuleId) -> bool {
        self.told
            .get(&module)
            .is_some_and(|told| told.phase == ModulePhase::Settled)
    }

    /// The position of a module's initial configuration, if it is in one.
    pub fn configuration_of(&self, module: ModuleId) -> Option<usize> {
        self.configurations.get(&module).copied()
    }

    /// How a spot is doing.
    pub fn spot(&self, spot: SpotId) -> SpotStatus {
        let Some(&holder) = self.holders.get(&spot) else {
            return SpotStatus::Free;
        };
        match self.told.get(&holder).map(|told| told.phase) {
            Some(ModulePhase::Settled) => SpotStatus::Filled(holder),
            Some(ModulePhase::Moving) => SpotStatus::Awaited(holder),
            _ => SpotStatus::Claimed(holder),
        }
    }

    /// Whose turn it is, and who waits for whom after that; empty where the offline plan does not tell.
    pub fn queue(&self) -> Vec<Waiting> {
        if !self.as_planned || self.epoch.is_none() {
            return Vec::new();
        }
        let turns = &self.plan.outcome.decisions;
        let units: Vec<Vec<ModuleId>> = if self.turns < turns.len() {
            turns[self.turns..]
                .iter()
                .map(|(turn, _)| turn.modules.clone())
                .collect()
        } else {
            let units = &self.plan.outcome.plan.assembly.units;
            units
                .iter()
                .map(|unit: &ActingUnit| {
                    let mut modules: Vec<ModuleId> =
                        unit.placements.iter().map(|&(module, _)| module).collect();
                    modules.sort_unstable();
                    modules
                })
                .skip_while(|unit| unit.iter().all(|&module| self.is_settled(module)))
                .collect()
        };
        let mut before = Vec::new();
        units
            .into_iter()
            .map(|modules| Waiting {
                waits_for: std::mem::replace(&mut before, modules.clone()),
                modules,
            })
            .collect()
    }

    /// Whether the turns are over and units move.
    pub fn is_acting(&self) -> bool {
        self.turns >= self.plan.outcome.decisions.len()
    }

    /// The spots of some modules by the claims so far.
    pub fn spots_of(&self, modules: &[ModuleId]) -> Vec<SpotId> {
        let mut spots: Vec<SpotId> = self
            .holders
            .iter()
            .filter(|(_, holder)| modules.contains(holder))
            .map(|(&spot, _)| spot)
            .collect();
        spots.sort_unstable();
        spots
    }
}

/// Numbers for people: `1-4, 7`.
pub fn named(modules: &[ModuleId]) -> String {
    id_list(modules).replace(',', ", ")
}

fn claim_text(turn: u32, claimant: ModuleId, decision: &Decision) -> String {
    // A chain may evict one module more than once.
    let evicted: BTreeSet<ModuleId> = decision
        .evictions
        .iter()
        .map(|eviction| eviction.evicted)
        .collect();
    let evicted: Vec<ModuleId> = evicted.into_iter().collect();
    let takers: BTreeSet<ModuleId> = decision
        .selections
        .iter()
        .map(|pair| pair.module)
        .filter(|module| !evicted.contains(module))
        .collect();
    let takers: Vec<ModuleId> = takers.into_iter().collect();
    let mut spots: Vec<ModuleId> = decision
        .selections
        .iter()
        .filter(|pair| takers.contains(&pair.module))
        .map(|pair| ModuleId(pair.spot.0))
        .collect();
    spots.sort_unstable();
    let number = turn + 1;
    let mut text = match takers.len() {
        0 => format!("turn {number}: {} finds no spot", claimant.0),
        1 => format!(
            "turn {number}: {} takes spot {}",
            named(&takers),
            named(&spots)
        ),
        _ => format!(
            "turn {number}: {} take spots {}",
            named(&takers),
            named(&spots)
        ),
    };
    if !evicted.is_empty() {
        text.push_str(&format!(", evicting {}", named(&evicted)));
    }
    if !decision.detached.is_empty() {
        text.push_str(&format!(", leaving {}", named(&decision.detached)));
    }
    text
}
