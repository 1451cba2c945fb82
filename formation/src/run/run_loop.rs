//! One run, from the first process to the verdict.

use std::collections::BTreeSet;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

use formation_model::ModuleId;
use formation_model::text::listed_in_full;
use formation_motion::WorldReport;
use formation_verifier_lines::{AgreementReport, ReportLine, VerdictReport};
use formation_verify::{Outcome, Progress};

use super::attendance::Attendance;
use super::display::Display;
use super::operator;
use super::operator_commands::Orders;
use super::recording::Recording;
use super::roles::{Death, Deaths, ProcessRoles};
use super::supervisor::{ProcessEvent, ProcessId, ProcessOutput, Supervisor};
use super::view::Key;

/// After its verdict, the verifier stays for this long, so that subscribers of its topic receive the verdict.
const LINGER: Duration = Duration::from_millis(500);

/// What the verifier found.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a run has one, so its size does not matter"
)]
pub enum Judgement {
    /// A verdict on the formation.
    Verdict(VerdictReport),
    /// All modules hold the same plan, and none was to move.
    Agreement(AgreementReport),
}

/// How a run ended.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a run has one, so its size does not matter"
)]
pub enum RunEnd {
    /// The verifier has judged.
    Judged(Judgement),
    /// A process ended without which the run cannot continue.
    ProcessEnded(ProcessId, ExitStatus),
    /// All processes of modules ended, this one last.
    NoAgentLeft(ProcessId, ExitStatus),
    /// A signal asked the launcher to end.
    Interrupted(i32),
    /// The time was up.
    TimedOut,
    /// The program that attended the run has ended its orders.
    Dismissed,
}

/// What was observed of a run.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    /// The latest progress.
    pub progress: Option<Progress>,
    /// How long after the start the last module had joined.
    pub discovery: Option<Duration>,
    /// The event log.
    pub recording: Recording,
    /// The processes that ended while the run continued.
    pub deaths: Deaths,
    /// What the physical world counted, if there is one.
    pub world: Option<WorldReport>,
    /// Whether the time was up before a verdict was final.
    pub timed_out: bool,
}

/// Watches the processes until the verifier has judged, something failed, or the time is up.
///
/// The run continues when a process of modules ends. A verdict that relies on such a module is set aside: the verifier,
/// which finds the module silent later, will retract it and give another. PARTIAL is set aside as well while the roster
/// leaves out modules whose processes run: they may be cut off, and join later.
pub struct RunLoop<'a> {
    /// The processes.
    pub supervisor: &'a mut Supervisor,
    /// Their roles.
    pub roles: ProcessRoles,
    /// How many modules take part.
    pub modules: usize,
    /// When the first process was started.
    pub start: Instant,
    /// When to stop waiting for the verdict.
    pub deadline: Instant,
    /// How long to wait from a command to stop all modules, and from the command to resume.
    pub patience: Duration,
    /// Where the run is shown.
    pub display: &'a mut Display,
    /// What was observed so far.
    pub observed: Observed,
    /// Makes the commands that give orders to the modules.
    pub orders: Orders<'a>,
    /// The processes that give them.
    pub order_givers: BTreeSet<ProcessId>,
    /// What carries out the orders of a program, where one attends the run.
    pub attendance: Option<Attendance<'a>>,
}

impl RunLoop<'_> {
    /// Runs to the end.
    pub fn run(mut self) -> (RunEnd, Observed) {
        let end = self.run_until_the_end();
        if let RunEnd::Judged(_) = end {
            self.display.refresh();
            self.linger();
        }
        (end, self.observed)
    }

    fn run_until_the_end(&mut self) -> RunEnd {
        let mut set_aside = None;
        loop {
            self.take_key();
            let due = self.display.due();
            let wake = due.map_or(self.deadline, |due| due.min(self.deadline));
            let end = match self.supervisor.next(wake) {
                ProcessEvent::Line(process, line) if process == self.roles.verifier => {
                    self.take_line(&line, &mut set_aside)
                }
                ProcessEvent::Line(process, line) => {
                    self.take_other_line(process, &line);
                    None
                }
                ProcessEvent::Exited(process, status) => self.take_exit(process, status),
                ProcessEvent::Order(line) => {
                    self.take_order(&line);
                    None
                }
                ProcessEvent::OrdersEnded => Some(RunEnd::Dismissed),
                ProcessEvent::Interrupted(signal) => Some(RunEnd::Interrupted(signal)),
                ProcessEvent::TimedOut => {
                    self.display.refresh();
                    None
                }
            };
            if let Some(end) = end {
                return end;
            }
            if Instant::now() >= self.deadline {
                return self.end_late(set_aside);
            }
        }
    }

    /// Time is up: judges by the verdict that was set aside, if there is one.
    fn end_late(&mut self, set_aside: Option<VerdictReport>) -> RunEnd {
        self.observed.timed_out = true;
        set_aside.map_or(RunEnd::TimedOut, |verdict| {
            let outcome = match self.relies_on_the_dead(&verdict) {
                true => Outcome::Failed,
                false => verdict.outcome,
            };
            RunEnd::Judged(Judgement::Verdict(VerdictReport { outcome, ..verdict }))
        })
    }

    /// Takes in a line of the verifier.
    fn take_line(&mut self, line: &str, set_aside: &mut Option<VerdictReport>) -> Option<RunEnd> {
        match serde_json::from_str(line) {
            Ok(ReportLine::Progress(mut progress)) => {
                progress.expected = Some(self.modules);
                if progress.joined >= self.modules {
                    let discovery = &mut self.observed.discovery;
                    discovery.get_or_insert_with(|| self.start.elapsed());
                }
                self.display.show_progress(&progress);
                let last = self.observed.progress.as_ref();
                if progress.stopped != last.is_some_and(|last| last.stopped) {
                    self.deadline = Instant::now() + self.patience;
                }
                self.observed.progress = Some(progress);
                None
            }
            Ok(ReportLine::Entry(entry)) => {
                self.display.show_entry(&entry);
                self.observed.recording.keep(entry);
                None
            }
            Ok(ReportLine::Agreement(agreement)) => {
                Some(RunEnd::Judged(Judgement::Agreement(agreement)))
            }
            Ok(ReportLine::Verdict(verdict)) => {
                let may_change = match verdict.outcome {
                    Outcome::Failed => set_aside.is_some(),
                    Outcome::Complete => self.relies_on_the_dead(&verdict),
                    Outcome::Partial | Outcome::NotJudged => {
                        self.relies_on_the_dead(&verdict) || self.leaves_out_the_living(&verdict)
                    }
                };
                let is_attended = self.attendance.is_some();
                if may_change && !(is_attended && verdict.outcome == Outcome::Failed) {
                    *set_aside = Some(verdict);
                    return None;
                }
                if is_attended {
                    self.display.show_verdict((&verdict).into());
                    return None;
                }
                Some(RunEnd::Judged(Judgement::Verdict(verdict)))
            }
            Err(error) => {
                self.display.note(&format!(
                    "warning: the verifier wrote a line that cannot be read ({error}): {line}"
                ));
                None
            }
        }
    }

    /// Takes in a line of another process: the world reports what it counts.
    fn take_other_line(&mut self, process: ProcessId, line: &str) {
        if self.roles.world != Some(process) {
            return;
        }
        match serde_json::from_str(line) {
            Ok(report) => self.observed.world = Some(report),
            Err(error) => self.display.note(&format!(
                "warning: the world wrote a line that cannot be read ({error}): {line}"
            )),
        }
    }

    /// Whether a verdict counts on a module whose process ended, which the verifier may not have found yet, or on a body whose
    /// removal is reported while a spare could take its spot.
    fn relies_on_the_dead(&self, verdict: &VerdictReport) -> bool {
        let dead = self.observed.deaths.modules();
        let mut settled = verdict.assignments.iter();
        let mut blocked = verdict.blocked_spots.iter();
        let roster = verdict
            .epoch
            .and_then(|epoch| self.observed.recording.roster(epoch));
        let out_of_service = roster.map_or(&[][..], |roster| roster.out_of_service);
        let mut unassigned = verdict.unassigned.iter();
        settled.any(|assignment| dead.contains(&assignment.module))
            || self.orders.bodies_vanish
                && blocked.any(|blocked| dead.contains(&blocked.module))
                && unassigned.any(|spare| !dead.contains(spare) && !out_of_service.contains(spare))
    }

    /// Reports the bodies of these modules as removed: simulated robots vanish with their process, and their votes with them, as that
    /// has ended for sure.
    fn report_removal(&mut self, modules: &[ModuleId]) {
        if self.orders.bodies_vanish && !modules.is_empty() {
            let name = format!(
                "the report that {} vanished",
                listed_in_full(modules.iter().copied())
            );
            let modules: Vec<u32> = modules.iter().map(|module| module.0).collect();
            self.give(&name, &operator::removal(&modules, true));
        }
    }

    /// Gives the order that was asked for by a key.
    fn take_key(&mut self) {
        match self.display.key() {
            Some(Key::Stop) => self.give("the order to stop", &[operator::STOP.to_owned()]),
            Some(Key::Resume) => {
                self.give("the order to resume", &[operator::RESUME.to_owned()]);
            }
            None => {}
        }
    }

    /// Starts the process that gives an order.
    pub(super) fn give(&mut self, name: &str, order: &[String]) {
        let mut command = (self.orders.command)(order);
        let started =
            self.supervisor
                .start(name.to_owned(), &mut command, ProcessOutput::Discarded);
        match started {
            Ok(process) => {
                self.order_givers.insert(process);
            }
            Err(error) => self
                .display
                .note(&format!("warning: cannot start {name}: {error}")),
        }
    }

    /// Whether spots are open and modules whose processes run are not members.
    fn leaves_out_the_living(&self, verdict: &VerdictReport) -> bool {
        let roster = verdict
            .epoch
            .and_then(|epoch| self.observed.recording.roster(epoch));
        let dead = self.observed.deaths.modules();
        let mut living = self.roles.modules().filter(|module| !dead.contains(module));
        roster.is_some_and(|roster| {
            !verdict.open_spots.is_empty() && living.any(|module| !roster.modules.contains(&module))
        })
    }

    fn take_exit(&mut self, process: ProcessId, status: ExitStatus) -> Option<RunEnd> {
        if self.order_givers.remove(&process) {
            if !status.success() {
                let name = self.supervisor.name(process);
                let said = self.supervisor.last_lines(process).last();
                let said = said.map_or_else(String::new, |line| format!(": {line}"));
                self.display
                    .note(&format!("warning: {name} ended with {status}{said}"));
            }
            return None;
        }
        if self.take_ordered_exit(process) {
            return None;
        }
        let all_joined = self.observed.discovery.is_some();
        let target_is_known = self
            .observed
            .progress
            .as_ref()
            .is_some_and(Progress::knows_target);
        let roles = &self.roles;
        if !roles.can_continue_without(process, status, all_joined, target_is_known) {
            return Some(RunEnd::ProcessEnded(process, status));
        }
        let death = Death {
            name: self.supervisor.name(process).to_owned(),
            modules: roles.agents.get(&process).cloned().unwrap_or_default(),
            status,
            after: self.start.elapsed(),
        };
        self.display
            .note(&format!("{death}; the run continues without it"));
        self.display.show_process(&death.modules, false);
        self.report_removal(&death.modules);
        let deaths = &mut self.observed.deaths;
        deaths.push(death);
        (deaths.of_agents() == self.roles.agents.len())
            .then_some(RunEnd::NoAgentLeft(process, status))
    }

    fn linger(&mut self) {
        let deadline = Instant::now() + LINGER;
        while Instant::now() < deadline {
            match self.supervisor.next(deadline) {
                ProcessEvent::Exited(process, _) if process == self.roles.verifier => break,
                ProcessEvent::TimedOut | ProcessEvent::Interrupted(_) => break,
                ProcessEvent::Line(process, line) => self.take_other_line(process, &line),
                ProcessEvent::Exited(..) | ProcessEvent::Order(_) | ProcessEvent::OrdersEnded => {}
            }
        }
    }
}

#[cfg(test)]
mod tests;
