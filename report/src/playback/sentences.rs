//! What happens in a step, in words.

use formation::model::{Decision, ModuleId, SpotId};

/// More names than these say nothing more.
const NAMES_MAX: usize = 10;

/// What a unit decides in its turn.
pub(super) fn claim(turn: u32, claimant: ModuleId, decision: &Decision) -> String {
    let evicted = |module: ModuleId| {
        decision
            .evictions
            .iter()
            .any(|eviction| eviction.evicted == module)
    };
    let mut own: Vec<(u32, u32)> = decision
        .selections
        .iter()
        .filter(|pair| !evicted(pair.module))
        .map(|pair| (pair.module.0, pair.spot.0))
        .collect();
    own.sort_unstable();
    let mut text = format!("Turn {}: ", turn + 1);
    text.push_str(&match own.as_slice() {
        [] => format!("{claimant} finds no spot"),
        [(module, spot)] => format!("module {module} takes spot {spot}"),
        several => {
            let (modules, spots): (Vec<u32>, Vec<u32>) = several.iter().copied().unzip();
            format!(
                "{} take {}",
                listed("module", &modules),
                listed("spot", &spots)
            )
        }
    });
    if !decision.detached.is_empty() {
        let detached: Vec<u32> = decision.detached.iter().map(|module| module.0).collect();
        text.push_str(&format!(
            "; {} left over",
            singular_or_plural(&listed("module", &detached), detached.len(), "is", "are")
        ));
    }
    for eviction in decision.evictions.iter().take(NAMES_MAX) {
        text.push_str(&match eviction.to {
            Some(to) => format!(
                "; {} yields {} and goes to {to}",
                eviction.evicted, eviction.from
            ),
            None => format!("; {} yields {}", eviction.evicted, eviction.from),
        });
    }
    let more = decision.evictions.len().saturating_sub(NAMES_MAX);
    if more > 0 {
        text.push_str(&format!("; {more} more are evicted"));
    }
    text
}

/// A unit begins to move.
pub(super) fn sets_off(modules: &[u32], spot: Option<SpotId>) -> String {
    match (modules, spot) {
        ([module], Some(spot)) => format!("Module {module} sets off to {spot}"),
        _ => format!(
            "{} together",
            singular_or_plural(
                &capital(&listed("module", modules)),
                modules.len(),
                "sets off",
                "set off"
            )
        ),
    }
}

/// A unit stands on its spots.
pub(super) fn settled(modules: &[u32], spot: Option<SpotId>) -> String {
    match (modules, spot) {
        ([module], Some(spot)) => format!("Module {module} has settled on {spot}"),
        _ => singular_or_plural(
            &capital(&listed("module", modules)),
            modules.len(),
            "has settled",
            "have settled",
        ),
    }
}

/// The process of a module was started again.
pub(super) fn begins_again(module: ModuleId) -> String {
    format!("{} starts again", capital(&module.to_string()))
}

fn singular_or_plural(subject: &str, count: usize, one: &str, several: &str) -> String {
    format!("{subject} {}", if count == 1 { one } else { several })
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

/// Names things by their numbers: "modules 1, 2 and 3".
fn listed(noun: &str, ids: &[u32]) -> String {
    let shown: Vec<String> = ids.iter().take(NAMES_MAX).map(u32::to_string).collect();
    let more = ids.len() - shown.len();
    match (shown.as_slice(), more) {
        ([], _) => format!("no {noun}"),
        ([only], 0) => format!("{noun} {only}"),
        ([most @ .., last], 0) => format!("{noun}s {} and {last}", most.join(", ")),
        (_, more) => format!("{noun}s {} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use formation::model::{EvictionRecord, SpotSelection};

    use super::*;

    fn pair(module: u32, spot: u32) -> SpotSelection {
        SpotSelection {
            spot: SpotId(spot),
            module: ModuleId(module),
        }
    }

    #[test]
    fn a_turn_says_who_takes_what_from_whom() {
        let single = Decision {
            selections: vec![pair(9, 2), pair(7, 4)],
            evictions: vec![EvictionRecord {
                evicted: ModuleId(9),
                by: ModuleId(7),
                from: SpotId(4),
                to: Some(SpotId(2)),
            }],
            detached: Vec::new(),
        };
        assert_eq!(
            claim(2, ModuleId(7), &single),
            "Turn 3: module 7 takes spot 4; module 9 yields spot 4 and goes to spot 2"
        );
        let block = Decision {
            selections: vec![pair(3, 1), pair(1, 2), pair(2, 3)],
            evictions: Vec::new(),
            detached: vec![ModuleId(4)],
        };
        assert_eq!(
            claim(0, ModuleId(1), &block),
            "Turn 1: modules 1, 2 and 3 take spots 2, 3 and 1; module 4 is left over"
        );
        assert_eq!(
            claim(4, ModuleId(5), &Decision::default()),
            "Turn 5: module 5 finds no spot"
        );
    }

    #[test]
    fn units_set_off_and_settle() {
        assert_eq!(
            sets_off(&[4], Some(SpotId(9))),
            "Module 4 sets off to spot 9"
        );
        assert_eq!(
            sets_off(&[4, 5], Some(SpotId(9))),
            "Modules 4 and 5 set off together"
        );
        assert_eq!(settled(&[4, 5], None), "Modules 4 and 5 have settled");
        let many: Vec<u32> = (1..=12).collect();
        assert_eq!(
            listed("module", &many),
            "modules 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 2 more"
        );
    }
}
