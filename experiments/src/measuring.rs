//! Measuring the cells that are not finished.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::path::Path;
use std::slice::Iter;
use std::sync::{Mutex, PoisonError};
use std::thread;

use crate::cell::{Cell, Measurement};
use crate::error::{CellError, ExperimentError};
use crate::figures::Figure;
use crate::settings::ExperimentSettings;
use crate::store::Store;
use crate::{ProgressSink, Work};

/// More workers compete for memory: a simulated cluster of 100 modules fills a cache.
const WORKERS_MAX: usize = 8;

/// Measures every cell of the chosen experiments that the store does not have.
pub(crate) fn measure_all(
    settings: &ExperimentSettings,
    chosen: &[&Figure],
    launcher: &Path,
    store: &mut Store,
    progress: &mut (dyn ProgressSink + Send),
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
        left.into_iter().partition(|cell| cell.kind.is_timed());
    let measure = |cell: Cell| cell.measure(settings, launcher);
    // Timed cells run alone, because other work would lengthen their times.
    let workers = thread::available_parallelism().map_or(1, NonZero::get);
    let workers = workers.min(WORKERS_MAX);
    measure_with(workers, &untimed, measure, store, progress)?;
    measure_with(1, &timed, measure, store, progress)
}

/// The state that workers share.
struct Shared<'a> {
    left: Iter<'a, Cell>,
    store: &'a mut Store,
    progress: &'a mut (dyn ProgressSink + Send),
    outcome: Result<(), ExperimentError>,
}

/// Measures cells with this number of workers, and stores each as soon as it is finished.
fn measure_with(
    workers: usize,
    cells: &[Cell],
    measure: impl Fn(Cell) -> Result<Measurement, CellError> + Sync,
    store: &mut Store,
    progress: &mut (dyn ProgressSink + Send),
) -> Result<(), ExperimentError> {
    let shared = Mutex::new(Shared {
        left: cells.iter(),
        store,
        progress,
        outcome: Ok(()),
    });
    let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
    // The lock is released before a cell is measured.
    let next = || lock().next();
    let work = || {
        // After an error or an interruption, workers finish their current cells, which are stored.
        while let Some(cell) = next() {
            let measured = measure(cell);
            lock().keep(cell, measured);
        }
    };
    thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(work);
        }
    });
    let shared = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    shared.outcome?;
    if shared.progress.goes_on() {
        Ok(())
    } else {
        Err(ExperimentError::Interrupted)
    }
}

impl Shared<'_> {
    fn next(&mut self) -> Option<Cell> {
        if self.outcome.is_err() || !self.progress.goes_on() {
            return None;
        }
        let cell = *self.left.next()?;
        self.progress.cell(&cell.label());
        Some(cell)
    }

    fn keep(&mut self, cell: Cell, measured: Result<Measurement, CellError>) {
        let kept = match measured {
            Ok(measurement) => self.store.keep(cell, measurement),
            Err(source) if self.progress.goes_on() => Err(ExperimentError::Cell {
                label: cell.label(),
                source,
            }),
            // An interruption from the keyboard also ends the processes of a cell.
            Err(_) => Err(ExperimentError::Interrupted),
        };
        if kept.is_ok() {
            self.progress.finished(cell.cost());
        } else if self.outcome.is_ok() {
            self.outcome = kept;
        }
    }
}
