//! Many seeds at once, on all processors.

use std::num::NonZero;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;

use crate::campaign::{CampaignError, CampaignParameters, SeedReport, run_seed};

/// Runs every seed of a range, and hands over each report as soon as it is there, in no particular order.
///
/// # Errors
/// Says why the first seed that could not begin could not; the seeds that run at that moment still end.
pub fn run_seeds(
    parameters: &CampaignParameters,
    seeds: Range<u64>,
    mut each: impl FnMut(SeedReport),
) -> Result<(), CampaignError> {
    let workers = std::thread::available_parallelism().map_or(1, NonZero::get);
    let (first, count) = (seeds.start, seeds.end.saturating_sub(seeds.start));
    let next = AtomicU64::new(0);
    let stop = AtomicBool::new(false);
    let (reports, collected) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..workers {
            let reports = reports.clone();
            let (next, stop) = (&next, &stop);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let taken = next.fetch_add(1, Ordering::Relaxed);
                    if taken >= count || reports.send(run_seed(parameters, first + taken)).is_err()
                    {
                        return;
                    }
                }
            });
        }
        drop(reports);
        let mut outcome = Ok(());
        for report in collected {
            match report {
                Ok(report) => each(report),
                Err(error) => {
                    stop.store(true, Ordering::Relaxed);
                    outcome = outcome.and(Err(error));
                }
            }
        }
        outcome
    })
}
