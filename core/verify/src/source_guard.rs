//! Which process speaks for which module, as an observer determines it.
//!
//! The first process that speaks for a run of a module is taken to be that module's own; another participant may write
//! whatever it likes, but not under that process's participant. A roster counts if its writer speaks for the run of the
//! convener that the roster lists: what replays a recording or invents a roster is no agent of it.

use std::collections::BTreeMap;

use formation_model::{ClosedRoster, MODULES_MAX, Message, ModuleRun, RosterMember, RosterMessage};

/// At most this many runs are kept; of those that come after, nothing is known.
const RUNS_MAX: usize = 2 * MODULES_MAX;
/// At most this many messages wait until their writers have spoken for the modules that they come from.
const WAITING_MAX: usize = 4_096;

/// Whether a message counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// It counts.
    Accepted,
    /// No process has spoken for the module that it comes from yet; [`SourceGuard::released`] returns it once its writer has.
    Waiting,
    /// Another process speaks for the module that it comes from, or no member of the roster is its convener.
    Refused,
}

/// The processes that speak for each run of a module: those that publish its states and heartbeats. `S` identifies a process.
#[derive(Clone, Debug)]
pub struct SourceGuard<S> {
    runs: BTreeMap<ModuleRun, S>,
    /// Claims and rosters of runs for which no process has spoken.
    waiting: Vec<(S, ModuleRun, Message)>,
    /// Whether a process has spoken for a run for the first time since messages were released.
    has_news: bool,
}

impl<S> Default for SourceGuard<S> {
    fn default() -> Self {
        Self {
            runs: BTreeMap::new(),
            waiting: Vec::new(),
            has_news: false,
        }
    }
}

impl<S: Copy + Ord> SourceGuard<S> {
    /// Whether the message counts: no other process speaks for the module that it comes from.
    pub fn admit(&mut self, source: S, message: &Message) -> Admission {
        let run = match message {
            Message::ModuleState(state) => state.module.run(state.incarnation),
            Message::Heartbeat(heartbeat) => heartbeat.module.run(heartbeat.incarnation),
            Message::Claim(claim) => {
                return self.admit_from(source, claim.claimant.run(claim.incarnation), message);
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                return match convener_of(roster) {
                    Some(run) => self.admit_from(source, run, message),
                    None => Admission::Refused,
                };
            }
            // These decide nothing for an observer, or any process may publish them.
            Message::Roster(RosterMessage::Gather { .. })
            | Message::Eviction(_)
            | Message::OtherSessionState(_)
            | Message::Stop(_)
            | Message::Removal(_)
            | Message::Target(_) => return Admission::Accepted,
        };
        if self.runs.len() >= RUNS_MAX && !self.runs.contains_key(&run) {
            return Admission::Accepted;
        }
        let has_news = &mut self.has_news;
        let speaker = *self.runs.entry(run).or_insert_with(|| {
            *has_news = true;
            source
        });
        match speaker == source {
            true => Admission::Accepted,
            false => Admission::Refused,
        }
    }

    /// Whether a message of a run counts that does not show by itself which process is the run's own.
    fn admit_from(&mut self, source: S, run: ModuleRun, message: &Message) -> Admission {
        match self.runs.get(&run) {
            Some(&speaker) if speaker == source => Admission::Accepted,
            None if self.waiting.len() < WAITING_MAX => {
                self.waiting.push((source, run, message.clone()));
                Admission::Waiting
            }
            _ => Admission::Refused,
        }
    }

    /// The messages that waited for writers that have spoken since, in the order in which they came.
    pub fn released(&mut self) -> Vec<Message> {
        let mut released = Vec::new();
        if std::mem::take(&mut self.has_news) {
            for (source, run, message) in std::mem::take(&mut self.waiting) {
                match self.runs.get(&run) {
                    Some(&speaker) if speaker == source => released.push(message),
                    Some(_) => {}
                    None => self.waiting.push((source, run, message)),
                }
            }
        }
        released
    }
}

/// The run of the convener that a roster lists.
fn convener_of(roster: &ClosedRoster) -> Option<ModuleRun> {
    RosterMember::find(&roster.members, roster.epoch.convener).map(RosterMember::run)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use formation_model::{Decision, Epoch, Incarnation, ModuleId, ModuleState, Pose, SpotClaim};

    const OWN: u32 = 1;
    const OTHER: u32 = 2;

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

    fn state(module: u32, incarnation: u64) -> Message {
        let run = ModuleId(module).run(Incarnation(incarnation));
        let pose = Pose::from_units(0.0, 0.0, 0.0).unwrap();
        Message::ModuleState(Arc::new(ModuleState::standing(run, pose)))
    }

    #[test]
    fn the_first_that_speaks_for_a_run_is_believed_and_no_other() {
        let mut guard = SourceGuard::default();
        assert_eq!(guard.admit(OWN, &state(4, 7)), Admission::Accepted);
        assert_eq!(guard.admit(OTHER, &state(4, 7)), Admission::Refused);
        assert_eq!(guard.admit(OTHER, &claim(4, 7)), Admission::Refused);
        assert_eq!(guard.admit(OWN, &claim(4, 7)), Admission::Accepted);
        let later = guard.admit(OTHER, &state(4, 8));
        assert_eq!(later, Admission::Accepted, "a later run is another's");
        let hosted = guard.admit(OWN, &state(5, 7));
        assert_eq!(hosted, Admission::Accepted, "a process may host several");
    }

    #[test]
    fn claims_of_unknown_runs_wait_until_their_writer_speaks_for_the_run() {
        let mut guard = SourceGuard::default();
        assert_eq!(guard.admit(OTHER, &claim(4, 7)), Admission::Waiting);
        assert_eq!(guard.admit(OWN, &claim(4, 7)), Admission::Waiting);
        assert_eq!(guard.admit(OWN, &claim(5, 7)), Admission::Waiting);
        assert_eq!(guard.released(), []);
        assert_eq!(guard.admit(OWN, &state(4, 7)), Admission::Accepted);
        assert_eq!(guard.released(), [claim(4, 7)], "that of its own process");
        assert_eq!(guard.admit(OWN, &state(5, 7)), Admission::Accepted);
        assert_eq!(guard.released(), [claim(5, 7)]);
    }
}
