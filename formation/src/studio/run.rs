//! The run of a studio: one at a time, a child process that takes orders on its input and prints what happens.

use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use formation_studio_engine::answer;
use formation_studio_server::{Backend, EventLog};
use serde_json::{Value, json};

/// The longest line of a child that is read.
const LINE_BYTES_MAX: u64 = 16 * 1024 * 1024;
/// How long a run may take to end its processes when its input ends. Then it is killed, and its processes end with it.
const END_MAX: Duration = Duration::from_secs(12);
/// How many scenarios may be run in one studio.
const FILES_MAX: u32 = 100_000;

/// Makes a command.
type MakeCommand = Box<dyn Fn() -> Command + Send + Sync>;

/// What a studio does besides drawing and planning.
pub enum Work {
    /// It starts runs.
    Runs {
        /// A run that takes orders, to which the path of a scenario file is added.
        command: MakeCommand,
        /// Where scenario files are written.
        folder: PathBuf,
    },
    /// It shows what a command prints, and takes no orders.
    Watches {
        /// What prints it.
        command: MakeCommand,
    },
}

/// What the page sees and orders.
pub struct StudioRun {
    work: Work,
    /// What the page begins with.
    scenario: Option<String>,
    child: Mutex<Option<Running>>,
    log: EventLog,
}

struct Running {
    child: Child,
    orders: Option<ChildStdin>,
}

impl Backend for StudioRun {
    fn engine(&self, request: &str) -> String {
        answer(request)
    }

    fn state(&self) -> String {
        json!({
            "read_only": matches!(self.work, Work::Watches { .. }),
            "running": self.is_running(),
            "scenario": self.scenario,
        })
        .to_string()
    }

    fn order(&self, name: &str, body: &str) -> Option<String> {
        let done = match serde_json::from_str(body) {
            Ok(body) => self.carry_out(name, &body)?,
            Err(error) => Err(format!("no JSON: {error}")),
        };
        let answer = match done {
            Ok(()) => json!({ "ok": {} }),
            Err(text) => json!({ "error": { "text": text } }),
        };
        Some(answer.to_string())
    }
}

impl StudioRun {
    /// Has no run yet; or watches from now on.
    ///
    /// # Errors
    /// What it watches with cannot be started.
    pub fn new(work: Work, log: EventLog, scenario: Option<String>) -> std::io::Result<Self> {
        let run = Self {
            work,
            scenario,
            child: Mutex::default(),
            log,
        };
        if let Work::Watches { command } = &run.work {
            *run.child() = Some(run.spawn(&mut command())?);
        }
        Ok(run)
    }

    /// Carries out an order; `None` if there is none of this name.
    fn carry_out(&self, name: &str, body: &Value) -> Option<Result<(), String>> {
        let Work::Runs { command, folder } = &self.work else {
            return Some(Err("this studio only watches".to_owned()));
        };
        let text = || body["text"].as_str().ok_or("`text` is missing".to_owned());
        let of_module = |order: &str| {
            let module = body["module"].as_u64();
            let module = module.and_then(|module| u32::try_from(module).ok());
            let module = module.ok_or("`module` is missing")?;
            self.send(&json!({ order: { "module": module } }))
        };
        Some(match name {
            "run" => text().and_then(|text| self.start(text, &mut command(), folder)),
            "run/target" => text().and_then(|text| {
                let scenario = written(text, folder)?;
                self.send(&json!({ "target": { "scenario": scenario } }))
            }),
            "run/kill" => of_module("kill"),
            "run/restart" => of_module("restart"),
            "run/stop" => self.send(&json!({ "stop": {} })),
            "run/resume" => self.send(&json!({ "resume": {} })),
            "run/end" => {
                self.end();
                Ok(())
            }
            _ => return None,
        })
    }

    fn is_running(&self) -> bool {
        let mut child = self.child();
        let child = child.as_mut();
        child.is_some_and(|running| matches!(running.child.try_wait(), Ok(None)))
    }

    fn start(&self, text: &str, command: &mut Command, folder: &Path) -> Result<(), String> {
        if self.is_running() {
            return Err("a run goes on; end it first".to_owned());
        }
        command.arg(written(text, folder)?);
        self.tell(&json!({ "studio": { "began": true } }));
        let running = self.spawn(command);
        let running = running.map_err(|error| format!("cannot start the run: {error}"))?;
        *self.child() = Some(running);
        Ok(())
    }

    /// Gives an order to the run.
    fn send(&self, order: &Value) -> Result<(), String> {
        let mut child = self.child();
        let orders = child.as_mut().and_then(|running| running.orders.as_mut());
        let orders = orders.ok_or("there is no run")?;
        let sent = writeln!(orders, "{order}").and_then(|()| orders.flush());
        sent.map_err(|_| "the run has ended".to_owned())
    }

    /// Ends the run, with all its processes.
    pub fn end(&self) {
        let Some(mut running) = self.child().take() else {
            return;
        };
        drop(running.orders.take());
        if let Work::Runs { .. } = self.work {
            let deadline = Instant::now() + END_MAX;
            while matches!(running.child.try_wait(), Ok(None)) && Instant::now() < deadline {
                thread::sleep(Duration::from_millis(20));
            }
        }
        // What watches has no processes to end; a run that has ended is not there any more.
        let _ = running.child.kill();
        let _ = running.child.wait();
    }

    fn tell(&self, event: &Value) {
        self.log.push(&event.to_string());
    }

    fn spawn(&self, command: &mut Command) -> std::io::Result<Running> {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let orders = child.stdin.take();
        let (results, notes) = (child.stdout.take(), child.stderr.take());
        let log = self.log.clone();
        let threads = || thread::Builder::new().name("run".to_owned());
        let for_notes = log.clone();
        let noting = threads().spawn(move || {
            each_line(notes, |line| {
                for_notes.push(&json!({ "note": line }).to_string());
            });
        })?;
        threads().spawn(move || {
            each_line(results, |line| {
                // Each event is one object.
                match serde_json::from_str::<Value>(line) {
                    Ok(_) => log.push(line),
                    Err(_) => log.push(&json!({ "note": line }).to_string()),
                }
            });
            // It cannot fail but by a panic.
            let _ = noting.join();
            log.push(&json!({ "studio": { "ended": true } }).to_string());
        })?;
        Ok(Running { child, orders })
    }

    /// What a thread that panicked leaves is whole.
    fn child(&self) -> MutexGuard<'_, Option<Running>> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What the engine answers.
fn asked(call: &str, scenario: &str) -> Result<Value, String> {
    let request = json!({ "call": call, "text": scenario });
    let answered = serde_json::from_str(&answer(&request.to_string()));
    let mut answered: Value = answered.unwrap_or_default();
    match answered["error"]["text"].as_str() {
        Some(refused) => Err(refused.to_owned()),
        None => Ok(answered["ok"].take()),
    }
}

/// Checks a scenario like a file, and writes it into a new one.
fn written(scenario: &str, folder: &Path) -> Result<PathBuf, String> {
    let checked = asked("check", scenario)?;
    let findings = checked["findings"].as_array();
    let mut errors = findings.into_iter().flatten();
    if let Some(error) = errors.find(|finding| finding["severity"] == "error") {
        return Err(error["text"].as_str().unwrap_or_default().to_owned());
    }
    let answered = asked("write", scenario)?;
    let text = answered["text"].as_str().unwrap_or_default();
    let failed = |error| format!("cannot write the scenario: {error}");
    for number in 1..=FILES_MAX {
        let path = folder.join(format!("drawn_{number}.yaml"));
        match fs::File::create_new(&path) {
            Ok(mut file) => {
                file.write_all(text.as_bytes()).map_err(failed)?;
                return Ok(path);
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(failed(error)),
        }
    }
    Err("too many scenarios were run; start the studio again".to_owned())
}

/// Takes each line that is not empty, until the source ends.
fn each_line(source: Option<impl Read>, mut take: impl FnMut(&str)) {
    let Some(source) = source else {
        return;
    };
    let mut source = BufReader::new(source);
    let mut line = Vec::new();
    loop {
        line.clear();
        let mut limited = source.by_ref().take(LINE_BYTES_MAX);
        match limited.read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {
                let text = String::from_utf8_lossy(&line);
                if !text.trim().is_empty() {
                    take(text.trim());
                }
            }
        }
    }
}
