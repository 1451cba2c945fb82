//! Starting, watching and stopping processes.
//!
//! One thread owns all state: readers of the processes' output and the signal handler only send inputs to it. A process
//! is thus signalled only while it was not waited for, and its number cannot belong to another process.

use std::collections::VecDeque;
use std::io::{self, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use ros_runtime::exit::{EndRequest, EndSignals};
use rustix::process::{Pid, Signal, kill_process};
use signal_hook::consts::SIGCHLD;
use signal_hook::iterator::{Handle, Signals};

use super::tail::{LINE_BYTES_MAX, Tail, for_each_line};

/// How many inputs may wait for the owning thread. When there are more, the readers block, and so do the processes.
const INPUTS_MAX: usize = 1_024;
/// A longer order is cut, and then refused.
const ORDER_BYTES_MAX: u64 = 64 * 1024;
/// A line of results lists every module, so it may be long.
const RESULT_BYTES_MAX: u64 = 16 * 1024 * 1024;
/// How long the rest of the output is awaited after an exit; a grandchild may hold the pipe open without end.
const OUTPUT_GRACE: Duration = Duration::from_millis(500);
/// How long the kernel may take to end a process after SIGKILL.
const KILL_WAIT: Duration = Duration::from_secs(2);

/// The level of an error in the log of our programs, whose lines are `TIME LEVEL MESSAGE`.
const ERROR_LEVEL: &str = "ERROR";

/// Which process, in the order in which they were started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ProcessId(usize);

#[cfg(test)]
impl ProcessId {
    /// Different ones.
    pub fn some<const COUNT: usize>() -> [Self; COUNT] {
        std::array::from_fn(Self)
    }
}

/// What is done with a process' standard output; the last lines of its error output are always kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessOutput {
    /// It carries results, line by line.
    Results,
    /// It is dropped.
    Discarded,
}

/// What happened to the processes.
#[derive(Debug, PartialEq, Eq)]
pub enum ProcessEvent {
    /// A process wrote a line of results.
    Line(ProcessId, String),
    /// A process ended; all its output was read before.
    Exited(ProcessId, ExitStatus),
    /// A line of the standard input.
    Order(String),
    /// The standard input has ended.
    OrdersEnded,
    /// A signal asks the launcher to end.
    Interrupted(i32),
    /// Nothing happened until the deadline.
    TimedOut,
}

enum Input {
    Result(ProcessId, String),
    Error(ProcessId, String),
    Closed(ProcessId),
    Order(String),
    OrdersEnded,
    Signal(i32),
}

struct Supervised {
    name: String,
    child: Child,
    tail: Tail,
    /// The lines that it logged as errors.
    errors: Tail,
    open_streams: usize,
    exit: Option<(ExitStatus, Instant)>,
}

impl ProcessEvent {
    fn is_end_of(&self, process: ProcessId) -> bool {
        matches!(self, Self::Exited(ended, _) if *ended == process)
    }
}

/// Owns all processes; dropping it kills those that still run.
pub struct Supervisor {
    processes: Vec<Supervised>,
    inputs: Receiver<Input>,
    sender: SyncSender<Input>,
    signals: Handle,
    /// The signals that asked the launcher to end.
    received: EndSignals,
    pending: VecDeque<ProcessEvent>,
}

impl Supervisor {
    /// Begins to watch; from now on `ending_signals` do not end the launcher but are reported.
    ///
    /// # Errors
    /// Returns what the system says if signals cannot be handled.
    pub fn new(ending_signals: &[i32]) -> io::Result<Self> {
        let (sender, inputs) = sync_channel(INPUTS_MAX);
        let mut signals = Signals::new(ending_signals.iter().chain(&[SIGCHLD]))?;
        let handle = signals.handle();
        let to_owner = sender.clone();
        spawn_thread("signals".to_owned(), move || {
            for signal in signals.forever() {
                if to_owner.send(Input::Signal(signal)).is_err() {
                    break;
                }
            }
        })?;
        Ok(Self {
            processes: Vec::new(),
            inputs,
            sender,
            signals: handle,
            received: EndSignals::default(),
            pending: VecDeque::new(),
        })
    }

    /// Starts a process, with a name for messages to people.
    ///
    /// # Errors
    /// Returns what the system says if it cannot be started.
    pub fn start(
        &mut self,
        name: String,
        command: &mut Command,
        output: ProcessOutput,
    ) -> io::Result<ProcessId> {
        let stdout = match output {
            ProcessOutput::Results => Stdio::piped(),
            ProcessOutput::Discarded => Stdio::null(),
        };
        let mut child = command
            .stdin(Stdio::null())
            .stdout(stdout)
            .stderr(Stdio::piped())
            .spawn()?;
        let process = ProcessId(self.processes.len());
        let (results, errors) = (child.stdout.take(), child.stderr.take());
        // Owned from here on, so that an error below cannot leave it running.
        self.processes.push(Supervised {
            name,
            child,
            tail: Tail::default(),
            errors: Tail::default(),
            open_streams: 0,
            exit: None,
        });
        if let Some(results) = results {
            self.read(process, results, RESULT_BYTES_MAX, Input::Result)?;
        }
        if let Some(errors) = errors {
            self.read(process, errors, LINE_BYTES_MAX, Input::Error)?;
        }
        Ok(process)
    }

    fn read(
        &mut self,
        process: ProcessId,
        source: impl Read + Send + 'static,
        bytes_max: u64,
        input: fn(ProcessId, String) -> Input,
    ) -> io::Result<()> {
        let sender = self.sender.clone();
        spawn_thread(format!("reader {}", process.0), move || {
            let send = |input| sender.send(input).is_ok();
            // An error of the pipe ends the output; the exit status says the rest.
            let _ = for_each_line(BufReader::new(source), bytes_max, |line| {
                send(input(process, line))
            });
            send(Input::Closed(process));
        })?;
        self.processes[process.0].open_streams += 1;
        Ok(())
    }

    /// Begins to read orders from the standard input.
    ///
    /// # Errors
    /// Returns what the system says if no thread can be started.
    pub fn read_orders(&mut self) -> io::Result<()> {
        let sender = self.sender.clone();
        spawn_thread("orders".to_owned(), move || {
            // An error of the input ends it.
            let _ = for_each_line(io::stdin().lock(), ORDER_BYTES_MAX, |line| {
                sender.send(Input::Order(line)).is_ok()
            });
            let _ = sender.send(Input::OrdersEnded);
        })
    }

    /// Ends a process as a crash would; `false` if it has ended already.
    pub fn kill(&mut self, process: ProcessId) -> bool {
        let supervised = &mut self.processes[process.0];
        supervised.exit.is_none() && supervised.child.kill().is_ok()
    }

    /// Asks a process to end; `false` if it has ended already.
    pub fn terminate(&mut self, process: ProcessId) -> bool {
        let supervised = &self.processes[process.0];
        let pid = Pid::from_child(&supervised.child);
        // It was not waited for, so the number is still its own.
        supervised.exit.is_none() && kill_process(pid, Signal::TERM).is_ok()
    }

    /// The name of a process in messages to people.
    pub fn name(&self, process: ProcessId) -> &str {
        &self.processes[process.0].name
    }

    /// The last lines of a process' error output, oldest first.
    pub fn last_lines(&self, process: ProcessId) -> impl Iterator<Item = &str> {
        self.processes[process.0].tail.lines()
    }

    /// The lines that processes logged as errors, each with the name of its process.
    pub fn errors(&self) -> impl Iterator<Item = (&str, &str)> {
        self.processes.iter().flat_map(|process| {
            let lines = process.errors.lines();
            lines.map(|line| (process.name.as_str(), line))
        })
    }

    /// Waits for the next thing to happen, at most until `deadline`.
    ///
    /// The end of a process waits for the rest of its output, and what others write after it waits with it: it must not seem to
    /// be earlier.
    pub fn next(&mut self, deadline: Instant) -> ProcessEvent {
        let mut has_looked = false;
        loop {
            let now = Instant::now();
            let output_until = self.awaits_output_until();
            if output_until.is_none_or(|until| until <= now)
                && let Some(happening) = self.pending.pop_front()
            {
                return happening;
            }
            // Processes that write errors without end must not prolong it.
            if has_looked && now >= deadline {
                return ProcessEvent::TimedOut;
            }
            has_looked = true;
            let until = output_until.map_or(deadline, |until| until.min(deadline));
            let input = self
                .inputs
                .recv_timeout(until.saturating_duration_since(now));
            if let Ok(input) = input {
                self.take(input);
            }
        }
    }

    /// Lets time pass, and keeps what happens meanwhile for [`Self::next`]; `false` as soon as a signal asks the launcher to
    /// end.
    pub fn pause(&mut self, pause: Duration) -> bool {
        let deadline = Instant::now() + pause;
        let mut kept = VecDeque::new();
        let mut is_interrupted = false;
        // A process that writes without end must not prolong it.
        while !is_interrupted && Instant::now() < deadline {
            let event = self.next(deadline);
            is_interrupted = matches!(event, ProcessEvent::Interrupted(_));
            if event != ProcessEvent::TimedOut {
                kept.push_back(event);
            }
        }
        kept.append(&mut self.pending);
        self.pending = kept;
        !is_interrupted
    }

    fn take(&mut self, input: Input) {
        match input {
            Input::Result(process, line) => {
                let mut events = self.pending.iter();
                let end = events.position(|event| event.is_end_of(process));
                let position = end.unwrap_or(self.pending.len());
                let line = ProcessEvent::Line(process, line);
                self.pending.insert(position, line);
            }
            Input::Error(process, line) => {
                let supervised = &mut self.processes[process.0];
                if line.split_whitespace().nth(1) == Some(ERROR_LEVEL) {
                    supervised.errors.push(line.clone());
                }
                supervised.tail.push(line);
            }
            Input::Closed(process) => self.processes[process.0].open_streams -= 1,
            Input::Order(line) => self.pending.push_back(ProcessEvent::Order(line)),
            Input::OrdersEnded => self.pending.push_back(ProcessEvent::OrdersEnded),
            Input::Signal(SIGCHLD) => self.reap(),
            Input::Signal(signal) => {
                // One that repeats the first must not cut the end of the processes short.
                if self.received.receive(Instant::now()) != EndRequest::Repeated {
                    self.pending.push_front(ProcessEvent::Interrupted(signal));
                }
            }
        }
    }

    fn alive(&mut self) -> impl Iterator<Item = &mut Supervised> {
        let processes = self.processes.iter_mut();
        processes.filter(|process| process.exit.is_none())
    }

    /// Checks every process, as several may exit with one SIGCHLD.
    fn reap(&mut self) {
        let processes = self.processes.iter_mut().enumerate();
        for (index, process) in processes.filter(|(_, process)| process.exit.is_none()) {
            if let Ok(Some(status)) = process.child.try_wait() {
                process.exit = Some((status, Instant::now()));
                let end = ProcessEvent::Exited(ProcessId(index), status);
                self.pending.push_back(end);
            }
        }
    }

    /// Until when the next event is the end of a process whose output is not complete.
    fn awaits_output_until(&self) -> Option<Instant> {
        let Some(ProcessEvent::Exited(process, _)) = self.pending.front() else {
            return None;
        };
        let process = &self.processes[process.0];
        let (_, at) = process.exit.filter(|_| process.open_streams > 0)?;
        Some(at + OUTPUT_GRACE)
    }

    /// Ends every process: asks with SIGTERM, waits for `grace`, then ends the rest with SIGKILL and returns their
    /// names. A signal to the launcher meanwhile cuts the waiting short, unless it repeats the one that asked for this.
    pub fn stop(&mut self, grace: Duration) -> Vec<String> {
        self.reap();
        for process in self.alive() {
            // The process was not waited for, so the number is still its own; if it just ended, this has no effect.
            let _ = kill_process(Pid::from_child(&process.child), Signal::TERM);
        }
        self.wait_for_all(Instant::now() + grace);
        let mut killed = Vec::new();
        for process in self.alive() {
            if process.child.kill().is_ok() {
                killed.push(process.name.clone());
            }
        }
        self.wait_for_all(Instant::now() + KILL_WAIT);
        killed
    }

    fn wait_for_all(&mut self, deadline: Instant) {
        while self.alive().next().is_some() && Instant::now() < deadline {
            if let ProcessEvent::TimedOut | ProcessEvent::Interrupted(_) = self.next(deadline) {
                break;
            }
        }
    }
}

impl Drop for Supervisor {
    fn drop(&mut self) {
        self.reap();
        for process in self.alive() {
            if process.child.kill().is_ok() {
                let _ = process.child.wait();
            }
        }
        self.signals.close();
    }
}

/// Threads here only copy lines, so they need little stack even a hundred at a time.
fn spawn_thread(name: String, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
    thread::Builder::new()
        .name(name)
        .stack_size(256 * 1024)
        .spawn(work)
        .map(drop)
}

#[cfg(test)]
mod tests;
