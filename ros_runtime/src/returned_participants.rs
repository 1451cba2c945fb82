//! Participants that were lost when their lease ran out, and are there again.
//!
//! RustDDS 0.15.1 lists the endpoints of such a participant again and matches none of them: nothing passes between the two for good.
//! Only a new participant of this process is matched with them.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use crate::subscription::ParticipantId;

/// A process that joins the graph again by itself, as one whose machine was suspended, leaves with its former participant within this.
const GRACE: Duration = Duration::from_secs(3);

/// So many lost participants are remembered: more than a domain has on one machine.
const LOST_MAX: usize = 1_024;

/// Which participants were lost, and since when those are back that came back.
#[derive(Default)]
pub(crate) struct ReturnedParticipants {
    lost: BTreeSet<ParticipantId>,
    back: BTreeMap<ParticipantId, Instant>,
}

impl ReturnedParticipants {
    /// The lease of a participant ran out.
    pub(crate) fn note_lost(&mut self, participant: ParticipantId) {
        self.back.remove(&participant);
        if self.lost.len() >= LOST_MAX {
            self.lost.pop_first();
        }
        self.lost.insert(participant);
    }

    /// A participant has left the graph by itself.
    pub(crate) fn note_left(&mut self, participant: ParticipantId) {
        self.lost.remove(&participant);
        self.back.remove(&participant);
    }

    /// A participant is discovered.
    pub(crate) fn note_discovered(&mut self, now: Instant, participant: ParticipantId) {
        if self.lost.remove(&participant) {
            self.back.insert(participant, now);
        }
    }

    /// The participants that came back and have stayed, each once.
    pub(crate) fn take_stayed(&mut self, now: Instant) -> BTreeSet<ParticipantId> {
        let stays = |since: &Instant| now.saturating_duration_since(*since) >= GRACE;
        let stayed = self.back.iter().filter(|(_, since)| stays(since));
        let stayed = stayed.map(|(&participant, _)| participant).collect();
        self.back.retain(|_, since| !stays(since));
        stayed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: ParticipantId = ParticipantId(1);
    const OTHER: ParticipantId = ParticipantId(2);

    #[test]
    fn a_participant_counts_as_back_that_was_lost_came_again_and_stays() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut participants = ReturnedParticipants::default();
        participants.note_discovered(at(0), ONE);
        participants.note_discovered(at(0), OTHER);
        participants.note_lost(ONE);
        participants.note_discovered(at(100), ONE);
        participants.note_discovered(at(200), OTHER);
        assert_eq!(participants.take_stayed(at(3_099)), BTreeSet::new());
        assert_eq!(participants.take_stayed(at(3_100)), BTreeSet::from([ONE]));
        assert_eq!(participants.take_stayed(at(9_000)), BTreeSet::new());
    }

    #[test]
    fn a_participant_that_leaves_when_it_is_back_counts_no_more() {
        let start = Instant::now();
        let mut participants = ReturnedParticipants::default();
        participants.note_lost(ONE);
        participants.note_discovered(start, ONE);
        participants.note_left(ONE);
        participants.note_discovered(start, ONE);
        assert!(participants.take_stayed(start + GRACE).is_empty());
        participants.note_lost(OTHER);
        participants.note_left(OTHER);
        participants.note_discovered(start, OTHER);
        assert!(participants.take_stayed(start + GRACE).is_empty());
    }
}
