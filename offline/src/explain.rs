//! Why a module gets its spot, or none: as `formation explain` says it, and as the object that it prints.

use formation_event_log::SceneChange;
use formation_model::text::counted;
use formation_model::{MicroUnits, ModuleId, SpotId};
use formation_planner::{ConcernedTurn, Explanation, SwappedModule, TurnOutcome};
use serde::Serialize;

use crate::checked_plan::CheckedPlan;
use crate::swap;
use crate::table::aligned;

/// The text shows this many other spots.
const ALTERNATIVES_MAX: usize = 5;

/// The object that `--json` prints. Utilities are those by which spots are chosen; the alternatives begin with the best.
#[derive(Debug, Serialize)]
pub struct ExplanationReport {
    module: ModuleId,
    /// The configuration that it belongs to.
    configuration: Option<u32>,
    spot: Option<SpotId>,
    /// Whether walls leave the module no way to the target.
    cut_off: bool,
    /// By how much its way is longer than the straight one, and what is in that one's way.
    detour: f64,
    barrier: Option<String>,
    /// Whether the plan fills all spots that the modules suffice for.
    complete: bool,
    /// Whether each placement of a configuration is proven to be the best.
    proven: bool,
    /// The spots that no module takes.
    open_spots: Vec<SpotId>,
    turns: Vec<TurnReport>,
    /// The change of its spot after the claims.
    #[serde(skip_serializing_if = "Option::is_none")]
    swapped: Option<SwappedModule>,
    alternatives: Vec<AlternativeReport>,
}

#[derive(Debug, Serialize)]
struct TurnReport {
    /// From 0.
    turn: u32,
    claimant: ModuleId,
    #[serde(flatten)]
    outcome: TurnOutcome,
    text: String,
}

#[derive(Debug, Serialize)]
struct AlternativeReport {
    spot: SpotId,
    detour: f64,
    barrier: Option<String>,
    utility: f64,
    holder: Option<ModuleId>,
    holder_utility: Option<f64>,
    loss: f64,
}

impl ExplanationReport {
    /// What to print of a module of a plan.
    pub fn of(plan: &CheckedPlan, explanation: &Explanation) -> Self {
        let module = explanation.module;
        let member = plan.problem.module(module);
        let configuration = member.and_then(|member| member.configuration);
        let turns = explanation.turns.iter().map(|turn| TurnReport {
            turn: turn.number,
            claimant: turn.claimant,
            outcome: turn.outcome,
            text: sentence(turn),
        });
        let others = explanation.alternatives.iter();
        let alternatives = others.map(|one| AlternativeReport {
            spot: one.spot,
            detour: one.detour.to_units(),
            barrier: one.barrier.map(|barrier| barrier.to_string()),
            utility: one.utility.to_units(),
            holder: one.holder.map(|(holder, _)| holder),
            holder_utility: one.holder.map(|(_, utility)| utility.to_units()),
            loss: one.loss.to_units(),
        });
        Self {
            module,
            configuration: configuration.map(|configuration| configuration.0),
            spot: explanation.spot,
            cut_off: explanation.cut_off,
            detour: explanation.detour.to_units(),
            barrier: explanation.barrier.map(|barrier| barrier.to_string()),
            complete: plan.is_complete(),
            proven: plan.statistics.proven,
            open_spots: plan.statistics.open_spots.clone(),
            turns: turns.collect(),
            swapped: explanation.swapped,
            alternatives: alternatives.collect(),
        }
    }
}

/// The decision of a turn, as in films.
fn sentence(turn: &ConcernedTurn) -> String {
    let step = SceneChange::Turn {
        turn: turn.number,
        claimant: turn.claimant,
        decision: &turn.decision,
    };
    step.to_string()
}

/// The explanation in sentences, with a table of the best other spots.
pub fn explanation_text(explanation: &Explanation) -> String {
    let module = explanation.module;
    let mut lines = vec![match explanation.spot {
        Some(spot) => format!("{module} gets {spot}."),
        None if explanation.cut_off => {
            let barrier = explanation.barrier;
            let barrier =
                barrier.map_or_else(String::new, |barrier| format!(": {barrier} is in between"));
            format!("{module} gets no spot: no way leads from it to the target{barrier}.")
        }
        None => format!("{module} gets no spot."),
    }];
    lines.extend(detours(explanation));
    for turn in &explanation.turns {
        let meaning = match turn.outcome {
            TurnOutcome::Takes { spot } => format!("{module} gets {spot}"),
            TurnOutcome::Loses {
                spot,
                to,
                instead: Some(instead),
            } => format!("{module} loses {spot} to {to} and gets {instead}"),
            TurnOutcome::Loses { spot, to, .. } => {
                format!("{module} loses {spot} to {to} and gets none")
            }
            TurnOutcome::FindsNone => format!("{module} gets none"),
        };
        lines.push(format!("  {}: {meaning}", sentence(turn)));
    }
    if explanation.turns.is_empty() {
        lines.push("  No turn concerned it.".to_owned());
    }
    lines.extend(explanation.swapped.as_ref().map(|swapped| {
        let change = swap::change(swapped);
        format!("  Swapped after the claims, as no motion leads to the spots claimed: {change}.")
    }));
    let alternatives = &explanation.alternatives;
    if alternatives.is_empty() {
        return lines.join("\n");
    }
    let best = alternatives.iter().take(ALTERNATIVES_MAX);
    let rows = best.map(|one| {
        let (holder, utility) = one
            .holder
            .map_or_else(Default::default, |(holder, utility)| {
                (holder.0.to_string(), rounded(utility.to_units()))
            });
        [
            one.spot.0.to_string(),
            rounded(one.utility.to_units()),
            holder,
            utility,
            rounded(one.loss.to_units()),
        ]
    });
    lines.push(String::new());
    lines.push("Other spots, the best for it first:".to_owned());
    lines.push(aligned(
        [
            "spot",
            "utility",
            "holder",
            "holder's utility",
            "loss if exchanged",
        ],
        rows,
    ));
    if alternatives.len() > ALTERNATIVES_MAX {
        let more = counted(alternatives.len() - ALTERNATIVES_MAX, "more spot");
        lines.push(format!("and {more}"));
    }
    lines.push("Utilities and losses leave out what links save that stay docked.".to_owned());
    lines.join("\n")
}

/// The detours to its spot and to those shown, each with what is in the way.
fn detours(explanation: &Explanation) -> Vec<String> {
    let own = explanation
        .spot
        .map(|spot| (spot, explanation.detour, explanation.barrier));
    let shown = explanation.alternatives.iter().take(ALTERNATIVES_MAX);
    let others = shown.map(|one| (one.spot, one.detour, one.barrier));
    let ways = own.into_iter().chain(others);
    let detours = ways.filter(|&(_, detour, _)| detour > MicroUnits::ZERO);
    detours
        .map(|(spot, detour, barrier)| {
            let barrier =
                barrier.map_or_else(|| "what stands there".to_owned(), |one| one.to_string());
            format!(
                "  The way to {spot} leads round {barrier}, a detour of {} units.",
                detour.to_units()
            )
        })
        .collect()
}

fn rounded(number: f64) -> String {
    format!("{number:.2}")
}
