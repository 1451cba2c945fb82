//! The value of a spot by the printed formula of the paper, which on graphs with cycles is not the betweenness centrality.

use crate::value::betweenness;
use crate::value::centrality::{PathCount, RADIX};
use formation_model::{MICRO_PER_UNIT, MicroUnits, Topology};

/// For every node of a connected graph, the number of shortest paths between two other nodes that run through it, divided
/// by the number of all shortest paths between two other nodes. In ascending order of nodes; all zero for fewer than three.
///
/// On trees, where every pair has one path, it equals [`betweenness`]. Elsewhere pairs with many shortest paths weigh more.
/// The counts are whole numbers up to 128 bits; beyond, a float with a wide exponent takes their place, with sums and
/// products in a fixed order.
#[must_use]
pub fn share_of_shortest_paths(topology: &Topology) -> Vec<MicroUnits> {
    if topology.is_tree() || topology.node_count() < 3 {
        return betweenness(topology);
    }
    let exact = counts::<u128>(topology).and_then(|counts| {
        counts
            .into_iter()
            .map(|(part, whole)| ratio(part, whole))
            .collect()
    });
    exact.unwrap_or_else(|| {
        let counts = counts::<PathCount>(topology).unwrap_or_default();
        let shares = counts.into_iter().map(|(part, whole)| {
            let is_rounded_up = part.exponent > whole.exponent;
            let share = if is_rounded_up {
                1.0
            } else {
                part.share_of(whole)
            };
            MicroUnits::from_units(share).unwrap_or(MicroUnits::ZERO)
        });
        shares.collect()
    })
}

/// A ratio in micro-units, rounded half up; `None` if a number exceeds 128 bits. Zero of zero is zero.
fn ratio(part: u128, whole: u128) -> Option<MicroUnits> {
    let doubled = part.checked_mul(2 * u128::from(MICRO_PER_UNIT.unsigned_abs()))?;
    let rounded = doubled.checked_add(whole)? / whole.checked_mul(2)?.max(1);
    Some(MicroUnits(i64::try_from(rounded).ok()?))
}

/// A number of paths.
trait Count: Copy + Default {
    const ONE: Self;

    /// `None` if the sum does not fit.
    fn plus(self, other: Self) -> Option<Self>;

    /// `None` if the product does not fit.
    fn times(self, other: Self) -> Option<Self>;
}

impl Count for u128 {
    const ONE: Self = 1;

    fn plus(self, other: Self) -> Option<Self> {
        self.checked_add(other)
    }

    fn times(self, other: Self) -> Option<Self> {
        self.checked_mul(other)
    }
}

impl Count for PathCount {
    const ONE: Self = Self::ONE;

    fn plus(self, other: Self) -> Option<Self> {
        Some(Self::plus(self, other))
    }

    fn times(self, other: Self) -> Option<Self> {
        let mantissa = self.mantissa * other.mantissa;
        let exponent = self.exponent + other.exponent;
        Some(if mantissa > RADIX {
            Self {
                mantissa: mantissa / RADIX,
                exponent: exponent + 1,
            }
        } else {
            Self { mantissa, exponent }
        })
    }
}

/// For every node, the shortest paths between two others through it, and all shortest paths between two others; each path
/// counts once in each direction.
fn counts<C: Count>(topology: &Topology) -> Option<Vec<(C, C)>> {
    let node_count = topology.node_count();
    let mut counts = vec![(C::default(), C::default()); node_count];
    for source in 0..node_count {
        let (order, distances) = by_distance(topology, source);
        let nearer = |node: usize| {
            let neighbours = topology.neighbours(node).iter().copied();
            neighbours
                .filter(|&other| distances[other] < distances[node])
                .collect::<Vec<_>>()
        };
        let mut paths = vec![C::default(); node_count];
        paths[source] = C::ONE;
        for &node in order.iter().skip(1) {
            for other in nearer(node) {
                paths[node] = paths[node].plus(paths[other])?;
            }
        }
        // The number of ways to go on from each node, away from the source, to another one.
        let mut onward = vec![C::default(); node_count];
        for &node in order.iter().skip(1).rev() {
            counts[node].0 = counts[node].0.plus(paths[node].times(onward[node])?)?;
            let ways = onward[node].plus(C::ONE)?;
            for other in nearer(node) {
                onward[other] = onward[other].plus(ways)?;
            }
        }
        paths[source] = C::default();
        add_all_but_own(&paths, source, &mut counts)?;
    }
    Some(counts)
}

/// Adds, for each node but the source, the paths to all other nodes.
fn add_all_but_own<C: Count>(paths: &[C], source: usize, counts: &mut [(C, C)]) -> Option<()> {
    let mut after = vec![C::default(); paths.len() + 1];
    for node in (0..paths.len()).rev() {
        after[node] = after[node + 1].plus(paths[node])?;
    }
    let mut before = C::default();
    for (node, &own) in paths.iter().enumerate() {
        if node != source {
            let others = before.plus(after[node + 1])?;
            counts[node].1 = counts[node].1.plus(others)?;
        }
        before = before.plus(own)?;
    }
    Some(())
}

/// The nodes by distance from one of them, and the distances.
fn by_distance(topology: &Topology, source: usize) -> (Vec<usize>, Vec<usize>) {
    let mut distances = vec![usize::MAX; topology.node_count()];
    let mut order = vec![source];
    distances[source] = 0;
    let mut next = 0;
    while let Some(&node) = order.get(next) {
        for &neighbour in topology.neighbours(node) {
            if distances[neighbour] == usize::MAX {
                distances[neighbour] = distances[node] + 1;
                order.push(neighbour);
            }
        }
        next += 1;
    }
    (order, distances)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_with_many_paths_weigh_more() {
        // A square with a tail: 0-1-2-3-0, 0-4. Between 1 and 3, and between 2 and 4, there are two paths, through 0 and 2
        // and through 1 and 3.
        let graph = Topology::new(5, &[(0, 1), (1, 2), (2, 3), (0, 3), (0, 4)]);
        let printed = share_of_shortest_paths(&graph);
        // Through 0: 1-0-3, 1-0-4, 3-0-4 and both paths 2-4, of 8 between others: 1-2, 1-3 twice, 1-4, 2-3, 2-4 twice, 3-4.
        assert_eq!(printed[0], MicroUnits(625_000));
        // Through 2: 1-2-3, of 7 between others: 0-1, 0-3, 0-4, 1-3 twice, 1-4, 3-4.
        assert_eq!(printed[2], MicroUnits(142_857));
        assert_eq!(betweenness(&graph)[2], MicroUnits(83_333));
        assert_eq!(printed[4], MicroUnits::ZERO);
    }

    #[test]
    fn counts_beyond_128_bits_agree_with_exact_ones() {
        let grid = crate::grid::grid(8);
        let exact = counts::<u128>(grid.topology()).unwrap();
        let wide = counts::<PathCount>(grid.topology()).unwrap();
        for ((part, whole), (wide_part, wide_whole)) in exact.into_iter().zip(wide) {
            let share = MicroUnits::from_units(wide_part.share_of(wide_whole)).unwrap();
            let difference = (ratio(part, whole).unwrap() - share).0.abs();
            assert!(difference <= 1, "{difference}");
        }
        // The middle of a grid of 80 has more shortest paths than 128 bits count.
        let large = crate::grid::grid(80);
        assert!(counts::<u128>(large.topology()).is_none());
        let shares = share_of_shortest_paths(large.topology());
        assert!(shares.iter().all(|share| (0..1_000_000).contains(&share.0)));
        assert!(shares[40 * 80 + 40] > shares[0]);
    }
}
