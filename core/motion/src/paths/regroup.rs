//! Docked modules that stand off a common lattice, because they were halted while they folded or at different moments of
//! one step: each goes to a cell near it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::group::Group;
use super::lattice::{Lattice, Site, point};
use super::rectangle::{HALF, Rectangle};
use super::resting::Form;
use super::result::StartFault;
use super::shape::Shape;
use formation_model::turning::off_quarter;
use formation_model::{PlanningProblem, Pose};

/// A module takes a cell at most this many columns and rows from the one under it.
const FAR: i64 = 2;

/// Where modules may regroup: what others cover, and the cells that they take.
pub(super) struct RegroupingGround<'a, Open> {
    problem: &'a PlanningProblem,
    lattice: &'a Lattice,
    form: Form,
    slack: i64,
    is_open: Open,
    /// What the modules of a group cover, and which they are.
    covered: Vec<(Vec<usize>, Shape)>,
    taken: BTreeSet<Site>,
}

impl<'a, Open: Fn(&Rectangle) -> bool> RegroupingGround<'a, Open> {
    /// Without any modules. `is_open` says whether a rectangle is free of obstacles and within the walls.
    pub fn new(
        problem: &'a PlanningProblem,
        (lattice, form): (&'a Lattice, Form),
        slack: i64,
        is_open: Open,
    ) -> Self {
        Self {
            problem,
            lattice,
            form,
            slack,
            is_open,
            covered: Vec::new(),
            taken: BTreeSet::new(),
        }
    }

    /// A group takes its cells and covers what it needs before it shifts.
    pub fn take(&mut self, group: &Group) {
        self.taken
            .extend((0..group.modules.len()).map(|member| group.site_of(member)));
        self.cover(&group.modules, group.bodies());
    }

    /// Modules stand where they are until they regroup.
    pub fn stand(&mut self, modules: &[usize]) {
        let bodies = modules.iter().map(|&module| self.body(module).0);
        self.cover(modules, bodies.collect());
    }

    fn cover(&mut self, modules: &[usize], shapes: Vec<Shape>) {
        let of_modules = |shape| (modules.to_vec(), shape);
        self.covered.extend(shapes.into_iter().map(of_modules));
    }

    /// What the body of a module covers where it stands, and what it covers there while it comes into line.
    fn body(&self, module: usize) -> (Shape, Shape) {
        let pose = &self.problem.modules()[module].pose;
        let middle = point(pose);
        let off = off_quarter(pose.theta.0);
        if self.form.is_round {
            let circle = Shape::circle(middle, HALF);
            return (circle.clone(), circle);
        }
        if off.abs() <= self.slack {
            let cell = Shape::square(middle, HALF);
            return (cell.clone(), cell);
        }
        let half = self.problem.target().surroundings().body_width().0 / 2;
        let corner = (2 * half * half).isqrt() + 1;
        (
            Shape::turned_square(middle, half, off),
            Shape::circle(middle, corner),
        )
    }

    fn way(&self, module: usize, site: Site) -> Shape {
        let from = point(&self.problem.modules()[module].pose);
        self.body(module).1.moved((from, self.lattice.point(site)))
    }

    /// Whether some modules cover nothing of others, of obstacles or of what is beyond the walls, with a shape.
    fn is_clear(&self, modules: &[usize], shape: &Shape) -> bool {
        let mut others = self.covered.iter().filter(|(its, _)| its != modules);
        (self.is_open)(&shape.bounds()) && others.all(|(_, body)| !shape.overlaps(body, self.slack))
    }

    /// A group of docked modules that each go to a cell of their own, near them and free of other bodies. Within the group,
    /// bodies may pass over each other as they do in a fold.
    pub fn regroup(&self, modules: Vec<usize>) -> Result<Group, StartFault> {
        if let [module] = modules[..]
            && let Some(group) = self.entry(module)
        {
            return Ok(group);
        }
        let is_free = |site: &Site| {
            let cell = Shape::square(self.lattice.point(*site), HALF);
            !self.taken.contains(site) && self.is_clear(&modules, &cell)
        };
        let all = self.problem.modules();
        let choices = |is_wanted: &dyn Fn(usize, Site) -> bool| -> Vec<Vec<Site>> {
            let near = |&module: &usize| {
                let sites = near(&all[module].pose, self.lattice).filter(is_free);
                sites.filter(|&site| is_wanted(module, site)).collect()
            };
            modules.iter().map(near).collect()
        };
        let has_clear_way =
            |module: usize, site: Site| self.is_clear(&modules, &self.way(module, site));
        // If no ways are clear, the caller finds which bodies are too close.
        let sites = distinct(&choices(&has_clear_way)).or_else(|| distinct(&choices(&|_, _| true)));
        let sites = sites.ok_or_else(|| {
            let (one, first) = (modules[modules.len() - 1], modules[0]);
            StartFault::OffGroup(all[one].id, all[first].id)
        })?;
        let ways = modules.iter().zip(&sites);
        let ways = ways.map(|(&module, &site)| self.way(module, site));
        let ways = ways.collect();
        Ok(Group::regrouped(modules, &sites, ways, self.lattice))
    }
}

/// A module that is turned against the lattice shifts to a cell as it is, and turns there.
impl<Open: Fn(&Rectangle) -> bool> RegroupingGround<'_, Open> {
    fn entry(&self, module: usize) -> Option<Group> {
        let pose = &self.problem.modules()[module].pose;
        let turn = -off_quarter(pose.theta.0);
        if self.form.is_round || turn.abs() <= self.slack {
            return None;
        }
        let (from, body) = (point(pose), self.body(module).0);
        let modules = [module];
        let mut sites = near(pose, self.lattice);
        sites.find_map(|site| {
            let to = self.lattice.point(site);
            let way = body.clone().moved((from, to));
            let circle = Shape::circle(to, self.form.reach(HALF));
            let is_clear = !self.taken.contains(&site)
                && self.is_clear(&modules, &circle)
                && self.is_clear(&modules, &way);
            is_clear.then(|| {
                let ways = vec![way, circle];
                Group::regrouped(modules.into(), &[site], ways, self.lattice)
                    .turning(turn, self.form.reach(HALF))
            })
        })
    }
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
