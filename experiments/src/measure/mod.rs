//! The measurements of one instance.

pub(crate) mod auction;
pub(crate) mod matching;
pub(crate) mod plan;
pub(crate) mod processes;
pub(crate) mod protocol;
mod spot_table;
pub(crate) mod talk;
pub(crate) mod world;

use std::time::{Duration, Instant};

/// Work that has taken this long is not repeated to time it again.
const BUDGET: Duration = Duration::from_millis(50);

/// The number of points at which curves over time are kept: at 0, 5 ... 100 per cent.
pub(crate) const POINTS: u32 = 21;

/// The point of a curve that belongs to a part of the time.
fn point_at(percent: f64) -> usize {
    (percent / 100.0 * f64::from(POINTS - 1)).round() as usize
}

/// A number with four decimals, which differences between mathematical libraries do not reach.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// How long `work` takes, in microseconds: the least of `times` runs after one that warms up. Work that takes longer than
/// [`BUDGET`] runs less often, at least once.
///
/// The least, because other programs on the machine can only lengthen a run.
pub(crate) fn least_us(times: u32, mut work: impl FnMut()) -> f64 {
    let begin = Instant::now();
    let mut least = Duration::MAX;
    for time in 0..=times.max(1) {
        let start = Instant::now();
        work();
        let elapsed = start.elapsed();
        // The first run warms up; it counts if the time for more has passed.
        least = if time <= 1 {
            elapsed
        } else {
            least.min(elapsed)
        };
        if begin.elapsed() > BUDGET {
            break;
        }
    }
    rounded(least.as_secs_f64() * 1e6)
}

#[cfg(test)]
mod tests {
    use super::{plan, protocol};
    use crate::contender::Contender;
    use crate::instance::{Docked, Draw, Instance};

    /// The counts of a plan equal the messages that the agents publish.
    #[test]
    fn the_protocol_publishes_what_the_plan_counts() {
        for seed in 1..=4 {
            let instance = Instance::Generated(Draw {
                modules: 14,
                spots: 12,
                docked: Docked::Mixed,
                seed,
            });
            for contender in [Contender::PaperPolicy, Contender::Ours, Contender::Auction] {
                let problem = instance.problem(contender).unwrap();
                let (planned, times) = plan::measure(&problem, 1);
                let said = protocol::measure(&problem, seed).unwrap();
                let messages = &planned.messages;
                assert_eq!(said.steps, messages.claims);
                assert_eq!(said.samples, messages.claims + messages.evictions);
                if contender != Contender::Auction {
                    assert_eq!(said.pairs_delivered(), messages.pairs_delivered);
                }
                let filled = planned.filled_spots;
                assert_eq!(said.course.last().unwrap()[..2], [filled, filled]);
                assert_eq!(times.selected.last(), Some(&filled));
                assert_eq!(times.fillable_spots, said.fillable_spots);
                assert_eq!(times.fillable_spots, planned.fillable_spots());
            }
        }
    }

    /// The paper's acting order walls a spot in here, and agents act in another: only spots and links agree.
    #[test]
    fn a_plan_that_walls_a_spot_in_is_measured() {
        let instance = Instance::Generated(Draw {
            modules: 20,
            spots: 20,
            docked: Docked::Mixed,
            seed: 16,
        });
        let problem = instance.problem(Contender::PaperPolicy).unwrap();
        assert_eq!(protocol::measure(&problem, 16).unwrap().steps, 12);
    }

    #[test]
    fn the_papers_algorithms_broadcast_whole_sets() {
        let instance = Instance::Generated(Draw {
            modules: 8,
            spots: 8,
            docked: Docked::Singletons,
            seed: 1,
        });
        let problem = instance.problem(Contender::PaperPolicy).unwrap();
        let (paper, _) = plan::measure(&problem, 1);
        assert_eq!(paper.messages.broadcasts, 8);
        assert_eq!(paper.whole_set_pairs(), 8 * 8 * 7);
    }
}
