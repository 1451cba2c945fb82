//! The course of a formation, made of a recording as the verifier makes it of the topics.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use formation_event_log::{Entry, POSE_INTERVAL, Recorder};
use formation_model::{Message, PlanningProblem, RosterMessage};
use formation_msgs::{
    InterfaceType, ModuleStates, Roster, SessionId, SpotClaim, TargetConfiguration, Verdict,
};
use formation_node_support::messages::{Sample, decode};
use ros_runtime::cdr;

use crate::read::{FileSummary, Recorded, read};

/// What a recording shows.
#[derive(Clone, Debug, Default)]
pub struct Replay {
    /// What the file says apart from its samples.
    pub file: FileSummary,
    /// The number of samples of each topic.
    pub samples: BTreeMap<String, u64>,
    /// The time from the first sample to the last.
    pub duration: Duration,
    /// The samples that nodes of this build refuse.
    pub refused: u64,
    /// The session with the most entries.
    pub session: Option<SessionId>,
    /// What happened in that session, in the order of arrival; times count from the first sample of all.
    pub entries: Vec<Entry>,
    /// What its modules planned for: the roster with the most members.
    pub problem: Option<Arc<PlanningProblem>>,
    /// The last verdict on that session.
    pub verdict: Option<Verdict>,
}

/// The course of one session.
struct Course {
    recorder: Recorder,
    entries: Vec<Entry>,
    problem: Option<Arc<PlanningProblem>>,
    verdict: Option<Verdict>,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            recorder: Recorder::new(POSE_INTERVAL),
            entries: Vec::new(),
            problem: None,
            verdict: None,
        }
    }
}

impl Course {
    fn handle(&mut self, now: Duration, message: &Message) {
        self.entries.extend(self.recorder.record(now, message));
        if let Message::Roster(RosterMessage::Plan(roster)) = message
            && let Ok(Some(problem)) = roster.problem()
        {
            let modules = |problem: &PlanningProblem| problem.modules().len();
            let most = self.problem.as_ref().map_or(0, |problem| modules(problem));
            if modules(&problem) > most {
                self.problem = Some(problem);
            }
        }
    }
}

/// Reads a recording.
///
/// # Errors
/// The file cannot be opened, or is no MCAP file.
pub fn replay(path: &Path) -> io::Result<Replay> {
    let mut replay = Replay::default();
    let mut courses: BTreeMap<u64, Course> = BTreeMap::new();
    let mut begin = None;
    replay.file = read(path, |recorded| {
        let begin = *begin.get_or_insert(recorded.received_ns);
        let now = Duration::from_nanos(recorded.received_ns.saturating_sub(begin));
        replay.duration = replay.duration.max(now);
        *replay.samples.entry(recorded.topic.to_owned()).or_default() += 1;
        if is_of::<Verdict>(recorded) {
            match cdr::decoded::<Verdict>(recorded.bytes) {
                Ok(verdict) if verdict.judgement().is_ok() => {
                    let course = courses.entry(verdict.session).or_default();
                    course.verdict = Some(verdict);
                }
                Ok(_) | Err(_) => replay.refused += 1,
            }
        }
        match messages_of(recorded) {
            Some(Ok((session, messages))) => {
                let course = courses.entry(session.0).or_default();
                for message in &messages {
                    course.handle(now, message);
                }
            }
            Some(Err(_)) => replay.refused += 1,
            None => {}
        }
    })?;
    let longest = courses
        .into_iter()
        .max_by_key(|(_, course)| course.entries.len());
    if let Some((session, course)) = longest {
        replay.session = Some(SessionId(session));
        replay.entries = course.entries;
        replay.problem = course.problem;
        replay.verdict = course.verdict;
    }
    Ok(replay)
}

/// The messages of a sample of which entries are made; `None` if no entry is made of its topic.
fn messages_of(recorded: Recorded<'_>) -> Option<Result<(SessionId, Vec<Message>), String>> {
    decoded_as::<TargetConfiguration>(recorded)
        .or_else(|| decoded_as::<ModuleStates>(recorded))
        .or_else(|| decoded_as::<Roster>(recorded))
        .or_else(|| decoded_as::<SpotClaim>(recorded))
}

fn decoded_as<M: Sample + InterfaceType>(
    recorded: Recorded<'_>,
) -> Option<Result<(SessionId, Vec<Message>), String>> {
    is_of::<M>(recorded).then(|| decode::<M>(recorded.bytes))
}

fn is_of<M: InterfaceType>(recorded: Recorded<'_>) -> bool {
    let name = recorded.type_name.split_once("/msg/");
    name == Some((M::PACKAGE, M::NAME))
}
