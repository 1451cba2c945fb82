//! The measurements of one instance.

pub(crate) mod auction;
pub(crate) mod matching;
pub(crate) mod plan;
pub(crate) mod processes;
pub(crate) mod protocol;
mod spot_table;
pub(crate) mod talk;

use std::time::Instant;

/// How long `work` takes, in microseconds: the least of `times` runs after one that warms up.
///
/// The least, because other programs on the machine can only lengthen a run.
pub(crate) fn least_us(times: u32, mut work: impl FnMut()) -> f64 {
    work();
    let elapsed = (0..times.max(1)).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed()
    });
    elapsed.min().unwrap_or_default().as_secs_f64() * 1e6
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
                let planned = plan::measure(&problem, 1);
                let said = protocol::measure(&problem, seed).unwrap();
                assert_eq!(said.course.len(), planned.claims);
                assert_eq!(said.samples, planned.claims + planned.evictions);
                if contender != Contender::Auction {
                    assert_eq!(said.pairs_delivered(), planned.pairs_delivered);
                }
                let last = said.course.last().unwrap();
                let filled = planned.filled_spots;
                assert_eq!((last.selected, last.settled), (filled, filled));
                assert_eq!(last.samples, said.samples);
                assert!(last.at <= said.duration);
                let selected: Vec<usize> = planned.turns.iter().map(|turn| turn.1).collect();
                let claimed: Vec<usize> = said.course.iter().map(|claim| claim.selected).collect();
                assert_eq!(selected, claimed);
            }
        }
    }

    #[test]
    fn the_papers_algorithms_broadcast_whole_sets() {
        let instance = Instance::Generated(Draw {
            modules: 8,
            spots: 8,
            docked: Docked::Singletons,
            seed: 1,
        });
        let paper = plan::measure(&instance.problem(Contender::PaperPolicy).unwrap(), 1);
        assert_eq!(paper.broadcasts, 8);
        assert_eq!(paper.whole_set_pairs(), 8 * 8 * 7);
    }
}
