//! One run at a time: a child process that takes orders on its input and prints what happens.

use std::collections::VecDeque;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use formation_studio_engine::answer;
use serde_json::{Value, json};

use crate::{StudioError, Work};

/// The most lines that are kept for pages that come later; the oldest go first.
const LINES_MAX: usize = 200_000;
/// The longest line of a child that is read.
const LINE_BYTES_MAX: u64 = 16 * 1024 * 1024;
/// How long a run may take to end its processes when its input ends; then it is killed, and its processes end with it.
const END_MAX: Duration = Duration::from_secs(12);

/// What there is for a listener.
pub enum Step {
    /// Lines, of which the first has this number.
    Events(usize, Vec<String>),
    /// Nothing for a while.
    Nothing,
    /// The studio ends.
    Ended,
}

/// The run, or none.
pub struct Run {
    work: Work,
    /// The present child.
    child: Mutex<Option<Running>>,
    log: Arc<Log>,
}

struct Running {
    child: Child,
    orders: Option<ChildStdin>,
}

/// What happened, as lines of JSON.
#[derive(Default)]
struct Log {
    lines: Mutex<Lines>,
    news: Condvar,
}

#[derive(Default)]
struct Lines {
    kept: VecDeque<String>,
    /// The number of the first that is kept.
    first: usize,
    has_ended: bool,
}

/// A lock, also after a thread panicked that held it: what it guards is whole between any two statements.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Log {
    fn push(&self, line: String) {
        let mut lines = locked(&self.lines);
        lines.kept.push_back(line);
        if lines.kept.len() > LINES_MAX {
            lines.kept.pop_front();
            lines.first += 1;
        }
        drop(lines);
        self.news.notify_all();
    }

    fn push_json(&self, event: &Value) {
        self.push(event.to_string());
    }
}

impl Run {
    /// No run yet; or what is watched, from now on.
    pub fn new(work: Work) -> Result<Self, StudioError> {
        let run = Self {
            work,
            child: Mutex::default(),
            log: Arc::default(),
        };
        if let Work::Watches { command } = &run.work {
            let running = run.spawn(&mut command())?;
            *locked(&run.child) = Some(running);
        }
        Ok(run)
    }

    /// Whether this studio only watches.
    pub fn is_watched(&self) -> bool {
        matches!(self.work, Work::Watches { .. })
    }

    /// Whether there is a run.
    pub fn is_running(&self) -> bool {
        let mut child = locked(&self.child);
        child
            .as_mut()
            .is_some_and(|running| matches!(running.child.try_wait(), Ok(None)))
    }

    /// Starts a run of a scenario.
    ///
    /// # Errors
    /// The scenario is refused, a run goes on, or it cannot be started.
    pub fn start(&self, scenario: &str) -> Result<(), String> {
        let Work::Runs { command, folder } = &self.work else {
            return Err("this studio only watches".to_owned());
        };
        if self.is_running() {
            return Err("a run goes on; end it first".to_owned());
        }
        let file = written(scenario, folder)?;
        let mut command = command();
        command.arg(file);
        self.log.push_json(&json!({ "studio": { "began": true } }));
        let running = self.spawn(&mut command);
        let running = running.map_err(|error| format!("cannot start the run: {error}"))?;
        *locked(&self.child) = Some(running);
        Ok(())
    }

    /// Has the modules of the run form the target of another scenario.
    ///
    /// # Errors
    /// The scenario is refused, or there is no run.
    pub fn target(&self, scenario: &str) -> Result<(), String> {
        let Work::Runs { folder, .. } = &self.work else {
            return Err("this studio only watches".to_owned());
        };
        let file = written(scenario, folder)?;
        self.order(&json!({ "target": { "scenario": file } }))
    }

    /// Gives an order to the run.
    ///
    /// # Errors
    /// There is none.
    pub fn order(&self, order: &Value) -> Result<(), String> {
        if self.is_watched() {
            return Err("this studio only watches".to_owned());
        }
        let mut child = locked(&self.child);
        let orders = child.as_mut().and_then(|running| running.orders.as_mut());
        let orders = orders.ok_or("there is no run")?;
        let sent = writeln!(orders, "{order}").and_then(|()| orders.flush());
        sent.map_err(|_| "the run has ended".to_owned())
    }

    /// Ends the run, with all its processes.
    pub fn end(&self) {
        let running = locked(&self.child).take();
        if let Some(mut running) = running {
            drop(running.orders.take());
            if self.is_watched() {
                // It has no processes to end.
                let _ = running.child.kill();
            }
            let deadline = Instant::now() + END_MAX;
            while matches!(running.child.try_wait(), Ok(None)) && Instant::now() < deadline {
                thread::sleep(Duration::from_millis(20));
            }
            let _ = running.child.kill();
            let _ = running.child.wait();
        }
        if self.is_watched() {
            locked(&self.log.lines).has_ended = true;
            self.log.news.notify_all();
        }
    }

    /// Waits for lines from a number on.
    pub fn await_events(&self, next: usize, most: Duration) -> Step {
        let lines = locked(&self.log.lines);
        let is_old = |lines: &mut Lines| lines.first + lines.kept.len() <= next && !lines.has_ended;
        let waited = self.log.news.wait_timeout_while(lines, most, is_old);
        let (lines, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let first = next.max(lines.first);
        let news: Vec<String> = lines
            .kept
            .iter()
            .skip(first - lines.first)
            .cloned()
            .collect();
        match (news.is_empty(), lines.has_ended) {
            (false, _) => Step::Events(first, news),
            (true, true) => Step::Ended,
            (true, false) => Step::Nothing,
        }
    }

    fn spawn(&self, command: &mut Command) -> std::io::Result<Running> {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let orders = child.stdin.take();
        let (results, notes) = (child.stdout.take(), child.stderr.take());
        let log = Arc::clone(&self.log);
        let reader = thread::Builder::new().name("run".to_owned());
        reader.spawn(move || {
            let for_notes = Arc::clone(&log);
            let notes = thread::spawn(move || {
                each_line(notes, |line| for_notes.push_json(&json!({ "note": line })));
            });
            each_line(results, |line| {
                // What is no JSON would break the stream of events.
                match serde_json::from_str::<Value>(&line) {
                    Ok(_) => log.push(line),
                    Err(_) => log.push_json(&json!({ "note": line })),
                }
            });
            let _ = notes.join();
            log.push_json(&json!({ "studio": { "ended": true } }));
        })?;
        Ok(Running { child, orders })
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        self.end();
    }
}

/// What the engine answers.
fn asked(call: &str, scenario: &str) -> Result<Value, String> {
    let request = json!({ "call": call, "text": scenario });
    let mut answered: Value =
        serde_json::from_str(&answer(&request.to_string())).unwrap_or_default();
    match answered["error"]["text"].as_str() {
        Some(refused) => Err(refused.to_owned()),
        None => Ok(answered["ok"].take()),
    }
}

/// Checks a scenario as a file, and writes it into a new one.
fn written(scenario: &str, folder: &Path) -> Result<PathBuf, String> {
    let checked = asked("check", scenario)?;
    let findings = checked["findings"].as_array();
    let mut errors = findings.into_iter().flatten();
    if let Some(error) = errors.find(|finding| finding["severity"] == "error") {
        return Err(error["text"].as_str().unwrap_or_default().to_owned());
    }
    let answered = asked("write", scenario)?;
    let text = answered["text"].as_str().unwrap_or_default();
    let names = (1_u32..).map(|number| folder.join(format!("drawn_{number}.yaml")));
    for path in names.take(100_000) {
        match fs::File::create_new(&path) {
            Ok(mut file) => {
                let result = file.write_all(text.as_bytes());
                return result
                    .map(|()| path)
                    .map_err(|error| format!("cannot write the scenario: {error}"));
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("cannot write the scenario: {error}")),
        }
    }
    Err("too many scenarios were drawn; start the studio again".to_owned())
}

fn each_line(source: Option<impl Read>, mut take: impl FnMut(String)) {
    let Some(source) = source else {
        return;
    };
    let mut source = BufReader::new(source);
    loop {
        let mut line = Vec::new();
        let mut limited = source.by_ref().take(LINE_BYTES_MAX);
        match limited.read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {
                let line = String::from_utf8_lossy(&line);
                let line = line.trim();
                if !line.is_empty() {
                    take(line.to_owned());
                }
            }
        }
    }
}
