//! The spots that the claims of one epoch give out.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::record::{PlannedEpoch, ReceivedClaim};
use crate::Violation;
use crate::replay::Replay;
use formation_model::{Digest, ModuleId};

/// The claims of one epoch, replayed up to the first gap.
pub(super) struct Claimed {
    pub(super) replay: Replay,
    /// The number of turns replayed.
    pub(super) turns: u32,
    /// When the last of their claims was received.
    pub(super) last_received: Option<Duration>,
}

/// Replays the claims of one epoch.
///
/// A claim counts only if it comes from a member in the run that the roster names. Of several different claims for one turn,
/// those that contradict the spots held then are ignored. If more than one remains, the messages do not show which one the
/// modules applied, and that is a violation.
pub(super) fn replay_claims(planned: PlannedEpoch<'_>) -> Claimed {
    let mut claimed = Claimed {
        replay: Replay::new(planned.problem),
        turns: 0,
        last_received: None,
    };
    while let Some(rivals) = planned.record.claims.get(&claimed.turns) {
        let eligible: Vec<&ReceivedClaim> = rivals
            .iter()
            .filter(|rival| is_from_member(planned, rival))
            .collect();
        let received = match eligible.as_slice() {
            [] => break,
            [only] => {
                let decision = &only.claim.decision;
                claimed
                    .replay
                    .apply(planned.problem, claimed.turns, decision);
                only.received
            }
            rivals => {
                let (next, received) =
                    choose_rival(planned, claimed.turns, &claimed.replay, rivals);
                claimed.replay = next;
                received
            }
        };
        claimed.last_received = claimed.last_received.max(Some(received));
        claimed.turns += 1;
    }
    claimed
}

fn choose_rival(
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
    let run = rival.claim.claimant.run(rival.claim.incarnation);
    planned.members().iter().any(|member| member.run() == run)
}

/// The members that have not shown the plan that most members have shown, and the number of that plan's turns.
pub(super) fn disagreement(planned: PlannedEpoch<'_>) -> (BTreeSet<ModuleId>, Option<u32>) {
    let mut shown: BTreeMap<Digest, BTreeMap<ModuleId, u32>> = BTreeMap::new();
    for member in planned.members() {
        for (&digest, plan) in planned.shown_by(member).into_iter().flatten() {
            let agreeing = shown.entry(digest).or_default();
            agreeing.insert(member.module.id, plan.turns);
        }
    }
    let common = shown.into_values().max_by_key(BTreeMap::len);
    let agreeing = common.unwrap_or_default();
    let members = planned.members().iter().map(|member| member.module.id);
    let disagreeing = members.filter(|module| !agreeing.contains_key(module));
    let disagreeing = disagreeing.collect();
    (disagreeing, agreeing.into_values().max())
}
