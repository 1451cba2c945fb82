//! Chain eviction with a bound on the number of evictions, where potentials do not help.

use crate::assignment::allocation::{Holder, Reassignment, SpotTable};
use crate::assignment::best_of_spots::{BestOfSpots, Prospect};
use crate::assignment::instance::Instance;

/// The greatest number of evictions that the search considers. A larger `d_max` that is still below what the best
/// unbounded chain takes counts as this.
const EVICTIONS_SEARCHED_MAX: u32 = 64;

/// The greatest number of partial chains that one search visits; then it returns the best chain so far.
const NODE_BUDGET: usize = 100_000;

/// Finds the best chain for a module without a spot among those with at most `d_max` evictions; the order among chains is
/// that of [`crate::assignment::ChainSearch::allocate`].
///
/// For each held spot and number of evictions left, a table of prospects bounds the gain of its holder from moving on: the
/// gain if a chain could visit a spot twice. A depth-first search over the chains whose spots are distinct prunes with
/// these bounds. It is exact unless it exceeds [`NODE_BUDGET`].
pub(super) fn best_chain(
    instance: &Instance,
    table: &SpotTable,
    module: usize,
    d_max: u32,
) -> Vec<Reassignment> {
    let ground = Ground::new(instance, table);
    let (mut best, mut best_end) = ground.exit(module);
    let mut best_spots: Vec<usize> = Vec::new();
    let evictions = usize::try_from(d_max.min(EVICTIONS_SEARCHED_MAX)).unwrap_or(0);
    let layers = ground.layers(evictions);
    let mut visited = vec![false; table.holders().len()];
    let mut spots: Vec<usize> = Vec::new();
    let mut frames = vec![Frame {
        module,
        left: evictions,
        so_far: Prospect::default(),
        tried: None,
    }];
    let mut budget = NODE_BUDGET;
    while let Some(frame) = frames.last_mut() {
        let next = (frame.left > 0 && budget > 0)
            .then(|| layers.get(frame.left - 1).or(layers.last()))
            .flatten()
            .and_then(|layer| ground.next_spot(layer, frame, &visited))
            .filter(|&(prospect, _)| prospect > best);
        let Some((prospect, spot)) = next else {
            frames.pop();
            if let Some(spot) = spots.pop() {
                visited[spot] = false;
            }
            continue;
        };
        budget -= 1;
        frame.tried = Some((prospect, spot));
        let Holder::Singleton(holder) = table.holder(spot) else {
            continue;
        };
        let gain = ground.utility(frame.module, spot) - ground.utility(holder, spot);
        let so_far = frame.so_far.after_eviction(gain);
        let left = frame.left - 1;
        visited[spot] = true;
        spots.push(spot);
        let (exit, end) = ground.exit(holder);
        let ended = so_far.followed_by(exit);
        if ended > best {
            best = ended;
            best_spots.clone_from(&spots);
            best_end = end;
        }
        frames.push(Frame {
            module: holder,
            left,
            so_far,
            tried: None,
        });
    }
    ground.chain(module, &best_spots, best_end)
}

/// The last displaced module of a partial chain.
struct Frame {
    module: usize,
    /// The number of evictions that may still follow.
    left: usize,
    so_far: Prospect,
    /// The spot tried last, with its prospect.
    tried: Option<(Prospect, usize)>,
}

/// The state of the table that the search reads.
struct Ground<'a> {
    instance: &'a Instance,
    table: &'a SpotTable,
    free: BestOfSpots<'a>,
    /// The spots that singletons hold, with their holders.
    held: Vec<(usize, usize)>,
}

impl<'a> Ground<'a> {
    fn new(instance: &'a Instance, table: &'a SpotTable) -> Self {
        Self {
            instance,
            table,
            free: BestOfSpots::free(instance, table),
            held: table.singletons().collect(),
        }
    }

    fn utility(&self, module: usize, spot: usize) -> i64 {
        self.instance.utilities.of(module, spot).0
    }

    /// The prospect of a displaced module without a further eviction, and its spot: the best free one, the lowest among
    /// equals, or none if no spot is free.
    fn exit(&self, module: usize) -> (Prospect, Option<usize>) {
        self.free
            .best_for(module)
            .map_or((Prospect::default(), None), |(prospect, spot)| {
                (prospect, Some(spot))
            })
    }

    /// Layer `k` has, for each held spot, the bound on its holder's prospect with at most `k` more evictions. Layers that
    /// would equal the last are left out.
    fn layers(&self, evictions: usize) -> Vec<Vec<Prospect>> {
        if evictions == 0 {
            return Vec::new();
        }
        let exits = self.held.iter().map(|&(_, holder)| self.exit(holder).0);
        let mut layers = vec![exits.collect::<Vec<Prospect>>()];
        while layers.len() < evictions
            && let Some(last) = layers.last()
        {
            // A holder's own spot may stay among its choices: evicting itself is never better than moving on at once.
            let onward = self
                .held
                .iter()
                .zip(last)
                .map(|(&(spot, holder), prospect)| {
                    (spot, prospect.after_eviction(-self.utility(holder, spot)))
                });
            let onward = BestOfSpots::new(self.instance, onward);
            let layer: Vec<Prospect> = self
                .held
                .iter()
                .zip(&layers[0])
                .map(|(&(_, holder), &exit)| {
                    let evicting = onward.best_for(holder).map(|(prospect, _)| prospect);
                    evicting.map_or(exit, |evicting| exit.max(evicting))
                })
                .collect();
            if layer == *last {
                break;
            }
            layers.push(layer);
        }
        layers
    }

    /// The untried spot of greatest prospect that the frame's module can take by an eviction, the lowest among equals.
    fn next_spot(
        &self,
        layer: &[Prospect],
        frame: &Frame,
        visited: &[bool],
    ) -> Option<(Prospect, usize)> {
        let mut best: Option<(Prospect, usize)> = None;
        for (&(spot, holder), onward) in self.held.iter().zip(layer) {
            if visited[spot] {
                continue;
            }
            let gain = self.utility(frame.module, spot) - self.utility(holder, spot);
            let whole = frame.so_far.after_eviction(gain).followed_by(*onward);
            let untried = frame
                .tried
                .is_none_or(|(tried, last)| whole < tried || (whole == tried && spot > last));
            if untried && best.is_none_or(|(greatest, _)| whole > greatest) {
                best = Some((whole, spot));
            }
        }
        best
    }

    /// The steps of a chain that evicts the holders of `spots` and ends at `end`.
    fn chain(&self, module: usize, spots: &[usize], end: Option<usize>) -> Vec<Reassignment> {
        let mut chain = Vec::with_capacity(spots.len() + 1);
        let mut mover = module;
        for &spot in spots {
            chain.push(Reassignment {
                module: mover,
                to: Some(spot),
            });
            if let Holder::Singleton(holder) = self.table.holder(spot) {
                mover = holder;
            }
        }
        if !chain.is_empty() || end.is_some() {
            chain.push(Reassignment {
                module: mover,
                to: end,
            });
        }
        chain
    }
}
