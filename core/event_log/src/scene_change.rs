//! What happens in a formation, in sentences.

use std::collections::BTreeSet;
use std::fmt::{self, Write};

use formation_model::text::{counted, listed};
use formation_model::{Decision, Epoch, ModuleId, SpotId};

/// More evictions of one turn are counted only.
const EVICTIONS_MAX: usize = 10;

/// One change of a scene that people read as a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneChange<'a> {
    /// A later epoch begins, and modules halt.
    Regathering(Epoch),
    /// The members of the epoch are known.
    RosterFixed {
        /// How many they are.
        members: usize,
    },
    /// A unit took its turn.
    Turn {
        /// Counts the turns of the epoch, from 0.
        turn: u32,
        /// The module that published the decision.
        claimant: ModuleId,
        /// What it decided.
        decision: &'a Decision,
    },
    /// All modules hold the same plan.
    Agreed,
    /// The process of a module was started again.
    Restarted(ModuleId),
    /// An acting unit begins to move.
    SetOff {
        /// Its modules, ascending.
        unit: Vec<ModuleId>,
        /// The spot of its only module.
        spot: Option<SpotId>,
    },
    /// An acting unit stands on its spots.
    Settled {
        /// Its modules, ascending.
        unit: Vec<ModuleId>,
        /// The spot of its only module.
        spot: Option<SpotId>,
    },
}

impl SceneChange<'_> {
    /// The modules that act.
    #[must_use]
    pub fn acting(&self) -> Vec<ModuleId> {
        match self {
            Self::Regathering(_) | Self::RosterFixed { .. } | Self::Agreed => Vec::new(),
            Self::Restarted(module) => vec![*module],
            Self::SetOff { unit, .. } | Self::Settled { unit, .. } => unit.clone(),
            Self::Turn {
                claimant, decision, ..
            } => {
                let mut acting: Vec<ModuleId> =
                    takers(decision).map(|(module, _)| module).collect();
                if !acting.contains(claimant) {
                    acting.push(*claimant);
                }
                acting
            }
        }
    }

    /// The modules that lose a spot.
    #[must_use]
    pub fn evicted(&self) -> Vec<ModuleId> {
        match self {
            Self::Turn { decision, .. } => {
                let evictions = decision.evictions.iter();
                evictions.map(|eviction| eviction.evicted).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// The modules that take a spot of their own choice, which leaves out those that are evicted to another.
fn takers(decision: &Decision) -> impl Iterator<Item = (ModuleId, SpotId)> + '_ {
    let evictions = decision.evictions.iter();
    let evicted: BTreeSet<ModuleId> = evictions.map(|eviction| eviction.evicted).collect();
    let selections = decision.selections.iter();
    selections
        .filter(move |pair| !evicted.contains(&pair.module))
        .map(|pair| (pair.module, pair.spot))
}

impl fmt::Display for SceneChange<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Regathering(epoch) => write!(
                formatter,
                "Epoch {}: all modules halt and gather again",
                epoch.number
            ),
            Self::RosterFixed { members } => {
                let verb = if *members == 1 { "takes" } else { "take" };
                let modules = counted(*members, "module");
                write!(formatter, "The roster is fixed: {modules} {verb} part")
            }
            Self::Turn {
                turn,
                claimant,
                decision,
            } => {
                write!(formatter, "Turn {}: ", turn + 1)?;
                write_decision(formatter, *claimant, decision)
            }
            Self::Agreed => {
                formatter.write_str("All modules hold the same plan; they may move now")
            }
            Self::Restarted(module) => write!(formatter, "{} starts again", capital(&[*module])),
            Self::SetOff { unit, spot } => match (unit.len(), spot) {
                (1, Some(spot)) => write!(formatter, "{} sets off to {spot}", capital(unit)),
                (1, None) => write!(formatter, "{} sets off", capital(unit)),
                _ => write!(formatter, "{} set off together", capital(unit)),
            },
            Self::Settled { unit, spot } => match (unit.len(), spot) {
                (1, Some(spot)) => write!(formatter, "{} has settled on {spot}", capital(unit)),
                (1, None) => write!(formatter, "{} has settled", capital(unit)),
                _ => write!(formatter, "{} have settled", capital(unit)),
            },
        }
    }
}

/// What modules do that get a spot apart from their configuration, for one and for several.
const LEAVING: [&str; 2] = [
    "leaves its configuration and takes",
    "leave their configuration and take",
];

fn write_takers(
    out: &mut impl Write,
    takers: &[(ModuleId, SpotId)],
    [of_one, of_several]: [&str; 2],
) -> fmt::Result {
    if let [(module, spot)] = takers {
        return write!(out, "{module} {of_one} {spot}");
    }
    let (modules, spots): (Vec<_>, Vec<_>) = takers.iter().copied().unzip();
    write!(out, "{} {of_several} {}", listed(modules), listed(spots))
}

fn write_decision(out: &mut impl Write, claimant: ModuleId, decision: &Decision) -> fmt::Result {
    let mut own: Vec<(ModuleId, SpotId)> = takers(decision).collect();
    own.sort_unstable();
    let (alone, together): (Vec<_>, Vec<_>) = own
        .into_iter()
        .partition(|(module, _)| decision.detached.contains(module));
    match (together.as_slice(), alone.as_slice()) {
        ([], []) => write!(out, "{claimant} finds no spot")?,
        (together, []) => write_takers(out, together, ["takes", "take"])?,
        ([], alone) => write_takers(out, alone, LEAVING)?,
        (together, alone) => {
            write_takers(out, together, ["takes", "take"])?;
            out.write_str("; ")?;
            write_takers(out, alone, LEAVING)?;
        }
    }
    let holds_spot = |module: &ModuleId| {
        let mut selections = decision.selections.iter();
        selections.any(|selection| selection.module == *module)
    };
    let left_over = decision.detached.iter().copied();
    let left_over: Vec<ModuleId> = left_over.filter(|module| !holds_spot(module)).collect();
    if !left_over.is_empty() {
        let verb = if left_over.len() == 1 { "is" } else { "are" };
        write!(out, "; {} {verb} left over", listed(left_over))?;
    }
    for eviction in decision.evictions.iter().take(EVICTIONS_MAX) {
        write!(out, "; {} yields {}", eviction.evicted, eviction.from)?;
        if let Some(to) = eviction.to {
            write!(out, " and goes to {to}")?;
        }
    }
    match decision.evictions.len().saturating_sub(EVICTIONS_MAX) {
        0 => {}
        more => write!(out, "; {more} more are evicted")?,
    }
    match decision.swaps.len() {
        0 => Ok(()),
        1..=EVICTIONS_MAX => {
            let mut swaps: Vec<_> = decision
                .swaps
                .iter()
                .map(|pair| (pair.module, pair.spot))
                .collect();
            swaps.sort_unstable();
            out.write_str("; then ")?;
            write_takers(out, &swaps, ["swaps to", "swap to"])
        }
        more => write!(out, "; then {more} modules swap their spots"),
    }
}

/// Modules at the beginning of a sentence.
fn capital(unit: &[ModuleId]) -> String {
    listed(unit.iter().copied()).replacen('m', "M", 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{EvictionRecord, SpotSelection};

    fn pair(module: u32, spot: u32) -> SpotSelection {
        SpotSelection {
            spot: SpotId(spot),
            module: ModuleId(module),
        }
    }

    fn turn(turn: u32, claimant: u32, decision: &Decision) -> String {
        let claimant = ModuleId(claimant);
        SceneChange::Turn {
            turn,
            claimant,
            decision,
        }
        .to_string()
    }

    #[test]
    fn a_turn_names_takers_and_evicted_modules() {
        let single = Decision {
            selections: vec![pair(9, 2), pair(7, 4)],
            evictions: vec![EvictionRecord {
                evicted: ModuleId(9),
                by: ModuleId(7),
                from: SpotId(4),
                to: Some(SpotId(2)),
            }],
            ..Decision::default()
        };
        assert_eq!(
            turn(2, 7, &single),
            "Turn 3: module 7 takes spot 4; module 9 yields spot 4 and goes to spot 2"
        );
        let block = Decision {
            selections: vec![pair(3, 1), pair(1, 2), pair(2, 3)],
            detached: vec![ModuleId(4)],
            ..Decision::default()
        };
        assert_eq!(
            turn(0, 1, &block),
            "Turn 1: modules 1, 2 and 3 take spots 2, 3 and 1; module 4 is left over"
        );
        let broken = Decision {
            selections: vec![pair(3, 1), pair(1, 2), pair(2, 3), pair(4, 7)],
            detached: vec![ModuleId(2), ModuleId(4), ModuleId(5)],
            ..Decision::default()
        };
        assert_eq!(
            turn(0, 1, &broken),
            "Turn 1: modules 1 and 3 take spots 2 and 1; modules 2 and 4 leave their configuration and take spots 3 and \
             7; module 5 is left over"
        );
        assert_eq!(
            turn(4, 5, &Decision::default()),
            "Turn 5: module 5 finds no spot"
        );
    }

    #[test]
    fn units_set_off_and_settle() {
        let step = |unit: &[u32], spot: Option<u32>| {
            let unit: Vec<ModuleId> = unit.iter().copied().map(ModuleId).collect();
            let spot = spot.map(SpotId);
            let set_off = SceneChange::SetOff {
                unit: unit.clone(),
                spot,
            };
            [set_off, SceneChange::Settled { unit, spot }].map(|step| step.to_string())
        };
        assert_eq!(
            step(&[4], Some(9)),
            [
                "Module 4 sets off to spot 9",
                "Module 4 has settled on spot 9"
            ]
        );
        assert_eq!(
            step(&[4, 5], Some(9)),
            [
                "Modules 4 and 5 set off together",
                "Modules 4 and 5 have settled"
            ]
        );
    }
}
