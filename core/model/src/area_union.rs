//! The union of rectangles as the fewest rectangles of one canonical form.
//!
//! A sweep line moves along y. Between two edges, the union is a set of intervals of x; each interval that stays the same over
//! several edges is one rectangle. The result depends on the union alone, so two drawings of one wall agree (a canonical
//! decomposition into slabs, as in M. de Berg et al., Computational Geometry, 2008, chapter 6.1).

use std::collections::BTreeMap;

use crate::{Area, MicroUnits};

/// More steps of the sweep than this are not taken: the areas overlap each other too often.
const STEPS_MAX: usize = 100_000_000;

/// An interval of x.
type Interval = (MicroUnits, MicroUnits);

/// Why areas have no union of a bounded size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnionError {
    /// The union has more rectangles than are allowed.
    TooMany,
    /// The areas overlap each other too often.
    TooDense,
}

/// The union of `areas` as at most `max` disjoint rectangles, ascending by their lower edges.
pub(crate) fn union(areas: &[Area], max: usize) -> Result<Vec<Area>, UnionError> {
    // The intervals that begin and end at each edge.
    let mut edges: BTreeMap<MicroUnits, (Vec<Interval>, Vec<Interval>)> = BTreeMap::new();
    for area in areas {
        let interval = (area.low.0, area.high.0);
        edges.entry(area.low.1).or_default().0.push(interval);
        edges.entry(area.high.1).or_default().1.push(interval);
    }
    let mut covered: BTreeMap<Interval, usize> = BTreeMap::new();
    let mut open: BTreeMap<Interval, MicroUnits> = BTreeMap::new();
    let mut closed: Vec<Area> = Vec::new();
    let mut steps = 0;
    for (&y, (begun, ended)) in &edges {
        for &interval in begun {
            *covered.entry(interval).or_default() += 1;
        }
        for interval in ended {
            if let Some(count) = covered.get_mut(interval) {
                *count -= 1;
                if *count == 0 {
                    covered.remove(interval);
                }
            }
        }
        steps += covered.len();
        if steps > STEPS_MAX {
            return Err(UnionError::TooDense);
        }
        let joined = joined(covered.keys().copied());
        let mut next: BTreeMap<Interval, MicroUnits> = BTreeMap::new();
        for interval in joined {
            next.insert(interval, open.remove(&interval).unwrap_or(y));
        }
        closed.extend(open.iter().map(|(&(left, right), &from)| Area {
            low: (left, from),
            high: (right, y),
        }));
        open = next;
        if open.len() + closed.len() > max {
            return Err(UnionError::TooMany);
        }
    }
    closed.sort_by_key(|area| (area.low.1, area.low.0));
    Ok(closed)
}

/// Intervals, ascending, without those that touch or overlap each other: such are joined.
fn joined(intervals: impl Iterator<Item = Interval>) -> Vec<Interval> {
    let mut joined: Vec<Interval> = Vec::new();
    for (left, right) in intervals {
        match joined.last_mut() {
            Some(last) if left <= last.1 => last.1 = last.1.max(right),
            _ => joined.push((left, right)),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(left: i64, bottom: i64, right: i64, top: i64) -> Area {
        let corner = |x, y| (MicroUnits(x), MicroUnits(y));
        Area {
            low: corner(left, bottom),
            high: corner(right, top),
        }
    }

    #[test]
    fn two_drawings_of_one_wall_are_equal() {
        // An L of three cells: as cells, as two bars that overlap, and the other way round.
        let cells = [area(0, 0, 1, 1), area(1, 0, 2, 1), area(0, 1, 1, 2)];
        let bars = [area(0, 0, 2, 1), area(0, 0, 1, 2)];
        let other = [area(0, 1, 1, 2), area(0, 0, 2, 1), area(1, 0, 2, 1)];
        let expected = [area(0, 0, 2, 1), area(0, 1, 1, 2)];
        for drawing in [&cells[..], &bars, &other] {
            assert_eq!(union(drawing, 2).unwrap(), expected);
        }
        assert_eq!(union(&cells, 1), Err(UnionError::TooMany));
        assert_eq!(union(&[], 0).unwrap(), []);
    }

    /// Compares with a count of the cells of a small grid.
    #[test]
    fn the_union_covers_what_its_parts_cover_and_no_more() {
        let mut state = 7_u64;
        let mut drawn = |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            i64::try_from((state >> 33) % below).unwrap()
        };
        for _ in 0..200 {
            let areas: Vec<Area> = (0..drawn(9))
                .map(|_| {
                    let (x, y) = (drawn(7), drawn(7));
                    area(x, y, x + 1 + drawn(3), y + 1 + drawn(3))
                })
                .collect();
            let union = union(&areas, 100).unwrap();
            for (x, y) in (0..10).flat_map(|x| (0..10).map(move |y| (x, y))) {
                let cell = area(x, y, x + 1, y + 1);
                let covers =
                    |areas: &[Area]| areas.iter().filter(|one| one.overlaps(&cell)).count();
                assert_eq!(covers(&union), covers(&areas).min(1), "{areas:?}");
            }
            let mut shuffled = areas;
            shuffled.reverse();
            assert_eq!(super::union(&shuffled, 100).unwrap(), union);
        }
    }

    #[test]
    fn areas_that_overlap_each_other_for_ever_are_refused() {
        let areas: Vec<Area> = (0..20_000)
            .map(|at| area(at, at, 1_000_000 - at, 1_000_000 - at))
            .collect();
        assert_eq!(union(&areas, 2_000), Err(UnionError::TooDense));
    }
}
