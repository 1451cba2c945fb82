//! The process that runs or watches a formation: this program itself, by the same code as from a terminal.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use super::course::MODULES_INTERVAL;
use super::{Studio, lock};
use crate::run::{OrderLine, RunLine, RunOrder, for_each_line};

/// Lines that wait to be taken in. When there are more, the process that writes them waits.
const LINES_MAX: usize = 1_024;
/// A line lists every module at most.
const LINE_BYTES_MAX: u64 = 16 * 1024 * 1024;
/// A line for people is cut here.
const NOTE_BYTES_MAX: u64 = 4_000;
/// How long an answer to an order may take: the run reads it at once unless it is starting.
const ANSWER_MAX: Duration = Duration::from_secs(20);
/// How long a run may take to end its processes.
const END_MAX: Duration = Duration::from_secs(15);
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

type Answers = Arc<Mutex<BTreeMap<u64, Sender<Result<(), String>>>>>;

/// A run that is under way.
pub struct RunProcess {
    child: Arc<Mutex<Child>>,
    orders: Option<ChildStdin>,
    /// What takes in its lines.
    thread: JoinHandle<()>,
    number: u64,
    answers: Answers,
    /// The scenario files; deleted with the run.
    pub files: TempDir,
    /// How many there are.
    pub files_count: usize,
}

/// An order that was given, and awaits its answer.
pub struct Given(Receiver<Result<(), String>>);

impl Given {
    pub fn answer(self) -> Result<(), String> {
        let late = |_| {
            format!(
                "the run gave no answer within {} s, or has ended",
                ANSWER_MAX.as_secs()
            )
        };
        self.0.recv_timeout(ANSWER_MAX).map_err(late)?
    }
}

impl RunProcess {
    /// Starts the process of a run.
    pub fn start(studio: &Arc<Studio>, mut command: Command, files: TempDir) -> io::Result<Self> {
        command.stdin(Stdio::piped());
        let (child, lines) = spawn(&mut command)?;
        let orders = lock(&child).stdin.take();
        let answers = Answers::default();
        let (its_studio, its_child) = (Arc::clone(studio), Arc::clone(&child));
        let its_answers = Arc::clone(&answers);
        let follow = move || {
            let end = follow(&its_studio, &lines, &its_child, &its_answers);
            lock(&its_answers).clear();
            its_studio.course().end(&end);
        };
        let thread = thread::Builder::new().name("run".to_owned());
        let thread = thread.spawn(follow)?;
        Ok(Self {
            child,
            orders,
            thread,
            number: 0,
            answers,
            files,
            files_count: 1,
        })
    }

    /// Passes an order on.
    pub fn give(&mut self, order: RunOrder) -> Result<Given, String> {
        let orders = self.orders.as_mut().ok_or("the run is ending")?;
        self.number += 1;
        let number = self.number;
        let line = serde_json::to_string(&OrderLine { number, order });
        let line = line.map_err(|error| error.to_string())?;
        let (sender, receiver) = channel();
        lock(&self.answers).insert(number, sender);
        writeln!(orders, "{line}")
            .and_then(|()| orders.flush())
            .map_err(|error| format!("the run takes no orders any more: {error}"))?;
        Ok(Given(receiver))
    }

    /// Ends the run and its processes: the end of its orders is the end of a run.
    pub fn end(mut self) {
        drop(self.orders.take());
        end(&self.child);
        // It has nothing to say when it panicked.
        let _ = self.thread.join();
    }
}

/// Waits until a process has ended that was asked to, and kills it if it does not. Its own processes end with it.
fn end(child: &Mutex<Child>) {
    let deadline = Instant::now() + END_MAX;
    while Instant::now() < deadline {
        // An error says that there is no such process.
        if !matches!(lock(child).try_wait(), Ok(None)) {
            return;
        }
        thread::sleep(LOOK_INTERVAL);
    }
    let mut child = lock(child);
    let _ = child.kill();
    let _ = child.wait();
}

/// Asks a process to end by a signal, and waits for it.
pub fn terminate(child: &Mutex<Child>) {
    {
        let mut child = lock(child);
        if matches!(child.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(&child), Signal::TERM);
        }
    }
    end(child);
}

enum Line {
    Output(String),
    Note(String),
}

/// What a process writes.
pub struct Lines(Receiver<Line>);

/// Starts a process, in a process group of its own: Ctrl-C reaches the server alone, which ends everything in order.
pub fn spawn(command: &mut Command) -> io::Result<(Arc<Mutex<Child>>, Lines)> {
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.process_group(0).spawn()?;
    let (sender, lines) = sync_channel(LINES_MAX);
    let (output, notes) = (child.stdout.take(), child.stderr.take());
    let child = Arc::new(Mutex::new(child));
    if let Some(output) = output {
        read(output, LINE_BYTES_MAX, sender.clone(), Line::Output)?;
    }
    if let Some(notes) = notes {
        read(notes, NOTE_BYTES_MAX, sender, Line::Note)?;
    }
    Ok((child, Lines(lines)))
}

fn read(
    source: impl Read + Send + 'static,
    bytes_max: u64,
    sender: SyncSender<Line>,
    line: fn(String) -> Line,
) -> io::Result<()> {
    let copy = move || {
        // An error ends the output; the exit status says the rest.
        let _ = for_each_line(BufReader::new(source), bytes_max, |text| {
            sender.send(line(text)).is_ok()
        });
    };
    let thread = thread::Builder::new().name("lines".to_owned());
    thread.spawn(copy).map(drop)
}

/// Takes in what a process writes until it ends. Returns how it ended, for people.
pub fn follow(studio: &Studio, lines: &Lines, child: &Mutex<Child>, answers: &Answers) -> String {
    let mut last_note = None;
    loop {
        match lines.0.recv_timeout(MODULES_INTERVAL) {
            Ok(Line::Output(text)) => take_output(studio, &text, answers),
            Ok(Line::Note(text)) => {
                studio.course().log(text.clone());
                last_note = Some(text);
            }
            Err(RecvTimeoutError::Timeout) => studio.course().flush(false),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    let status = status_of(child);
    match (status, last_note) {
        (Some(status), _) if status.success() => "the run has ended".to_owned(),
        (_, Some(note)) => note,
        (Some(status), None) => format!("the run ended with {status}"),
        (None, None) => "the run has ended".to_owned(),
    }
}

/// The exit status of a process that has closed its output.
fn status_of(child: &Mutex<Child>) -> Option<ExitStatus> {
    let deadline = Instant::now() + END_MAX;
    while Instant::now() < deadline {
        match lock(child).try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) => thread::sleep(LOOK_INTERVAL),
            Err(_) => return None,
        }
    }
    None
}

fn take_output(studio: &Studio, text: &str, answers: &Answers) {
    match serde_json::from_str(text) {
        Ok(RunLine::Answer { number, error }) => {
            if let Some(sender) = lock(answers).remove(&number) {
                // Who asked may have given up.
                let _ = sender.send(error.map_or(Ok(()), Err));
            }
        }
        Ok(line) => studio.course().take(line),
        Err(error) => studio
            .course()
            .log(format!("a line cannot be read ({error})")),
    }
}
