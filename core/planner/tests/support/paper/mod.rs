//! Algorithms 1 and 2, written from the paper and `docs/paper.md` alone. Slow, and shares no code with the planner.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::unwrap_used,
    reason = "numbers are small, and a failure in a helper fails the test that calls it"
)]

pub mod candidates;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use candidates::{Graph, Map, all_candidates, kept};

/// The readings, each true for the second name of its option.
#[derive(Clone, Copy, Debug)]
pub struct Readings {
    pub fewest: bool,
    pub best: bool,
    pub lost: bool,
    pub mean_of_ratios: bool,
    pub d_max: usize,
    pub max: usize,
}

/// An instance in micro-units. Modules and spots are named by their position in ascending order of identifier.
#[derive(Clone, Debug)]
pub struct Instance {
    pub target: Graph,
    pub spots: Vec<(i64, i64)>,
    pub links: Graph,
    pub modules: Vec<(i64, i64)>,
}

/// What the algorithms lead to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Result {
    pub spot_of: Map,
    /// Modules that left their configuration.
    pub detached: BTreeSet<usize>,
    /// The spots that changed hands by eviction: the module that lost its spot, and the one that took it.
    pub evictions: Vec<(usize, usize)>,
}

fn distance(one: (i64, i64), other: (i64, i64)) -> i64 {
    let (dx, dy) = (i128::from(one.0 - other.0), i128::from(one.1 - other.1));
    i64::try_from((dx * dx + dy * dy).isqrt()).unwrap()
}

/// The number of edges between two nodes, and the number of shortest paths.
fn paths_from(graph: &Graph, source: usize) -> (Vec<usize>, Vec<u64>) {
    let mut length = vec![usize::MAX; graph.count];
    let mut number = vec![0; graph.count];
    (length[source], number[source]) = (0, 1);
    for at in 0..graph.count {
        for node in (0..graph.count)
            .filter(|&node| length[node] == at)
            .collect::<Vec<_>>()
        {
            for next in graph.around(node) {
                if length[next] == usize::MAX {
                    length[next] = at + 1;
                }
                if length[next] == at + 1 {
                    number[next] += number[node];
                }
            }
        }
    }
    (length, number)
}

/// `Val` of every spot, in micro-units.
pub fn values(target: &Graph, mean_of_ratios: bool) -> Vec<i64> {
    let all: Vec<(Vec<usize>, Vec<u64>)> = (0..target.count)
        .map(|source| paths_from(target, source))
        .collect();
    let value = |spot: usize| {
        let (mut through_all, mut of_all, mut ratios, mut pairs) = (0_u64, 0_u64, 0.0, 0.0);
        for one in (0..target.count).filter(|&one| one != spot) {
            for other in (one + 1..target.count).filter(|&other| other != spot) {
                let number = all[one].1[other];
                let is_between = all[one].0[spot] + all[spot].0[other] == all[one].0[other];
                let through = if is_between {
                    all[one].1[spot] * all[spot].1[other]
                } else {
                    0
                };
                through_all += through;
                of_all += number;
                ratios += through as f64 / number as f64;
                pairs += 1.0;
            }
        }
        if pairs == 0.0 {
            0
        } else if mean_of_ratios {
            (ratios / pairs * 1e6).round() as i64
        } else {
            i64::try_from((2_000_000 * through_all + of_all) / (2 * of_all)).unwrap()
        }
    };
    (0..target.count).map(value).collect()
}

/// The state between turns.
struct State<'a> {
    instance: &'a Instance,
    readings: Readings,
    values: Vec<i64>,
    /// `S` with a bar: the selector of each spot.
    selected: Map,
    /// The modules that are part of a configuration in the target.
    configured: BTreeSet<usize>,
    result: Result,
}

/// Runs all turns.
pub fn run(instance: &Instance, readings: Readings) -> Result {
    let mut state = State {
        instance,
        readings,
        values: values(&instance.target, readings.mean_of_ratios),
        selected: Map::new(),
        configured: BTreeSet::new(),
        result: Result::default(),
    };
    let mut units = units(&instance.links);
    units.sort_by_key(|unit| unit.iter().map(|&module| state.rank(module)).min());
    for unit in units {
        if let [module] = unit[..] {
            state.spot_allocation(module);
        } else {
            state.block_allocation(&unit);
        }
    }
    state.result.spot_of = state
        .selected
        .iter()
        .map(|(&spot, &module)| (module, spot))
        .collect();
    state.result
}

/// The connected parts.
fn units(links: &Graph) -> Vec<Vec<usize>> {
    let mut units: Vec<Vec<usize>> = (0..links.count).map(|module| vec![module]).collect();
    for &(one, other) in &links.edges {
        let at = |module| {
            units
                .iter()
                .position(|unit: &Vec<usize>| unit.contains(&module))
                .unwrap()
        };
        let (here, there) = (at(one), at(other));
        if here != there {
            let moved = std::mem::take(&mut units[there]);
            units[here].extend(moved);
        }
    }
    units.retain(|unit| !unit.is_empty());
    for unit in &mut units {
        unit.sort_unstable();
    }
    units
}

impl State<'_> {
    /// The distance from the centre of the target, then the identifier.
    fn rank(&self, module: usize) -> (i64, usize) {
        let spots = &self.instance.spots;
        let count = i64::try_from(spots.len()).unwrap();
        let centre = (
            spots.iter().map(|spot| spot.0).sum::<i64>() / count,
            spots.iter().map(|spot| spot.1).sum::<i64>() / count,
        );
        (distance(self.instance.modules[module], centre), module)
    }

    /// `U`: the value less locomotion (1 a unit), docking (0.1 a link) and undocking (0.05 a link).
    fn utility(&self, module: usize, spot: usize) -> i64 {
        let count = |around: Vec<usize>| i64::try_from(around.len()).unwrap();
        let way = distance(self.instance.modules[module], self.instance.spots[spot]);
        let docking = 100_000 * count(self.instance.target.around(spot));
        let undocking = 50_000 * count(self.instance.links.around(module));
        self.values[spot] - way - docking - undocking
    }

    fn by_utility(&self, module: usize) -> Vec<usize> {
        let mut spots: Vec<usize> = (0..self.instance.spots.len()).collect();
        spots.sort_by_key(|&spot| (Reverse(self.utility(module, spot)), spot));
        spots
    }

    /// The best spot but those named.
    fn best_but(&self, module: usize, excluded: &[usize]) -> Option<usize> {
        let spots = self.by_utility(module);
        spots.into_iter().find(|spot| !excluded.contains(spot))
    }

    /// Algorithm 1, `evict`: where the evicted modules go, if it answers TRUE.
    fn evict(
        &self,
        current: usize,
        blocking: usize,
        contested: usize,
        before: &[(usize, usize)],
    ) -> Option<Vec<(usize, usize)>> {
        if before.len() >= self.readings.d_max {
            return None;
        }
        let mut lost = vec![contested];
        if self.readings.lost {
            // What `current` has lost: the spot that was contested when it was evicted.
            lost.extend(before.last().map(|&(_, from)| from));
        }
        let for_blocking = self.best_but(blocking, &[contested])?;
        let for_current = self.best_but(current, &lost)?;
        let with = self.utility(current, contested) + self.utility(blocking, for_blocking);
        let without = self.utility(current, for_current) + self.utility(blocking, contested);
        if with <= without {
            return None;
        }
        let mut chain = vec![(blocking, for_blocking)];
        let Some(&next) = self.selected.get(&for_blocking) else {
            return Some(chain);
        };
        if self.configured.contains(&next) {
            return None;
        }
        let mut evicted = before.to_vec();
        evicted.push((blocking, contested));
        let is_in_chain = evicted.iter().any(|&(module, _)| module == next);
        if self.readings.lost && is_in_chain {
            return None;
        }
        chain.extend(self.evict(blocking, next, for_blocking, &evicted)?);
        Some(chain)
    }

    /// Lets evicted modules move on, if their spots are still as they were.
    fn follow(&mut self, chain: &[(usize, usize)]) {
        for (number, &(module, spot)) in chain.iter().enumerate() {
            let holder = self.selected.get(&spot).copied();
            let next = chain.get(number + 1).map(|next| next.0);
            if holder.is_some() && holder != next {
                return;
            }
            self.selected.insert(spot, module);
            match holder {
                Some(holder) => self.result.evictions.push((holder, module)),
                None => return,
            }
        }
    }

    /// Algorithm 1, `spotAllocation`.
    fn spot_allocation(&mut self, module: usize) {
        for spot in self.by_utility(module) {
            let chain = match self.selected.get(&spot) {
                None => Some(Vec::new()),
                Some(holder) if self.configured.contains(holder) => None,
                Some(&holder) => self.evict(module, holder, spot, &[]),
            };
            if let Some(chain) = chain {
                let evicted = self.selected.insert(spot, module);
                self.result
                    .evictions
                    .extend(evicted.map(|evicted| (evicted, module)));
                self.follow(&chain);
                return;
            }
        }
    }

    /// Algorithm 2, `blockAllocation`.
    fn block_allocation(&mut self, members: &[usize]) {
        let own = |module: &usize| members.binary_search(module).unwrap();
        let links = self.instance.links.edges.iter();
        let links = links.filter(|(one, _)| members.contains(one));
        let configuration = Graph {
            count: members.len(),
            edges: links.map(|(one, other)| (own(one), own(other))).collect(),
        };
        let utility = |module: usize, spot| self.utility(members[module], spot);
        let target = self.instance.target.clone();
        let mut candidates = all_candidates(
            &configuration,
            &target,
            &self.values,
            &utility,
            self.readings.best,
        );
        candidates.truncate(self.readings.max);
        let mut candidates: Vec<Map> = candidates.into_iter().map(|(_, map)| map).collect();
        candidates.sort_by_key(|map| {
            Reverse(
                map.iter()
                    .map(|(&module, &spot)| utility(module, spot))
                    .sum::<i64>(),
            )
        });
        let answers = |map: &Map| -> BTreeMap<usize, Option<Vec<(usize, usize)>>> {
            let pairs = map.iter();
            pairs
                .map(|(&module, &spot)| {
                    let answer = match self.selected.get(&spot) {
                        None => Some(Vec::new()),
                        Some(holder) if self.configured.contains(holder) => None,
                        Some(&holder) => self.evict(members[module], holder, spot, &[]),
                    };
                    (module, answer)
                })
                .collect()
        };
        let refused = |map: &Map| answers(map).values().filter(|one| one.is_none()).count();
        let whole = candidates.iter().find(|&map| refused(map) == 0);
        let taken = whole.or(if self.readings.fewest {
            candidates.iter().min_by_key(|map| refused(map))
        } else {
            candidates.last()
        });
        let taken = taken.unwrap().clone();
        let answers = answers(&taken);
        self.take(members, &configuration, &taken, &answers);
    }

    /// Lines 6 to 24 for the candidate that is taken.
    fn take(
        &mut self,
        members: &[usize],
        configuration: &Graph,
        taken: &Map,
        answers: &BTreeMap<usize, Option<Vec<(usize, usize)>>>,
    ) {
        let placed: Map = taken
            .iter()
            .filter(|(module, _)| answers[module].is_some())
            .map(|(&module, &spot)| (module, spot))
            .collect();
        let links = kept(configuration, &self.instance.target, &placed);
        let together: BTreeSet<usize> = links
            .iter()
            .flat_map(|&(one, other)| [one, other])
            .collect();
        for (&module, &spot) in &placed {
            let evicted = self.selected.insert(spot, members[module]);
            self.result
                .evictions
                .extend(evicted.map(|evicted| (evicted, members[module])));
        }
        self.configured
            .extend(together.iter().map(|&module| members[module]));
        for module in placed.keys() {
            if let Some(chain) = &answers[module] {
                self.follow(chain);
            }
        }
        let is_refused = |module: usize| answers.get(&module).is_some_and(Option::is_none);
        let is_unmatched = |module: usize| !taken.contains_key(&module);
        for leaves in [&is_refused as &dyn Fn(usize) -> bool, &is_unmatched] {
            let mut leaving: Vec<usize> = (0..members.len())
                .filter(|&module| leaves(module))
                .map(|module| members[module])
                .collect();
            leaving.sort_by_key(|&module| self.rank(module));
            for module in leaving {
                self.spot_allocation(module);
            }
        }
        let detached = (0..members.len()).filter(|module| !together.contains(module));
        self.result
            .detached
            .extend(detached.map(|module| members[module]));
    }
}
