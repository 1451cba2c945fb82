//! The spots that the claims of one epoch give out.

use std::time::Duration;

use super::record::{EpochRecord, HeardClaim, HeardRoster};
use crate::model::{Epoch, PlanningProblem};
use crate::verify::Violation;
use crate::verify::replay::Replay;

/// The claims of one epoch, replayed as far as they are known without a gap.
pub(super) struct Claimed {
    pub(super) replay: Replay,
    /// How many turns were replayed; the next one's claim is missing or there is none.
    pub(super) turns: u32,
    /// When the last of them came.
    pub(super) last_heard: Option<Duration>,
}

/// Replays the claims of one epoch.
///
/// A claim counts only if it comes from the run of a member that the roster names. Where several different claims for
/// one turn are left, those that the spots held then contradict are put aside; if that leaves more than one, nobody
/// outside can tell which the modules applied, and that is a violation.
pub(super) fn replay_claims(
    epoch: Epoch,
    record: &EpochRecord,
    heard: &HeardRoster,
    problem: &PlanningProblem,
) -> Claimed {
    let mut claimed = Claimed {
        replay: Replay::new(problem),
        turns: 0,
        last_heard: None,
    };
    while let Some(rivals) = record.claims.get(&claimed.turns) {
        let turn = claimed.turns;
        let eligible: Vec<&HeardClaim> = rivals
            .iter()
            .filter(|rival| is_from_member(heard, rival))
            .collect();
        let heard_at = match eligible.as_slice() {
            [] => break,
            [only] => {
                claimed.replay.apply(problem, turn, &only.claim.decision);
                only.heard
            }
            rivals => {
                let (next, heard_at) = settle_rivals(epoch, turn, &claimed.replay, problem, rivals);
                claimed.replay = next;
                heard_at
            }
        };
        claimed.last_heard = claimed.last_heard.max(Some(heard_at));
        claimed.turns += 1;
    }
    claimed
}

fn settle_rivals(
    epoch: Epoch,
    turn: u32,
    before: &Replay,
    problem: &PlanningProblem,
    rivals: &[&HeardClaim],
) -> (Replay, Duration) {
    let mut outcomes: Vec<(Replay, Duration)> = rivals
        .iter()
        .map(|rival| {
            let mut next = before.clone();
            next.apply(problem, turn, &rival.claim.decision);
            (next, rival.heard)
        })
        .collect();
    let is_sound =
        |(next, _): &(Replay, Duration)| next.violations.len() == before.violations.len();
    if outcomes.iter().any(is_sound) {
        outcomes.retain(is_sound);
    }
    let are_rivals = outcomes.len() > 1;
    // The lowest in a fixed order, so that the order of arrival does not matter.
    outcomes.sort_by(|(one, _), (other, _)| one.spots.cmp(&other.spots));
    let (mut next, heard_at) = outcomes.swap_remove(0);
    if are_rivals {
        next.violations
            .push(Violation::ClaimsDiffer { epoch, turn });
    }
    (next, heard_at)
}

fn is_from_member(heard: &HeardRoster, rival: &HeardClaim) -> bool {
    heard.roster.members.iter().any(|member| {
        member.module.id == rival.claim.claimant && member.incarnation == rival.claim.incarnation
    })
}
