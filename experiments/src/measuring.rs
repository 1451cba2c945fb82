//! Measuring the cells that are not finished.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, SyncSender};
use std::thread;

use crate::cell::{Cell, Measurement};
use crate::error::{CellError, ExperimentError};
use crate::figures::Figure;
use crate::settings::Settings;
use crate::store::Store;
use crate::{Progress, Work};

/// More workers compete for memory: a simulated cluster of 100 modules fills a cache.
const WORKERS_MAX: usize = 8;

/// Measures every cell of the chosen experiments that the store does not have.
pub(crate) fn measure_all(
    settings: &Settings,
    chosen: &[&Figure],
    launcher: &Path,
    store: &mut Store,
    progress: &mut dyn Progress,
) -> Result<(), ExperimentError> {
    let mut seen = BTreeSet::new();
    let cells: Vec<Cell> = chosen
        .iter()
        .flat_map(|figure| figure.cells(settings))
        .filter(|&cell| seen.insert(cell))
        .collect();
    let (finished, left): (Vec<Cell>, Vec<Cell>) =
        cells.iter().copied().partition(|&cell| store.has(cell));
    let cost = |cells: &[Cell]| cells.iter().map(|cell| cell.cost()).sum();
    progress.begin(Work {
        cells: cells.len(),
        finished_cells: finished.len(),
        cost: cost(&cells),
        finished_cost: cost(&finished),
    });
    let (timed, untimed): (Vec<Cell>, Vec<Cell>) =
        left.into_iter().partition(|cell| cell.is_timed());
    let measure = |cell: Cell| cell.measure(settings, launcher);
    // Timed cells run alone, because other work would lengthen their times.
    let workers = thread::available_parallelism().map_or(1, NonZero::get);
    let workers = workers.min(WORKERS_MAX);
    measure_with(workers, &untimed, measure, store, progress)?;
    measure_with(1, &timed, measure, store, progress)
}

/// A message from a worker.
enum News {
    Begun(Cell),
    Finished(Cell, Box<Result<Measurement, CellError>>),
}

/// Measures cells with this number of workers, and stores each as soon as it is finished.
fn measure_with(
    workers: usize,
    cells: &[Cell],
    measure: impl Fn(Cell) -> Result<Measurement, CellError> + Sync,
    store: &mut Store,
    progress: &mut dyn Progress,
) -> Result<(), ExperimentError> {
    let next = AtomicUsize::new(0);
    let stopped = AtomicBool::new(false);
    let work = |sender: &SyncSender<News>| {
        while !stopped.load(Ordering::Relaxed) {
            let Some(&cell) = cells.get(next.fetch_add(1, Ordering::Relaxed)) else {
                return;
            };
            // The receiver exists until all workers have ended.
            let _ = sender.send(News::Begun(cell));
            let _ = sender.send(News::Finished(cell, Box::new(measure(cell))));
        }
    };
    let (sender, receiver) = mpsc::sync_channel(workers);
    thread::scope(|scope| {
        for _ in 0..workers {
            let sender = sender.clone();
            scope.spawn(|| {
                let sender = sender;
                work(&sender);
            });
        }
        drop(sender);
        let mut outcome = Ok(());
        for news in receiver {
            // After an error or an interruption, the workers finish their current cells, which are stored.
            outcome = outcome.and(handle(news, store, progress));
            stopped.store(outcome.is_err() || !progress.goes_on(), Ordering::Relaxed);
        }
        outcome
    })?;
    if progress.goes_on() {
        Ok(())
    } else {
        Err(ExperimentError::Interrupted)
    }
}

fn handle(
    news: News,
    store: &mut Store,
    progress: &mut dyn Progress,
) -> Result<(), ExperimentError> {
    match news {
        News::Begun(cell) => progress.cell(&cell.label()),
        News::Finished(cell, measured) => {
            let measurement = measured.map_err(|source| {
                // An interruption from the keyboard also ends the processes of a cell.
                if progress.goes_on() {
                    ExperimentError::Cell {
                        label: cell.label(),
                        source,
                    }
                } else {
                    ExperimentError::Interrupted
                }
            })?;
            store.keep(cell, measurement)?;
            progress.finished(cell.cost());
        }
    }
    Ok(())
}
