//! Scenarios on given cells of the unit lattice, such as the free ones of a map.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use formation_model::{PlannerParameters, RawModule, RawScenario, RawSpot, RawTarget};

use crate::Random;

/// A cell of the unit lattice by its middle, in units.
pub type LatticeCell = (i64, i64);

/// The neighbours of a cell.
fn beside((x, y): LatticeCell) -> [LatticeCell; 4] {
    [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
}

/// The cells that are connected to `from`, in breadth-first order.
fn connected(free: &BTreeSet<LatticeCell>, from: LatticeCell) -> Vec<LatticeCell> {
    let mut found = vec![from];
    let mut seen = BTreeSet::from([from]);
    let mut queue = VecDeque::from([from]);
    while let Some(cell) = queue.pop_front() {
        for next in beside(cell) {
            if free.contains(&next) && seen.insert(next) {
                found.push(next);
                queue.push_back(next);
            }
        }
    }
    found
}

/// The largest connected part of the free cells; among equals the one with the lowest cell.
fn largest_part(free: &BTreeSet<LatticeCell>) -> Vec<LatticeCell> {
    let mut left = free.clone();
    let mut largest = Vec::new();
    while let Some(&from) = left.first() {
        let part = connected(&left, from);
        for cell in &part {
            left.remove(cell);
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

/// A scenario of `count` single modules in the largest connected part of the free cells: a connected target of as many spots,
/// grown breadth-first from a random cell, and modules on other random cells.
///
/// Returns `None` if that part has too few cells.
pub fn on_cells(free: &BTreeSet<LatticeCell>, count: usize, seed: u64) -> Option<RawScenario> {
    let mut part = largest_part(free);
    if count == 0 || part.len() < 2 * count {
        return None;
    }
    part.sort_unstable();
    let mut random = Random::from_seed(seed);
    let root = part[random.index(part.len())];
    let spots: Vec<LatticeCell> = connected(free, root).into_iter().take(count).collect();
    let ids: BTreeMap<LatticeCell, u32> = spots.iter().copied().zip(1..).collect();
    let mut starts: Vec<LatticeCell> = part
        .into_iter()
        .filter(|cell| !ids.contains_key(cell))
        .collect();
    random.shuffle(&mut starts);
    let mut edges = Vec::new();
    for (&(x, y), &id) in &ids {
        let others = [(x + 1, y), (x, y + 1)];
        edges.extend(
            others
                .iter()
                .filter_map(|other| Some([id, *ids.get(other)?])),
        );
    }
    let place = |(cell, id): (LatticeCell, u32)| {
        #[expect(clippy::cast_precision_loss, reason = "cells of a map are few")]
        let (x, y) = (cell.0 as f64, cell.1 as f64);
        (id, x, y)
    };
    let theta = 0.0;
    Some(RawScenario {
        name: format!("on_cells_{count}_{seed}"),
        target: RawTarget {
            frame_id: "map".to_owned(),
            spots: spots
                .into_iter()
                .zip(1..)
                .map(place)
                .map(|(id, x, y)| RawSpot { id, x, y, theta })
                .collect(),
            edges,
        },
        configurations: Vec::new(),
        singletons: starts
            .into_iter()
            .take(count)
            .zip(1..)
            .map(place)
            .map(|(id, x, y)| RawModule { id, x, y, theta })
            .collect(),
        planner: PlannerParameters::default(),
        module_size: None,
        body: formation_model::BodyShape::default(),
        body_width: None,
        obstacles: Vec::new(),
        arena: None,
        given: None,
        in_parts: false,
    })
}

#[cfg(test)]
mod tests {
    use formation_model::Scenario;

    use super::*;

    #[test]
    fn a_target_is_connected_and_modules_stand_on_other_cells_of_its_part() {
        // Two rooms without a door: 5 by 4 and 3 by 2 cells.
        let rooms = (0..5).flat_map(|x| (0..4).map(move |y| (x, y)));
        let other = (7..10).flat_map(|x| (0..2).map(move |y| (x, y)));
        let free: BTreeSet<LatticeCell> = rooms.chain(other).collect();
        for seed in 0..20 {
            let raw = on_cells(&free, 10, seed).unwrap();
            let singles = raw.singletons.clone();
            assert!(singles.iter().all(|module| module.x < 5.0));
            let taken: BTreeSet<String> = raw
                .target
                .spots
                .iter()
                .chain(&singles)
                .map(|place| format!("{} {}", place.x, place.y))
                .collect();
            assert_eq!(taken.len(), 20, "no two on one cell");
            Scenario::try_from(raw).unwrap();
        }
        assert_eq!(on_cells(&free, 11, 0), None);
        assert_eq!(on_cells(&free, 10, 3), on_cells(&free, 10, 3));
    }
}
