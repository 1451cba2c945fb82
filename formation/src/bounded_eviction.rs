//! Chain eviction with a bound on the number of evictions, for which potentials are of no use.

use crate::allocation::{Holder, SpotTable};
use crate::eviction::Step;
use crate::utility::Utilities;

/// Chains are searched for up to this many evictions; a larger `d_max` that is not large enough for the best
/// unbounded chain counts as this.
const EVICTIONS_SEARCHED_MAX: u32 = 64;

/// The search for a chain without repeated spots looks at no more partial chains than this, then takes the best so far.
const NODE_BUDGET: usize = 100_000;

/// The gain of the best way on, and how many evictions it takes.
///
/// Ordered so that more gain comes first, then fewer evictions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Prospect {
    gain: i64,
    spared_evictions: i64,
}

impl Prospect {
    fn after_eviction(self, gain: i64) -> Self {
        Self {
            gain: self.gain + gain,
            spared_evictions: self.spared_evictions - 1,
        }
    }
}

/// Finds the chain of greatest gain among those with a bounded number of evictions.
///
/// A table of prospects tells for each held spot and number of evictions left what its holder can gain by moving on,
/// if spots could repeat. That bounds a depth-first search over the chains whose spots are distinct, so the search is
/// exact unless it exceeds its budget.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoundedSearch {
    /// Layer `k`: the prospect of each spot's holder when `k` more evictions are allowed; `None` unless a singleton
    /// holds the spot.
    layers: Vec<Vec<Option<Prospect>>>,
    rows: UtilityRows,
}

/// The utilities of singletons for all spots, computed when first needed and kept for later turns.
#[derive(Clone, Debug, Default)]
struct UtilityRows {
    rows: Vec<Vec<i64>>,
}

impl UtilityRows {
    fn prepare(&mut self, utilities: &Utilities, module: usize) {
        if self.rows.is_empty() {
            self.rows = vec![Vec::new(); utilities.module_count()];
        }
        if self.rows[module].is_empty() {
            self.rows[module] = utilities.row(module);
        }
    }

    fn row(&self, module: usize) -> &[i64] {
        &self.rows[module]
    }
}

/// A partial chain's last displaced module.
struct Frame {
    module: usize,
    left: usize,
    gain: i64,
    /// The prospect and spot that were tried last.
    tried: Option<(Prospect, usize)>,
}

impl BoundedSearch {
    /// The best chain for a module without a spot; see [`crate::eviction::ChainSearch::insert`].
    pub(crate) fn best_chain(
        &mut self,
        utilities: &Utilities,
        table: &SpotTable,
        module: usize,
        d_max: u32,
    ) -> Vec<Step> {
        let mut rows = std::mem::take(&mut self.rows);
        rows.prepare(utilities, module);
        for holder in table.holders() {
            if let Holder::Singleton(holder) = holder {
                rows.prepare(utilities, *holder);
            }
        }
        let chain = self.best_chain_with(&Exit { rows: &rows, table }, module, d_max);
        self.rows = rows;
        chain
    }

    fn best_chain_with(&mut self, exit: &Exit<'_>, module: usize, d_max: u32) -> Vec<Step> {
        let (rows, table) = (exit.rows, exit.table);
        let (own_gain, own_spot) = exit.of(module);
        let mut best = Prospect {
            gain: own_gain,
            spared_evictions: 0,
        };
        let mut best_spots: Vec<usize> = Vec::new();
        let mut best_end = own_spot;
        let evictions = usize::try_from(d_max.min(EVICTIONS_SEARCHED_MAX)).unwrap_or(0);
        if evictions > 0 {
            self.fill_layers(exit, evictions);
            let mut visited = vec![false; table.holders().len()];
            let mut spots: Vec<usize> = Vec::new();
            let mut frames = vec![Frame {
                module,
                left: evictions,
                gain: 0,
                tried: None,
            }];
            let mut budget = NODE_BUDGET;
            while let Some(frame) = frames.last_mut() {
                let so_far = Prospect {
                    gain: frame.gain,
                    spared_evictions: -i64::try_from(spots.len()).unwrap_or(i64::MAX),
                };
                let next = (frame.left > 0 && budget > 0)
                    .then(|| {
                        self.next_spot(exit, frame, &visited, so_far)
                            .filter(|&(prospect, _)| prospect > best)
                    })
                    .flatten();
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
                let gain = frame.gain + rows.row(frame.module)[spot] - rows.row(holder)[spot];
                let left = frame.left - 1;
                visited[spot] = true;
                spots.push(spot);
                let (exit_gain, exit_spot) = exit.of(holder);
                let ended = Prospect {
                    gain: gain + exit_gain,
                    spared_evictions: so_far.spared_evictions - 1,
                };
                if ended > best {
                    best = ended;
                    best_spots.clone_from(&spots);
                    best_end = exit_spot;
                }
                frames.push(Frame {
                    module: holder,
                    left,
                    gain,
                    tried: None,
                });
            }
        }
        exit.chain(module, &best_spots, best_end)
    }

    /// The untried spot of greatest prospect that the frame's module could take by eviction, lower spots first.
    fn next_spot(
        &self,
        exit: &Exit<'_>,
        frame: &Frame,
        visited: &[bool],
        so_far: Prospect,
    ) -> Option<(Prospect, usize)> {
        let row = exit.rows.row(frame.module);
        let mut best: Option<(Prospect, usize)> = None;
        for (spot, prospect) in self.layers[frame.left - 1].iter().enumerate() {
            let Some(prospect) = prospect.filter(|_| !visited[spot]) else {
                continue;
            };
            let Holder::Singleton(holder) = exit.table.holder(spot) else {
                continue;
            };
            let whole = Prospect {
                gain: so_far.gain + row[spot] - exit.rows.row(holder)[spot] + prospect.gain,
                spared_evictions: so_far.spared_evictions + prospect.spared_evictions - 1,
            };
            let untried = frame
                .tried
                .is_none_or(|(tried, last)| whole < tried || (whole == tried && spot > last));
            if untried && best.is_none_or(|(greatest, _)| whole > greatest) {
                best = Some((whole, spot));
            }
        }
        best
    }

    /// Layer `k` holds, for the holder of each spot, what it gains from its next spot on with `k` more evictions.
    fn fill_layers(&mut self, exit: &Exit<'_>, evictions: usize) {
        let spot_count = exit.table.holders().len();
        let leaving: Vec<Option<Prospect>> = (0..spot_count)
            .map(|spot| match exit.table.holder(spot) {
                Holder::Singleton(holder) => Some(Prospect {
                    gain: exit.of(holder).0,
                    spared_evictions: 0,
                }),
                _ => None,
            })
            .collect();
        self.layers.clear();
        self.layers.push(leaving);
        while self.layers.len() < evictions {
            let Some(last) = self.layers.last() else {
                return;
            };
            let mut layer = self.layers[0].clone();
            for (from, entry) in layer.iter_mut().enumerate() {
                let Holder::Singleton(module) = exit.table.holder(from) else {
                    continue;
                };
                let row = exit.rows.row(module);
                for (to, onward) in last.iter().enumerate() {
                    let (Some(onward), Holder::Singleton(holder)) = (onward, exit.table.holder(to))
                    else {
                        continue;
                    };
                    if to != from {
                        let gain = row[to] - exit.rows.row(holder)[to];
                        *entry = (*entry).max(Some(onward.after_eviction(gain)));
                    }
                }
            }
            self.layers.push(layer);
        }
    }
}

/// How a chain ends.
struct Exit<'a> {
    rows: &'a UtilityRows,
    table: &'a SpotTable,
}

impl Exit<'_> {
    /// What a displaced module earns without evicting anybody, and where: at its best free spot, the lowest among
    /// equals, or nowhere when no spot is free.
    fn of(&self, module: usize) -> (i64, Option<usize>) {
        let row = self.rows.row(module);
        let mut best: Option<(i64, usize)> = None;
        for spot in self.table.free_spots() {
            if best.is_none_or(|(utility, _)| row[spot] > utility) {
                best = Some((row[spot], spot));
            }
        }
        best.map_or((0, None), |(utility, spot)| (utility, Some(spot)))
    }

    /// The steps of a chain that evicts the holders of `spots` and ends at `end`.
    fn chain(&self, module: usize, spots: &[usize], end: Option<usize>) -> Vec<Step> {
        let mut chain = Vec::with_capacity(spots.len() + 1);
        let mut mover = module;
        for &spot in spots {
            chain.push(Step {
                module: mover,
                to: Some(spot),
            });
            if let Holder::Singleton(holder) = self.table.holder(spot) {
                mover = holder;
            }
        }
        if !chain.is_empty() || end.is_some() {
            chain.push(Step {
                module: mover,
                to: end,
            });
        }
        chain
    }
}
