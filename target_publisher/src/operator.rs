//! Commands of an operator to all modules: stop, resume, and the report that bodies were taken away.
//!
//! `target_publisher --stop` gives one command and ends once the modules show it. The services of a target publisher that
//! stays give the same commands.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::model::text::listed_in_full;
use formation::model::{
    Heartbeat, Incarnation, MODULES_MAX, Message, ModuleId, NO_ID, Removal, RosterMessage, Stop,
};
use formation_msgs::{InSession, OperatorCommand, SessionId};
use formation_node::messages::{Received, session_of, subscribe_every_size};
use formation_node::{stamp, topics};
use ros_runtime::PublisherQueue;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::session::{Session, SessionError};
use ros_runtime::settings::Settings;

const NODE_NAME: &str = "operator";

/// The time in which the latest command that any module knows, and which modules there are, becomes known here.
const LISTENING: Duration = Duration::from_millis(1_500);
/// The time between two publications: a module may be discovered after the first.
const REPEAT: Duration = Duration::from_millis(500);
/// How long the report of a removal repeats. Rosters carry it on.
const REMOVAL_REPEATS: Duration = Duration::from_secs(3);
/// How long the modules have to appear and to show the command.
const PATIENCE: Duration = Duration::from_secs(15);
/// How long they have to appear where no other process is in the domain either: several discoveries, and a heartbeat of two
/// seconds.
const PATIENCE_ALONE: Duration = Duration::from_secs(3);

/// What is commanded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// All modules stand still, or may move again.
    Stop(bool),
    /// The bodies of these modules were taken away.
    Remove(BTreeSet<ModuleId>),
}

/// What is known of commands and runs, from the messages of modules.
#[derive(Debug, Default)]
pub(crate) struct Known {
    stop: Stop,
    runs: BTreeMap<ModuleId, Incarnation>,
}

impl Known {
    /// Takes in a message of a module.
    pub(crate) fn handle_message(&mut self, message: &Message) {
        match message {
            Message::Heartbeat(heartbeat) => {
                // Modules refuse a later one as well, and no command could follow the greatest.
                if heartbeat.stop.revision <= stamp::latest() {
                    self.stop = self.stop.max(heartbeat.stop);
                }
                self.note_run(heartbeat.module, heartbeat.incarnation);
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                for member in &roster.members {
                    self.note_run(member.module.id, member.incarnation);
                }
                for body in &roster.bodies {
                    self.note_run(body.module, body.incarnation);
                }
            }
            _ => {}
        }
    }

    fn note_run(&mut self, module: ModuleId, incarnation: Incarnation) {
        // More modules than a formation can have are invented.
        if self.runs.len() < MODULES_MAX || self.runs.contains_key(&module) {
            let known = self.runs.entry(module).or_insert(incarnation);
            *known = incarnation.max(*known);
        }
    }

    /// The command that takes precedence over all known ones; it is the latest from now on.
    pub(crate) fn next_stop(&mut self, stopped: bool) -> Result<Stop, String> {
        let known = self.stop.revision;
        let revision = known.checked_add(1).ok_or_else(|| {
            format!("revision {known} is the greatest there is, so no command follows it")
        })?;
        self.stop = Stop { revision, stopped };
        Ok(self.stop)
    }

    /// The report that the body of a module was taken away, in its latest known run.
    pub(crate) fn removal(&self, module: ModuleId) -> Removal {
        Removal {
            module,
            incarnation: self.runs.get(&module).copied(),
        }
    }
}

/// The commands of a target publisher's clients.
#[derive(Debug, Default)]
pub(crate) struct Commander {
    known: Known,
    removals: BTreeMap<ModuleId, Removal>,
}

impl Commander {
    /// Takes in a message of a module. Returns whether it shows a later command to stop or to resume: that one is published
    /// again, so that it outlives a restart of all modules.
    pub(crate) fn handle_message(&mut self, message: &Message) -> bool {
        let before = self.known.stop;
        self.known.handle_message(message);
        self.known.stop > before
    }

    /// Stops or resumes all modules. Says what will happen, or why nothing does.
    pub(crate) fn stop(&mut self, stopped: bool) -> Result<String, String> {
        let stop = self.known.next_stop(stopped)?;
        let revision = stop.revision;
        tracing::info!(revision, stopped, "gave a stop command");
        Ok(if stopped {
            "all modules stand still until they are resumed".to_owned()
        } else {
            "the modules move again".to_owned()
        })
    }

    /// Reports the body of a module as removed. Says what will happen, or why nothing does.
    pub(crate) fn remove(&mut self, module: u32, incarnation: u64) -> Result<String, String> {
        let module = ModuleId(module);
        if module.0 == NO_ID {
            return Err(format!("module_id: {NO_ID} is reserved and cannot be used"));
        }
        let mut removal = self.known.removal(module);
        if incarnation != 0 {
            removal.incarnation = Some(Incarnation(incarnation));
        }
        if removal.incarnation.is_none() {
            return Err(format!(
                "no message of {module} or of a roster that lists it was received; name the incarnation that is gone"
            ));
        }
        if self.removals.len() >= MODULES_MAX && !self.removals.contains_key(&module) {
            return Err(format!(
                "{MODULES_MAX} bodies were reported as removed already"
            ));
        }
        self.removals.insert(module, removal);
        tracing::info!(module = module.0, "reported a body as removed");
        Ok(format!(
            "the body of {module} blocks no spot any more; if its process still runs, it takes no part until it restarts"
        ))
    }

    /// Whether any command is in force.
    pub(crate) fn has_commands(&self) -> bool {
        self.known.stop.revision > 0 || !self.removals.is_empty()
    }

    /// All commands that are in force.
    pub(crate) fn sample(&self) -> OperatorCommand {
        OperatorCommand::new(self.known.stop, self.removals.values())
    }
}

/// Gives one command, and waits until the modules show it. Says what came of it.
///
/// # Errors
/// The ROS 2 graph could not be joined, or the modules did not show the command in time.
pub(crate) fn command(
    settings: &Settings,
    order: Order,
    stop: &Receiver<()>,
) -> Result<String, SessionError> {
    let parameters = settings.declare(NODE_NAME, Vec::new())?;
    let mut session = Session::join(settings, NODE_NAME, parameters)?;
    let mut inputs = Inputs::default();
    // A command applies to modules of any size.
    let heartbeats = subscribe_every_size(&mut session, &topics::HEARTBEATS)?;
    inputs.add(heartbeats, |one| one);
    let rosters = subscribe_every_size(&mut session, &topics::ROSTER)?;
    inputs.add(rosters, |one| one);
    let mut operator = Operator {
        order,
        place: place(settings, &session),
        session: session_of(&session),
        commands: session.publisher(&topics::COMMANDS)?,
        known: Known::default(),
        heartbeats: BTreeMap::new(),
        began: Instant::now(),
        first: None,
        given: None,
        due: Instant::now(),
        outcome: None,
    };
    session.run(&mut operator, inputs, stop)?;
    let interrupted = || Err("interrupted".to_owned());
    let outcome = operator.outcome.unwrap_or_else(interrupted);
    outcome.map_err(SessionError::Failed)
}

/// Where modules are sought, for people.
fn place(settings: &Settings, session: &Session) -> String {
    let sought = match session_of(session) {
        SessionId::EVERY => "any session".to_owned(),
        session => session.to_string(),
    };
    format!(
        "domain {}, namespace {}, {sought}",
        settings.environment.domain,
        session.identity().namespace
    )
}

struct Operator {
    order: Order,
    /// The domain, the namespace and the session, for people.
    place: String,
    /// The session to which the command applies; without one, it applies to every session.
    session: SessionId,
    commands: PublisherQueue<OperatorCommand>,
    known: Known,
    /// The latest heartbeat of each module.
    heartbeats: BTreeMap<ModuleId, Heartbeat>,
    began: Instant,
    /// When the first message of a module arrived.
    first: Option<Instant>,
    /// The command, once it was given, and when.
    given: Option<(OperatorCommand, Instant)>,
    due: Instant,
    outcome: Option<Result<String, String>>,
}

impl Node for Operator {
    type Input = Received;

    fn handle(&mut self, received: Received) {
        let now = Instant::now();
        for message in &received.messages {
            self.known.handle_message(message);
            if let Message::Heartbeat(heartbeat) = message {
                self.first.get_or_insert(now);
                let is_known = self.heartbeats.contains_key(&heartbeat.module);
                if is_known || self.heartbeats.len() < MODULES_MAX {
                    self.heartbeats.insert(heartbeat.module, *heartbeat);
                }
            }
        }
    }

    fn advance(&mut self, session: &mut Session) -> Result<ControlFlow<()>, SessionError> {
        let now = Instant::now();
        if now >= self.due {
            self.due = now + REPEAT;
            let patience = match session.has_subscribers() {
                true => PATIENCE,
                false => PATIENCE_ALONE,
            };
            self.outcome = self.pursue(now, patience);
        }
        Ok(match self.outcome {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        Some(self.due)
    }
}

impl Operator {
    /// Gives the command again, and judges whether it was taken; the outcome, if there is one.
    ///
    /// The modules have to appear within `patience`.
    fn pursue(&mut self, now: Instant, patience: Duration) -> Option<Result<String, String>> {
        let Some(first) = self.first else {
            return (now > self.began + patience).then(|| {
                Err(format!(
                    "no formation was found in {}: no heartbeat of a module came within {} s",
                    self.place,
                    patience.as_secs()
                ))
            });
        };
        let is_late = now > self.began + PATIENCE;
        if self.given.is_none() {
            if now < first + LISTENING {
                return None;
            }
            match self.make() {
                Ok(command) => self.given = Some((command, now)),
                Err(reason) => return Some(Err(reason)),
            }
        }
        let (command, given) = self.given.as_ref()?;
        self.commands
            .publish(command.clone().in_session(self.session));
        match &self.order {
            Order::Remove(modules) => {
                // The roster that lists the module may come from a convener that has yet to notice its death.
                let known = |module: &ModuleId| self.known.removal(*module).incarnation;
                let unknown = modules.iter().filter(|module| known(module).is_none());
                let unknown: Vec<ModuleId> = unknown.copied().collect();
                if unknown.is_empty() {
                    let modules = listed_in_full(modules.iter().copied());
                    let done = now > *given + REMOVAL_REPEATS;
                    return done.then(|| Ok(format!("reported the body of {modules} as removed")));
                }
                is_late.then(|| {
                    Err(format!(
                        "no message of {} came, nor a roster that lists it; is the number right?",
                        listed_in_full(unknown)
                    ))
                })
            }
            Order::Stop(stopped) => {
                let wanted = self.known.stop.revision;
                let is_repeated = now > *given + REPEAT;
                judge_stop(&self.heartbeats, wanted, *stopped, is_late)
                    .filter(|outcome| is_repeated || outcome.is_err())
            }
        }
    }

    fn make(&mut self) -> Result<OperatorCommand, String> {
        Ok(match &self.order {
            Order::Stop(stopped) => OperatorCommand::new(self.known.next_stop(*stopped)?, []),
            Order::Remove(modules) => {
                let live = modules.iter().copied();
                let live: Vec<ModuleId> = live
                    .filter(|module| self.heartbeats.contains_key(module))
                    .collect();
                if !live.is_empty() {
                    return Err(format!(
                        "heartbeats of {} arrive: end the processes before the bodies are reported as removed",
                        listed_in_full(live)
                    ));
                }
                let removals = modules.iter().map(|&module| self.known.removal(module));
                OperatorCommand::new(Stop::default(), &removals.collect::<Vec<_>>())
            }
        })
    }
}

/// Judges whether the modules show a command to stop or to resume; `None` while it may still come. A module that has fallen
/// silent since its heartbeat must not be taken for one that stands still.
fn judge_stop(
    heartbeats: &BTreeMap<ModuleId, Heartbeat>,
    revision: u64,
    stopped: bool,
    is_late: bool,
) -> Option<Result<String, String>> {
    let shows = |heartbeat: &Heartbeat| heartbeat.stop.revision >= revision;
    let (showing, lacking): (Vec<_>, Vec<_>) = heartbeats.values().partition(|one| shows(one));
    let listed = |those: Vec<&Heartbeat>| listed_in_full(those.iter().map(|one| one.module));
    let verb = if stopped { "stopped" } else { "resumed" };
    match (showing.is_empty(), lacking.is_empty()) {
        (false, true) => Some(Ok(format!("{verb} {}", listed(showing)))),
        _ if !is_late => None,
        (true, _) => Some(Err(format!(
            "no heartbeat of {} shows the command",
            listed(lacking)
        ))),
        (false, false) => Some(Err(format!(
            "no heartbeat of {} shows the command; {verb} {}",
            listed(lacking),
            listed(showing)
        ))),
    }
}

#[cfg(test)]
mod tests {
    use formation::model::ModulePhase;

    use super::*;

    #[test]
    fn a_command_follows_the_latest_that_is_known() {
        let mut known = Known::default();
        let stop = |revision, stopped| Stop { revision, stopped };
        assert_eq!(known.next_stop(true), Ok(stop(1, true)));
        known.stop = stop(7, true);
        assert_eq!(known.next_stop(false), Ok(stop(8, false)));
        known.stop.revision = u64::MAX;
        assert!(known.next_stop(true).is_err());
    }

    fn heartbeat_of(module: u32, revision: u64) -> Heartbeat {
        Heartbeat {
            module: ModuleId(module),
            incarnation: Incarnation(1),
            store: None,
            sequence: revision,
            uptime: Duration::ZERO,
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            steps_done: 0,
            phase: ModulePhase::Listening,
            stop: Stop {
                revision,
                stopped: revision > 0,
            },
        }
    }

    #[test]
    fn a_stop_holds_once_each_module_that_sent_a_heartbeat_shows_it() {
        let judged = |revisions: &[(u32, u64)], is_late| {
            let heartbeats = revisions
                .iter()
                .map(|&(module, revision)| (ModuleId(module), heartbeat_of(module, revision)));
            judge_stop(&heartbeats.collect(), 7, true, is_late)
        };
        let shown = Some(Ok("stopped modules 1-2".to_owned()));
        assert_eq!(judged(&[(1, 7), (2, 8)], false), shown);
        // Module 2 may have been cut off since: its heartbeat stays the latest.
        assert_eq!(judged(&[(1, 7), (2, 6)], false), None);
        let partly = "no heartbeat of module 2 shows the command; stopped module 1";
        assert_eq!(
            judged(&[(1, 7), (2, 6)], true),
            Some(Err(partly.to_owned()))
        );
        let none = "no heartbeat of modules 1-2 shows the command";
        assert_eq!(judged(&[(1, 6), (2, 6)], true), Some(Err(none.to_owned())));
    }

    #[test]
    fn a_stop_that_modules_show_is_published_again() {
        let heartbeat = |revision| Message::Heartbeat(heartbeat_of(4, revision));
        let mut commander = Commander::default();
        assert!(!commander.handle_message(&heartbeat(0)) && !commander.has_commands());
        assert!(commander.handle_message(&heartbeat(3)) && commander.has_commands());
        assert!(!commander.handle_message(&heartbeat(3)), "it is known");
        let forged = heartbeat(u64::MAX);
        assert!(
            !commander.handle_message(&forged),
            "no command could follow"
        );
        assert_eq!(commander.sample().stop.revision, 3);
        // A removal of a module of which nothing is known has to name the run.
        assert!(commander.remove(9, 0).is_err());
        assert!(commander.remove(9, 5).is_ok());
        assert_eq!(commander.sample().removals.len(), 1);
    }

    #[test]
    fn a_removal_names_the_latest_run_that_is_known() {
        let mut known = Known::default();
        let module = ModuleId(4);
        assert_eq!(known.removal(module).incarnation, None);
        known.note_run(module, Incarnation(7));
        known.note_run(module, Incarnation(5));
        assert_eq!(known.removal(module).incarnation, Some(Incarnation(7)));
    }
}
