//! Docked modules that stand off a common lattice, because they were halted while they folded or at different moments of
//! one step: each goes to a cell near it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::group::{Group, HALF, Rectangle, hull, overlap, square};
use super::lattice::{Lattice, Site, point};
use super::result::StartFault;
use super::turning::off_quarter;
use crate::model::{Area, MicroUnits, PlanningProblem, Pose};

/// How far the corners of a body reach from its middle.
const CORNER: i64 = 636_400;
/// A module takes a cell at most this many columns and rows from the one under it.
const FAR: i64 = 2;

/// The box that holds a body of this pose, whatever quarter turn it turns to.
fn body(pose: &Pose, slack: i64) -> Rectangle {
    let turned = off_quarter(pose.theta.0).abs() > slack;
    let reach = if turned { CORNER } else { HALF };
    let (x, y) = point(pose);
    ((x - reach, y - reach), (x + reach, y + reach))
}

/// The bodies of all modules at the start, by position.
pub(super) fn bodies(problem: &PlanningProblem, slack: i64) -> Vec<Rectangle> {
    let modules = problem.modules().iter();
    modules.map(|module| body(&module.pose, slack)).collect()
}

/// A group of docked modules that each go to a cell of their own, near them and free of other bodies. Within the group,
/// bodies may pass over each other as they do in a fold.
pub(super) fn regroup(
    problem: &PlanningProblem,
    modules: Vec<usize>,
    bodies: &[Rectangle],
    taken: &BTreeSet<Site>,
    lattice: &Lattice,
    slack: i64,
) -> Result<Group, StartFault> {
    let all = problem.modules();
    let is_free = |site: &Site| {
        let cell = square(lattice.point(*site));
        let others = bodies.iter().enumerate();
        let corner = |(x, y): (i64, i64)| (MicroUnits(x), MicroUnits(y));
        let area = Area {
            low: corner(cell.0),
            high: corner(cell.1),
        };
        problem.target().surroundings().admits(&area)
            && !taken.contains(site)
            && others
                .filter(|(module, _)| modules.binary_search(module).is_err())
                .all(|(_, body)| !overlap(&cell, body, slack))
    };
    let way = |module: usize, site: Site| {
        let from = body(&all[module].pose, slack);
        let reach = (from.1.0 - from.0.0) / 2;
        let (x, y) = lattice.point(site);
        hull(from, ((x - reach, y - reach), (x + reach, y + reach)))
    };
    let is_clear = |module: usize, site: Site| {
        let swept = way(module, site);
        let mut others = bodies.iter().enumerate();
        others.all(|(other, body)| {
            modules.binary_search(&other).is_ok() || !overlap(&swept, body, slack)
        })
    };
    let choices = |is_wanted: &dyn Fn(usize, Site) -> bool| -> Vec<Vec<Site>> {
        let near = |&module: &usize| {
            let sites = near(&all[module].pose, lattice).filter(is_free);
            sites.filter(|&site| is_wanted(module, site)).collect()
        };
        modules.iter().map(near).collect()
    };
    // If no ways are clear, the caller finds which bodies are too close.
    let sites = distinct(&choices(&is_clear)).or_else(|| distinct(&choices(&|_, _| true)));
    let sites = sites.ok_or_else(|| {
        let (one, first) = (modules[modules.len() - 1], modules[0]);
        StartFault::OffGroup(all[one].id, all[first].id)
    })?;
    let ways = modules.iter().zip(&sites);
    let ways = ways.map(|(&module, &site)| way(module, site));
    let ways = ways.collect();
    Ok(Group::regrouped(modules, &sites, ways, lattice))
}

/// The cells around a pose, the nearest first.
fn near(pose: &Pose, lattice: &Lattice) -> impl Iterator<Item = Site> + use<> {
    let (x, y) = point(pose);
    let under = lattice.site((x, y));
    let around = (-FAR..=FAR).flat_map(|up| (-FAR..=FAR).map(move |right| (right, up)));
    let mut sites: Vec<(i128, Site)> = around
        .map(|(right, up)| {
            let site = (under.0 + right, under.1 + up);
            let centre = lattice.point(site);
            let squared = |along: i64| i128::from(along).pow(2);
            (squared(centre.0 - x) + squared(centre.1 - y), site)
        })
        .collect();
    sites.sort_unstable();
    sites.into_iter().map(|(_, site)| site)
}

/// A different cell for each list of choices, by augmenting paths (Kuhn).
fn distinct(choices: &[Vec<Site>]) -> Option<Vec<Site>> {
    let mut holders: BTreeMap<Site, usize> = BTreeMap::new();
    for member in 0..choices.len() {
        // Breadth first from the member to a cell that no other holds.
        let mut reached_from: BTreeMap<Site, usize> = BTreeMap::new();
        let mut queue = VecDeque::from([member]);
        let free = 'search: loop {
            let next = queue.pop_front()?;
            for &site in &choices[next] {
                if reached_from.contains_key(&site) {
                    continue;
                }
                reached_from.insert(site, next);
                match holders.get(&site) {
                    None => break 'search site,
                    Some(&holder) => queue.push_back(holder),
                }
            }
        };
        let mut site = free;
        loop {
            let taker = reached_from[&site];
            let left = holders
                .iter()
                .find(|&(_, &holder)| holder == taker)
                .map(|(&site, _)| site);
            holders.insert(site, taker);
            match left {
                Some(left) if taker != member => site = left,
                _ => break,
            }
        }
    }
    let mut sites = vec![(0, 0); choices.len()];
    for (site, member) in holders {
        sites[member] = site;
    }
    Some(sites)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_gets_a_cell_of_its_own() {
        let choices = [
            vec![(0, 0), (1, 0)],
            vec![(0, 0)],
            vec![(1, 0), (0, 0), (2, 0)],
        ];
        assert_eq!(distinct(&choices), Some(vec![(1, 0), (0, 0), (2, 0)]));
        assert_eq!(distinct(&[vec![(0, 0)], vec![(0, 0)]]), None);
    }
}
