//! `formation experiments`.

use std::env;
use std::io::{IsTerminal, stderr};
use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use formation_experiments::{ExperimentError, ExperimentSettings, ProgressSink, Scale, Work};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use ros_runtime::exit::{EndRequest, EndSignals, Failure};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::arguments::ExperimentsArguments;
use crate::console;

/// The default of `--runs`, as in the paper.
const RUNS: u64 = 50;
/// The default of `--runs` with `--quick`.
const QUICK_RUNS: u64 = 5;
/// The interval of progress lines if the standard error output is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Runs the experiments that are not finished, and writes all results.
///
/// # Errors
/// Fails if the choice or the directory is not valid, or if a cell cannot be measured.
pub fn run(arguments: &ExperimentsArguments) -> Result<(), Failure> {
    let (scale, runs) = if arguments.quick {
        (Scale::Quick, QUICK_RUNS)
    } else {
        (Scale::Paper, RUNS)
    };
    let settings = ExperimentSettings::new(scale, arguments.runs.unwrap_or(runs), arguments.seed);
    let launcher = env::current_exe()
        .context("cannot find the launcher's own program")
        .map_err(Failure::BadInput)?;
    let mut display = Display::start().map_err(Failure::Failed)?;
    let outcome = formation_experiments::run(
        &arguments.directory,
        &settings,
        &arguments.only,
        &launcher,
        &mut display,
    );
    display.bar.finish_and_clear();
    outcome.map_err(|error| match error {
        ExperimentError::BadInput(_) => Failure::BadInput(anyhow!(error)),
        ExperimentError::Interrupted => Failure::Interrupted(error.to_string(), display.signal()),
        _ => Failure::Failed(anyhow!(error)),
    })?;
    let directory = arguments.directory.display();
    console::note(&format!(
        "`python3 experiments/plot.py {directory}` draws the plots"
    ));
    let summary = arguments.directory.join("summary.md");
    console::result_line(&summary.display().to_string())
}

/// The progress: a bar with the remaining time on a terminal, else a line at intervals.
struct Display {
    bar: ProgressBar,
    /// Set by signals that ask to stop. Between two cells, all results are on disk.
    interrupted: Arc<AtomicBool>,
    /// The last of these signals.
    signal: Arc<AtomicUsize>,
    cells: usize,
    finished_cells: usize,
    line_at: Option<Instant>,
}

impl Display {
    fn start() -> anyhow::Result<Self> {
        let interrupted = Arc::new(AtomicBool::new(false));
        let last = Arc::new(AtomicUsize::new(0));
        let signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).context("cannot handle signals")?;
        let (stop, number) = (Arc::clone(&interrupted), Arc::clone(&last));
        thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || receive(signals, &stop, &number))
            .context("cannot handle signals")?;
        let target = if stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        Ok(Self {
            bar: ProgressBar::with_draw_target(None, target),
            interrupted,
            signal: last,
            cells: 0,
            finished_cells: 0,
            line_at: None,
        })
    }

    fn signal(&self) -> i32 {
        let signal = self.signal.load(Ordering::Relaxed);
        i32::try_from(signal).unwrap_or(SIGINT)
    }
}

/// Notes signals as they come; one that follows the first without repeating it ends the program at once.
fn receive(mut signals: Signals, interrupted: &AtomicBool, last: &AtomicUsize) {
    let mut received = EndSignals::default();
    for signal in signals.forever() {
        last.store(
            usize::try_from(signal).unwrap_or_default(),
            Ordering::Relaxed,
        );
        match received.receive(Instant::now()) {
            EndRequest::First => interrupted.store(true, Ordering::Relaxed),
            EndRequest::Repeated => {}
            EndRequest::Urgent => process::exit(128 + signal),
        }
    }
}

impl ProgressSink for Display {
    fn begin(&mut self, work: Work) {
        let style = ProgressStyle::with_template(
            "{bar:30} {percent:>3} %  {elapsed} gone, {eta} left  {msg}",
        );
        if let Ok(style) = style {
            self.bar.set_style(style);
        }
        self.cells = work.cells;
        self.finished_cells = work.finished_cells;
        self.bar.set_length(work.cost);
        // The remaining time follows from this run's speed, not from the cells of an earlier run.
        self.bar.set_position(work.finished_cost);
        self.bar.reset_eta();
        if work.finished_cells > 0 {
            console::note(&format!(
                "{} of {} cells are finished already",
                work.finished_cells, work.cells
            ));
        }
    }

    fn cell(&mut self, label: &str) {
        self.bar.set_message(label.to_owned());
        let due = self
            .line_at
            .is_none_or(|line_at| line_at.elapsed() >= LINE_INTERVAL);
        if self.bar.is_hidden() && due {
            let left = match self.line_at {
                None => String::new(),
                Some(_) => format!(", about {} s left", self.bar.eta().as_secs()),
            };
            self.line_at = Some(Instant::now());
            console::note(&format!(
                "{} of {} cells{left}: {label}",
                self.finished_cells, self.cells
            ));
        }
    }

    fn finished(&mut self, cost: u64) {
        self.finished_cells += 1;
        self.bar.inc(cost);
    }

    fn goes_on(&self) -> bool {
        !self.interrupted.load(Ordering::Relaxed)
    }
}
