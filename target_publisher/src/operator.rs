//! Commands of an operator to all modules: stop, resume, and the report that bodies were taken away.
//!
//! `target_publisher --stop` gives one command and ends once the modules show it. The services of a target publisher that
//! stays give the same commands.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::text::listed_in_full;
use formation_model::{
    Heartbeat, Incarnation, MODULES_MAX, Message, ModuleId, ModuleRun, Removal, RosterMessage,
    Stop, Timing,
};
use formation_msgs::{
    InSession, OperatorCommand, RemoveModuleRequest, RemoveModuleResponse, SessionId,
};
use formation_node_support::messages::{Received, session_of, subscribe_every_size};
use formation_node_support::removal_requests::{self, Request, Requests};
use formation_node_support::{stamp, topics};
use ros_runtime::PublisherQueue;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::ros_context::{RosContext, RosContextError};
use ros_runtime::service::Call;
use ros_runtime::settings::Settings;

const NODE_NAME: &str = "operator";

/// The time in which the latest command that any module knows, and which modules there are, becomes known here.
const LISTENING: Duration = Duration::from_millis(1_500);
/// The time between two publications: a module may be discovered after the first.
const REPEAT: Duration = Duration::from_millis(500);
/// How long the report of a removal repeats. Frozen states carry it on.
const REMOVAL_REPEATS: Duration = Duration::from_secs(3);
/// How long the modules have to appear and to show the command.
const PATIENCE: Duration = Duration::from_secs(15);
/// How long they have to appear where no other process is in the domain either: several discoveries, and a heartbeat of two
/// seconds.
const PATIENCE_ALONE: Duration = Duration::from_secs(3);

/// What is commanded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum OperatorOrder {
    /// All modules stand still, or may move again.
    Stop(bool),
    /// The bodies of these modules were taken away, and their votes are to go as well or not.
    Remove {
        modules: BTreeSet<ModuleId>,
        takes_vote: bool,
    },
}

/// What is known of commands and runs, from the messages of modules.
#[derive(Debug, Default)]
pub(crate) struct Known {
    stop: Stop,
    runs: BTreeMap<ModuleId, Incarnation>,
    /// The times of the latest roster.
    timing: Option<Timing>,
}

impl Known {
    /// Takes in a message of a module.
    /// Enforces H2.
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
                self.timing = Some(roster.timing);
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
        // Modules refuse later runs.
        if incarnation.0 > stamp::latest() {
            return;
        }
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

    /// The latest known run of a module.
    pub(crate) fn run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        let incarnation = self.runs.get(&module)?;
        Some(module.run(*incarnation))
    }
}

/// The commands of a target publisher's clients.
#[derive(Default)]
pub(crate) struct Commander {
    known: Known,
    /// The runs that were reported as removed and have not been heard since.
    removals: BTreeMap<ModuleId, Removal>,
    requests: Requests,
}

impl Commander {
    /// Takes in a message of a module. Returns whether the commands in force change: it shows a later one to stop or to resume, which
    /// is published again so that it outlives a restart of all modules, or that a module lives whose body was reported as removed.
    pub(crate) fn handle_message(&mut self, now: Duration, message: &Message) -> bool {
        let before = self.known.stop;
        self.known.handle_message(message);
        let mut is_over = false;
        if let Message::Heartbeat(heartbeat) = message {
            self.requests.refuse_living(now, heartbeat.module);
            is_over = self.removals.remove(&heartbeat.module).is_some();
        }
        self.known.stop > before || is_over
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

    /// Takes a request to report the body of a module as removed, which is answered after listening for the module.
    pub(crate) fn ask_removal(
        &mut self,
        now: Duration,
        call: Call<RemoveModuleRequest, RemoveModuleResponse>,
    ) {
        self.requests.add(now, self.known.timing, call);
    }

    /// Takes the requests for which it has listened. The sample holds those that it grants, and they are to be answered with these texts
    /// once that is published; the others are refused.
    pub(crate) fn report_removals(&mut self, now: Duration) -> Vec<(Request, String)> {
        let mut reported = Vec::new();
        for request in self.requests.take_due(now) {
            match self.report_removal(&request) {
                Ok(text) => reported.push((request, text)),
                Err(reason) => request.answer(Err(reason)),
            }
        }
        reported
    }

    fn report_removal(&mut self, request: &Request) -> Result<String, String> {
        let module = request.module;
        let run = request.resolve(self.known.run_of(module))?;
        if self.removals.len() >= MODULES_MAX && !self.removals.contains_key(&module) {
            return Err(format!(
                "{MODULES_MAX} bodies were reported as removed already"
            ));
        }
        self.removals.insert(module, Removal::of_body(run));
        Ok(removal_requests::were_reported([module], self.known.timing))
    }

    /// When the next request is due.
    pub(crate) fn due(&self) -> Option<Duration> {
        self.requests.due()
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
    order: OperatorOrder,
    stop: &Receiver<()>,
) -> Result<String, RosContextError> {
    let parameters = settings.declare(NODE_NAME, Vec::new())?;
    let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
    let mut inputs = Inputs::default();
    // A command applies to modules of any size.
    let heartbeats = subscribe_every_size(&mut ros, &topics::HEARTBEATS)?;
    inputs.add(heartbeats, |one| one);
    let rosters = subscribe_every_size(&mut ros, &topics::ROSTER)?;
    inputs.add(rosters, |one| one);
    let mut operator = Operator {
        order,
        place: place(settings, &ros),
        session: session_of(&ros),
        commands: ros.publisher(&topics::COMMANDS)?,
        known: Known::default(),
        heartbeats: BTreeMap::new(),
        began: Instant::now(),
        first: None,
        given: None,
        due: Instant::now(),
        outcome: None,
    };
    ros.run(&mut operator, inputs, stop)?;
    let interrupted = || Err("interrupted".to_owned());
    let outcome = operator.outcome.unwrap_or_else(interrupted);
    outcome.map_err(RosContextError::Failed)
}

/// Where modules are sought, for people.
fn place(settings: &Settings, ros: &RosContext) -> String {
    let sought = match session_of(ros) {
        SessionId::EVERY => "any session".to_owned(),
        session => session.to_string(),
    };
    format!(
        "domain {}, namespace {}, {sought}",
        settings.environment.domain,
        ros.identity().namespace
    )
}

struct Operator {
    order: OperatorOrder,
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
                    self.heartbeats.insert(heartbeat.module, heartbeat.clone());
                }
            }
        }
    }

    fn advance(&mut self, ros: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let now = Instant::now();
        if now >= self.due {
            self.due = now + REPEAT;
            let patience = match ros.has_subscribers() {
                Some(false) => PATIENCE_ALONE,
                Some(true) | None => PATIENCE,
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
            if now < first + self.listening() {
                return None;
            }
            match self.make(is_late)? {
                Ok(command) => self.given = Some((command, now)),
                Err(reason) => return Some(Err(reason)),
            }
        }
        let (command, given) = self.given.as_ref()?;
        self.commands
            .publish(command.clone().in_session(self.session));
        match &self.order {
            OperatorOrder::Remove { modules, .. } => {
                if let Some(reason) = self.are_alive(modules) {
                    return Some(Err(reason));
                }
                let timing = self.known.timing;
                let modules = modules.iter().copied();
                (now > *given + REMOVAL_REPEATS)
                    .then(|| Ok(removal_requests::were_reported(modules, timing)))
            }
            OperatorOrder::Stop(stopped) => {
                let wanted = self.known.stop.revision;
                let is_repeated = now > *given + REPEAT;
                judge_stop(&self.heartbeats, wanted, *stopped, is_late)
                    .filter(|outcome| is_repeated || outcome.is_err())
            }
        }
    }

    /// How long to listen before the command is given.
    fn listening(&self) -> Duration {
        match self.order {
            OperatorOrder::Stop(_) => LISTENING,
            OperatorOrder::Remove { .. } => removal_requests::listening(self.known.timing),
        }
    }

    /// The command, or why there is none; `None` while that is open.
    fn make(&mut self, is_late: bool) -> Option<Result<OperatorCommand, String>> {
        let (modules, takes_vote) = match &self.order {
            OperatorOrder::Stop(stopped) => {
                let stop = self.known.next_stop(*stopped);
                return Some(stop.map(|stop| OperatorCommand::new(stop, [])));
            }
            OperatorOrder::Remove {
                modules,
                takes_vote,
            } => (modules, *takes_vote),
        };
        if let Some(reason) = self.are_alive(modules) {
            return Some(Err(reason));
        }
        let runs = modules.iter().map(|&module| self.known.run_of(module));
        let removals = runs.flatten().map(|run| Removal { run, takes_vote });
        let removals: Vec<Removal> = removals.collect();
        if removals.len() == modules.len() {
            return Some(Ok(OperatorCommand::new(Stop::default(), &removals)));
        }
        // The roster that lists the module may come from a convener that has yet to notice its death.
        let unknown = modules.iter().copied();
        let unknown = unknown.filter(|&module| self.known.run_of(module).is_none());
        is_late.then(|| Err(removal_requests::are_unknown(unknown)))
    }

    /// That heartbeats of some of these modules arrived, if so.
    fn are_alive(&self, modules: &BTreeSet<ModuleId>) -> Option<String> {
        let alive = modules.iter().copied();
        let alive = alive.filter(|module| self.heartbeats.contains_key(module));
        let alive: Vec<ModuleId> = alive.collect();
        (!alive.is_empty()).then(|| removal_requests::are_alive(alive))
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
    use std::cell::RefCell;
    use std::rc::Rc;

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
            sequence: revision,
            stop: Stop {
                revision,
                stopped: revision > 0,
            },
            ..Heartbeat::first(ModuleId(module).run(Incarnation(1)))
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

    /// Shows H2.
    #[test]
    fn a_stop_that_modules_show_is_published_again() {
        let heartbeat = |revision| Message::Heartbeat(heartbeat_of(4, revision));
        let now = Duration::ZERO;
        let mut commander = Commander::default();
        assert!(!commander.handle_message(now, &heartbeat(0)) && !commander.has_commands());
        assert!(commander.handle_message(now, &heartbeat(3)) && commander.has_commands());
        assert!(!commander.handle_message(now, &heartbeat(3)), "it is known");
        let forged = heartbeat(u64::MAX);
        assert!(
            !commander.handle_message(now, &forged),
            "no command could follow"
        );
        assert_eq!(commander.sample().stop.revision, 3);
    }

    #[test]
    fn a_report_is_in_the_sample_after_listening_and_until_a_heartbeat_comes() {
        let answers = Rc::new(RefCell::new(Vec::new()));
        let call = |module_id, incarnation| {
            let answers = Rc::clone(&answers);
            Call {
                request: RemoveModuleRequest {
                    module_id,
                    incarnation,
                },
                reply: Box::new(move |answer: RemoveModuleResponse| {
                    answers.borrow_mut().push((module_id, answer.success));
                }),
            }
        };
        let mut commander = Commander::default();
        let heartbeat = |module| Message::Heartbeat(heartbeat_of(module, 0));
        for module in [4, 5] {
            commander.handle_message(Duration::ZERO, &heartbeat(module));
        }
        let second = Duration::from_secs(1);
        for (module, incarnation) in [(4, 0), (5, 0), (9, 0), (9, 5), (4, 2)] {
            commander.ask_removal(second, call(module, incarnation));
        }
        commander.handle_message(second * 2, &heartbeat(5));
        assert_eq!(*answers.borrow(), [(5, false)]);
        assert!(!commander.has_commands());
        let due = commander.due().unwrap();
        let reported = commander.report_removals(due);
        assert_eq!(
            *answers.borrow(),
            [(5, false), (9, false), (9, false), (4, false)]
        );
        let removals = commander.sample().removals;
        assert_eq!(
            removals
                .iter()
                .map(|one| (one.module_id, one.incarnation))
                .collect::<Vec<_>>(),
            [(4, 1)]
        );
        for (request, text) in reported {
            assert!(text.contains("takes effect in the next roster"), "{text}");
            request.answer(Ok(text));
        }
        assert_eq!(answers.borrow().last(), Some(&(4, true)));
        // A late module is not told of a removal that is over.
        assert!(commander.handle_message(due * 2, &heartbeat(4)));
        assert!(commander.sample().removals.is_empty());
    }

    #[test]
    fn a_removal_names_the_latest_run_that_is_known() {
        let mut known = Known::default();
        let module = ModuleId(4);
        assert_eq!(known.run_of(module), None);
        known.note_run(module, Incarnation(7));
        known.note_run(module, Incarnation(5));
        assert_eq!(known.run_of(module), Some(module.run(Incarnation(7))));
    }
}
