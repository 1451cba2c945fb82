//! `formation watch`: shows a formation that other processes run, and changes nothing.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use async_channel::{Receiver, Sender, bounded};
use formation_event_log::{POSE_INTERVAL, Recorder};
use formation_model::text::joined;
use formation_model::{Epoch, Message, ModuleSize, PlanningProblem, RosterMessage, SourceId};
use formation_msgs::Verdict;
use formation_node_support::find_sessions;
use formation_node_support::messages::{Received, subscribe_all, subscribe_verdicts};
use formation_offline::CheckedPlan;
use formation_verify::{Admission, Observer, ObserverParameters, Progress, SourceGuard};
use ros_runtime::environment::Environment;
use ros_runtime::exit::{Failure, stop_requested};
use ros_runtime::inputs::Inputs;
use ros_runtime::middleware::Middleware;
use ros_runtime::node::Node;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::service_mapping::RMW_IMPLEMENTATION;
use ros_runtime::settings::Settings;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_usize;

use super::display::Display;
use super::lines::{self, RunLine};
use super::{environment_of_runs, router, signal_name};
use crate::arguments::WatchArguments;
use crate::{console, joining};

const NODE_NAME: &str = "watch";

/// How long a formation is looked for.
const LOOK: Duration = Duration::from_secs(10);
/// Between two looks at the progress while messages come.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(50);
/// The processes of a formation that is silent for longer after a verdict have ended.
const ENDED_AFTER: Duration = Duration::from_secs(3);
/// How long a formation may be silent before a verdict: the network may be cut for a while.
const SILENCE_MAX: Duration = Duration::from_secs(30);

/// Shows a formation until its verdict.
///
/// # Errors
/// No formation is found, several are, its verdict is FAILED, it falls silent, or a signal ends the watch.
pub fn watch(arguments: &WatchArguments) -> Result<(), Failure> {
    let implementation = router::variable(RMW_IMPLEMENTATION);
    let middleware = Middleware::choose(arguments.middleware, implementation.as_deref());
    let middleware = middleware.check().map_err(Failure::bad_input)?;
    let environment = environment_of_runs(arguments.domain)?;
    let signal = Arc::new(AtomicUsize::new(0));
    for number in [SIGINT, SIGTERM] {
        register_usize(
            number,
            Arc::clone(&signal),
            usize::try_from(number).unwrap_or_default(),
        )?;
    }
    let stop = stop_requested()?;
    let settings = joining::settings(environment, middleware, &[])?;
    let found = find_sessions(&settings, LOOK, &stop)?;
    refuse_interruption(&signal)?;
    let (session, size) = chosen(found, arguments.session, environment, &settings)?;
    let parameters = [
        format!("session:={session}"),
        format!("module_size:={:?}", size.metres()),
    ];
    let settings = joining::settings(environment, middleware, &parameters)?;
    let mut display = match arguments.events {
        true => Display::Program,
        false => Display::watch(),
    };
    if display.is_program() {
        let domain = settings.environment.domain.number();
        lines::print(&RunLine::Place { domain, session });
    }
    display.set_name(&format!("session {session}"));
    let end = rejoining(|| observe(&settings, &mut display, &stop));
    display.finish();
    refuse_interruption(&signal)?;
    match (end?, arguments.events) {
        // Its verdict was printed.
        (Some(End::Judged(_)), true) => Ok(()),
        (end, _) => conclude(end),
    }
}

/// The session to watch, and the size of its modules.
fn chosen(
    found: BTreeMap<u64, ModuleSize>,
    named: Option<u32>,
    environment: Environment,
    settings: &Settings,
) -> Result<(u64, ModuleSize), Failure> {
    let place = format!(
        "domain {} and namespace {}",
        environment.domain, settings.namespace
    );
    let numbers = joined(found.keys(), ", ");
    let mut chosen = found
        .into_iter()
        .filter(|&(session, _)| named.is_none_or(|named| session == u64::from(named)));
    match (chosen.next(), chosen.next()) {
        (Some(only), None) => Ok(only),
        (Some(_), Some(_)) => Err(Failure::bad_input(format!(
            "{place} have formations of the sessions {numbers}; choose one with --session"
        ))),
        (None, _) if numbers.is_empty() => Err(Failure::failed(format!(
            "no formation sent a message within {} s in {place}, range {}; --domain and ROS_NAMESPACE say where it is, and \
             ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET reaches other machines",
            LOOK.as_secs(),
            environment.range
        ))),
        (None, _) => Err(Failure::bad_input(format!(
            "{place} have no formation of that session, but of {numbers}"
        ))),
    }
}

/// The end by a signal, if there was one.
fn refuse_interruption(signal: &AtomicUsize) -> Result<(), Failure> {
    match i32::try_from(signal.load(Ordering::Relaxed)) {
        Ok(signal) if signal != 0 => Err(Failure::Interrupted(
            format!(
                "watching was ended by {}; the formation goes on",
                signal_name(signal)
            ),
            signal,
        )),
        _ => Ok(()),
    }
}

/// Why a watch ended, unless it was interrupted.
enum End {
    /// With the verdict of a verifier.
    Judged(Box<Verdict>),
    /// No message came any more.
    Silent,
}

/// Prints the verdict.
fn conclude(end: Option<End>) -> Result<(), Failure> {
    let verdict = match end {
        Some(End::Judged(verdict)) => *verdict,
        Some(End::Silent) => {
            return Err(Failure::failed(format!(
                "no message came for {} s, and no verdict; the processes of the formation have ended or cannot be reached",
                SILENCE_MAX.as_secs()
            )));
        }
        // The event loop ends otherwise only when it is asked to.
        None => return Err(Failure::failed("the watch was ended")),
    };
    let Verdict {
        filled_spots,
        spots,
        ..
    } = verdict;
    let filled = format!("{filled_spots} of {spots} spots are filled");
    match verdict.outcome {
        Verdict::OUTCOME_COMPLETE => console::result_line(&format!("COMPLETE: {filled}")),
        Verdict::OUTCOME_PARTIAL => console::result_line(&format!("PARTIAL: {filled}")),
        _ => {
            console::result_line(&format!("FAILED: {filled}"))?;
            let reasons = verdict.violations.join("; ");
            Err(Failure::failed(format!("the formation failed: {reasons}")))
        }
    }
}

/// Observes until there is an end, or until `stop` yields.
fn observe(
    settings: &Settings,
    display: &mut Display,
    stop: &Receiver<()>,
) -> Result<Option<End>, RosContextError> {
    let parameters = settings.declare(NODE_NAME, Vec::new())?;
    let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
    let mut inputs = Inputs::default();
    for messages in subscribe_all(&mut ros, 1)? {
        inputs.add(messages, Input::Messages);
    }
    inputs.add(subscribe_verdicts(&mut ros)?, |verdict| {
        Input::Verdict(Box::new(verdict))
    });
    let mut planner = None;
    if display.is_view() {
        let (jobs, plans) = start_planner()?;
        inputs.add(plans, |(epoch, plan)| Input::Plan(epoch, plan));
        planner = Some(jobs);
    }
    let now = Instant::now();
    let mut watcher = Watcher {
        start: now,
        display,
        observer: Observer::new(ObserverParameters::default()),
        recorder: Recorder::new(POSE_INTERVAL),
        source_guard: SourceGuard::default(),
        planner,
        epoch: None,
        progress: None,
        look_at: Some(now),
        received: now,
        verdict: None,
        end: None,
    };
    ros.run(&mut watcher, inputs, stop)?;
    Ok(watcher.end)
}

type PlanJob = (Epoch, Arc<PlanningProblem>);
type Planned = (Epoch, Result<Arc<CheckedPlan>, String>);

/// Starts the thread that computes the offline plan for the roster of an epoch, the latest one that it is given.
fn start_planner() -> Result<(Sender<PlanJob>, Receiver<Planned>), RosContextError> {
    let (jobs, given) = bounded::<PlanJob>(1);
    let (planned, plans) = bounded(1);
    let plan_all = move || {
        while let Ok((epoch, problem)) = given.recv_blocking() {
            let plan = CheckedPlan::of_problem(problem).map(Arc::new);
            let plan = plan.map_err(|error| error.to_string());
            if planned.send_blocking((epoch, plan)).is_err() {
                return;
            }
        }
    };
    let failed =
        |error| RosContextError::Failed(format!("cannot start a thread for plans: {error}"));
    let thread = thread::Builder::new().name("plan".to_owned());
    thread.spawn(plan_all).map_err(failed)?;
    Ok((jobs, plans))
}

enum Input {
    Messages(Received),
    Verdict(Box<Verdict>),
    /// The offline plan for the roster of an epoch.
    Plan(Epoch, Result<Arc<CheckedPlan>, String>),
}

struct Watcher<'a> {
    start: Instant,
    display: &'a mut Display,
    observer: Observer,
    recorder: Recorder,
    source_guard: SourceGuard<SourceId>,
    /// What computes the offline plans, where a view shows them.
    planner: Option<Sender<PlanJob>>,
    /// The epoch whose roster is shown.
    epoch: Option<Epoch>,
    progress: Option<Progress>,
    /// When to look at the progress.
    look_at: Option<Instant>,
    /// When the last message was received.
    received: Instant,
    /// The latest verdict, which another may replace.
    verdict: Option<Verdict>,
    end: Option<End>,
}

impl Node for Watcher<'_> {
    type Input = Input;

    fn handle(&mut self, input: Input) {
        match input {
            Input::Messages(received) => self.handle_messages(&received),
            Input::Verdict(verdict) => {
                self.display.show_verdict((&*verdict).into());
                self.verdict = Some(*verdict);
            }
            Input::Plan(epoch, plan) if self.epoch == Some(epoch) => match plan {
                Ok(plan) => self.display.set_plan(plan),
                Err(reason) => self.display.note(&format!("no plan is shown: {reason}")),
            },
            Input::Plan(..) => {}
        }
        let soon = Instant::now() + PROGRESS_INTERVAL;
        self.look_at = Some(self.look_at.map_or(soon, |at| at.min(soon)));
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let now = Instant::now();
        if self.look_at.is_some_and(|at| at <= now) {
            self.look_at = None;
            self.show_progress();
        }
        if self.display.due().is_some_and(|due| due <= now) {
            self.display.refresh();
        }
        self.end = self.find_end(now);
        Ok(match self.end {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        let dues = [self.look_at, self.display.due(), Some(self.silent_at())];
        dues.into_iter().flatten().min()
    }
}

impl Watcher<'_> {
    fn handle_messages(&mut self, received: &Received) {
        self.received = Instant::now();
        for message in &received.messages {
            if self.source_guard.admit(received.source, message) == Admission::Accepted {
                self.take_in(message);
            }
            for message in self.source_guard.released() {
                self.take_in(&message);
            }
        }
    }

    fn take_in(&mut self, message: &Message) {
        let now = self.start.elapsed();
        self.observer.handle(now, message);
        for entry in self.recorder.record(now, message) {
            self.display.show_entry(&entry);
        }
        if let Message::Roster(RosterMessage::Plan(roster)) = message
            && self.epoch.is_none_or(|epoch| epoch < roster.epoch)
            && let Ok(Some(problem)) = roster.problem()
        {
            self.epoch = Some(roster.epoch);
            if !roster.target.name.is_empty() {
                self.display.set_name(&roster.target.name);
            }
            self.display.set_problem(Arc::clone(&problem));
            if let Some(planner) = &self.planner {
                // The thread lives as long as the watch, and drops a job that it has not begun for this one.
                let _ = planner.force_send((roster.epoch, problem));
            }
        }
    }

    fn show_progress(&mut self) {
        let progress = self.observer.progress();
        if self.progress.as_ref() != Some(&progress) {
            self.display.show_progress(&progress);
            self.progress = Some(progress);
        }
    }

    /// The verdict on the present epoch, if there is one.
    fn verdict(&self) -> Option<&Verdict> {
        let epoch = formation_msgs::Epoch::from(self.observer.current_epoch().as_ref());
        self.verdict
            .as_ref()
            .filter(|verdict| verdict.epoch == epoch)
    }

    /// When the silence of the formation means that it has ended, unless a message comes before.
    fn silent_at(&self) -> Instant {
        self.received
            + match self.verdict() {
                Some(_) => ENDED_AFTER,
                None => SILENCE_MAX,
            }
    }

    /// COMPLETE ends a formation for people. Other verdicts may be replaced while messages come.
    fn find_end(&self, now: Instant) -> Option<End> {
        let is_silent = now >= self.silent_at();
        if self.display.is_program() && !is_silent {
            return None;
        }
        match self.verdict() {
            Some(verdict) if is_silent || verdict.outcome == Verdict::OUTCOME_COMPLETE => {
                Some(End::Judged(Box::new(verdict.clone())))
            }
            Some(_) => None,
            None => is_silent.then_some(End::Silent),
        }
    }
}
