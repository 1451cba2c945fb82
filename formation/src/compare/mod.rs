//! `formation compare`: policies on the same instances, a row for each pair.
//!
//! Rows are written in one fixed order, instance by instance, so those of an interrupted comparison are the first of the whole
//! one. What the clock decides is in files of its own. Begin at [`run`].

#![allow(
    clippy::cast_precision_loss,
    reason = "counts become floating-point numbers for averages; all are small"
)]

mod contender;
mod instance;
mod progress;
mod row;
mod statistics;
mod store;
mod summary;

use ros_runtime::exit::Failure;

use crate::arguments::CompareArguments;
use crate::console;
use contender::ComparedPolicy;
use instance::ComparedInstance;
use progress::CompareProgress;
use store::{CompareSettings, Store};

/// Measures the rows that are missing, and writes tables and summaries.
///
/// # Errors
/// The directory holds another comparison, or cannot be written.
pub fn run(arguments: &CompareArguments) -> Result<(), Failure> {
    let contenders = ComparedPolicy::all(arguments)?;
    let instances = ComparedInstance::all(arguments);
    let settings = CompareSettings::of(arguments, &contenders, &instances);
    let mut store = Store::open(&arguments.directory, &settings)?;
    let total = instances.len() * contenders.len();
    let mut progress = CompareProgress::new(total, store.rows().len());
    for (number, instance) in instances.iter().enumerate() {
        let first = number * contenders.len();
        if first + contenders.len() <= store.rows().len() {
            store.check_order(first, instance, &contenders)?;
            continue;
        }
        let loaded = instance.load();
        for (position, contender) in contenders.iter().enumerate() {
            if first + position < store.rows().len() {
                continue;
            }
            progress.show(&format!("{}, {}", instance.label(), contender.label));
            let measured = row::measure(instance, &loaded, contender, arguments.motion);
            store.append(measured)?;
            progress.advance();
        }
    }
    progress.end();
    store.publish(&contenders)?;
    console::result_line(&arguments.directory.join("summary.md").display().to_string())
}
