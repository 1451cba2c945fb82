//! The spots that the claims of one epoch give out.

use std::time::Duration;

use super::record::{PlannedEpoch, ReceivedClaim};
use crate::verify::Violation;
use crate::verify::replay::Replay;

/// The claims of one epoch, replayed as far as they are known without a gap.
pub(super) struct Claimed {
    pub(super) replay: Replay,
    /// How many turns were replayed; the next one's claim is missing or there is none.
    pub(super) turns: u32,
    /// When the last of them arrived.
    pub(super) last_received: Option<Duration>,
}

/// Replays the claims of one epoch.
///
/// A claim counts only if it comes from the run of a member that the roster names. Where several different claims for
/// one turn are left, those that the spots held then contradict are put aside; if that leaves more than one, an observer
/// cannot know which the modules applied, and that is a violation.
pub(super) fn replay_claims(planned: PlannedEpoch<'_>) -> Claimed {
    let mut claimed = Claimed {
        replay: Replay::new(planned.problem),
        turns: 0,
        last_received: None,
    };
    while let Some(rivals) = planned.record.claims.get(&claimed.turns) {
        let turn = claimed.turns;
        let is_eligible = |rival: &&ReceivedClaim| is_from_member(planned, rival);
        let eligible: Vec<&ReceivedClaim> = rivals.iter().filter(is_eligible).collect();
        let received = match eligible.as_slice() {
            [] => break,
            [only] => {
                let replay = &mut claimed.replay;
                replay.apply(planned.problem, turn, &only.claim.decision);
                only.received
            }
            rivals => {
                let (next, received) = choose(planned, turn, &claimed.replay, rivals);
                claimed.replay = next;
                received
            }
        };
        claimed.last_received = claimed.last_received.max(Some(received));
        claimed.turns += 1;
    }
    claimed
}

/// Applies the one of several claims for a turn that fits what was claimed before.
fn choose(
    planned: PlannedEpoch<'_>,
    turn: u32,
    before: &Replay,
    rivals: &[&ReceivedClaim],
) -> (Replay, Duration) {
    let mut outcomes: Vec<(Replay, Duration)> = rivals
        .iter()
        .map(|rival| {
            let mut next = before.clone();
            next.apply(planned.problem, turn, &rival.claim.decision);
            (next, rival.received)
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
    let (mut next, received) = outcomes.swap_remove(0);
    if are_rivals {
        let epoch = planned.epoch;
        next.violations
            .push(Violation::ClaimsDiffer { epoch, turn });
    }
    (next, received)
}

fn is_from_member(planned: PlannedEpoch<'_>, rival: &ReceivedClaim) -> bool {
    planned.members().iter().any(|member| {
        member.module.id == rival.claim.claimant && member.incarnation == rival.claim.incarnation
    })
}
