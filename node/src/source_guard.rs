//! Which process speaks for which module, as an observer determines it.
//!
//! The first process that speaks for a run of a module is taken to be that module's own; another vendor's peer may write
//! whatever it likes, but not under that process's participant.

use std::collections::{BTreeMap, BTreeSet};

use formation::model::{Incarnation, MODULES_MAX, Message, ModuleId, RosterMessage};
use formation::protocol::SourceId;

/// At most this many runs are kept; of those that come after, nothing is known.
const RUNS_MAX: usize = 2 * MODULES_MAX;

/// The processes that speak for each run of a module.
#[derive(Debug, Default)]
pub struct SourceGuard {
    runs: BTreeMap<(ModuleId, Incarnation), SourceId>,
}

impl SourceGuard {
    /// Whether the message may be accepted: no other process speaks for the module that it comes from.
    pub fn admit(&mut self, source: SourceId, message: &Message) -> bool {
        let run = match message {
            Message::ModuleState(state) => (state.module, state.incarnation),
            Message::Heartbeat(heartbeat) => (heartbeat.module, heartbeat.incarnation),
            Message::Claim(claim) => (claim.claimant, claim.incarnation),
            Message::Roster(RosterMessage::Plan(roster)) => {
                return self.may_speak_for(source, roster.epoch.convener);
            }
            // These decide nothing for an observer, or any process may publish them.
            Message::Roster(RosterMessage::Gather { .. })
            | Message::Eviction(_)
            | Message::OtherSessionState(_)
            | Message::Stop(_)
            | Message::Removal(_)
            | Message::Target(_) => return true,
        };
        if self.runs.len() >= RUNS_MAX && !self.runs.contains_key(&run) {
            return true;
        }
        *self.runs.entry(run).or_insert(source) == source
    }

    fn may_speak_for(&self, source: SourceId, module: ModuleId) -> bool {
        let runs = (module, Incarnation(0))..=(module, Incarnation(u64::MAX));
        let known: BTreeSet<SourceId> = self.runs.range(runs).map(|(_, &known)| known).collect();
        known.is_empty() || known.contains(&source)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use formation::model::{Decision, Epoch, SpotClaim};

    use super::*;

    fn claim(claimant: u32, incarnation: u64) -> Message {
        Message::Claim(Arc::new(SpotClaim {
            epoch: Epoch {
                number: 1,
                convener: ModuleId(1),
            },
            turn: 0,
            claimant: ModuleId(claimant),
            incarnation: Incarnation(incarnation),
            decision: Decision::default(),
        }))
    }

    #[test]
    fn the_first_that_speaks_for_a_run_is_believed_and_no_other() {
        let mut source_guard = SourceGuard::default();
        let (own, liar) = (SourceId(1), SourceId(2));
        assert!(source_guard.admit(own, &claim(4, 7)));
        assert!(!source_guard.admit(liar, &claim(4, 7)));
        assert!(source_guard.admit(own, &claim(4, 7)));
        assert!(
            source_guard.admit(liar, &claim(4, 8)),
            "a later run is another's"
        );
        assert!(
            source_guard.admit(own, &claim(5, 7)),
            "a process may host several"
        );
        assert!(source_guard.may_speak_for(liar, ModuleId(4)));
        assert!(!source_guard.may_speak_for(liar, ModuleId(5)));
        assert!(source_guard.may_speak_for(liar, ModuleId(6)));
    }
}
