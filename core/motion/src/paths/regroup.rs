//! Docked modules that stand off a common lattice, because they were halted while they folded or at different moments of
//! one step: each goes to a cell near it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::group::Group;
use super::lattice::{Lattice, Site, point};
use super::rectangle::HALF;
use super::resting::Form;
use super::result::{MotionRequest, StartFault};
use super::shape::Shape;
use formation_model::PlanningProblem;
use formation_model::turning::{Point, off_quarter};

/// A module takes a cell at most this many columns and rows from the one under it.
const FAR: i64 = 2;

/// A group shifts at most this many columns and rows to where it has room to turn.
const FAR_OF_GROUPS: i64 = 5;

/// How far a group shifts before it is clear of what it was docked to: a tenth of a unit.
const LEAVING: i64 = 100_000;

/// By how much a body may overlap what is drawn of another beside which it stands: turned bodies are drawn up to a part in 32 of their
/// extent too large.
const OVERDRAWN: i64 = 50_000;

/// Where modules may regroup: what others cover, and the cells that they take.
pub(super) struct RegroupingGround<'a> {
    request: &'a MotionRequest<'a>,
    problem: &'a PlanningProblem,
    lattice: &'a Lattice,
    form: Form,
    slack: i64,
    /// What the modules of a group cover, and which they are.
    covered: Vec<(Vec<usize>, Shape)>,
    taken: BTreeSet<Site>,
}

impl<'a> RegroupingGround<'a> {
    /// Without any modules.
    pub fn new(
        request: &'a MotionRequest<'a>,
        (lattice, form): (&'a Lattice, Form),
        slack: i64,
    ) -> Self {
        Self {
            request,
            problem: request.problem,
            lattice,
            form,
            slack,
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

    /// The same, with the whole cells of the modules, as they are turned.
    pub fn stand_in_cells(&mut self, modules: &[usize]) {
        let cells = modules.iter().map(|&module| self.outline(module, HALF));
        self.cover(modules, cells.collect());
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
        self.request.is_open(shape) && others.all(|(_, body)| !shape.overlaps(body, self.slack))
    }

    /// Whether a module can shift so far from where it stands, with its whole cell past other modules.
    fn may_shift(&self, modules: &[usize], module: usize, by: Point) -> bool {
        let half = self.problem.target().surroundings().body_width().0 / 2;
        let way = self.outline(module, HALF).moved(((0, 0), by));
        let mut others = self.covered.iter().filter(|(its, _)| its != modules);
        let is_clear = others.all(|(_, other)| !way.overlaps(other, self.slack));
        let length = i64::max(by.0.abs(), by.1.abs()).max(1);
        let leaving = |along: i64| along * LEAVING.min(length) / length;
        let left = (leaving(by.0), leaving(by.1));
        let rest = self.outline(module, HALF.midpoint(half)).shifted(left);
        is_clear
            && self.leaves_obstacles(module, left)
            && self.request.is_open(&rest.moved((left, by)))
    }

    /// Whether the body of a module meets no obstacle while it shifts so far. Obstacles are drawn a little larger than the bodies that
    /// they stand for, and one that was docked may have been halted at another moment: those are left behind.
    fn leaves_obstacles(&self, module: usize, by: Point) -> bool {
        let half = self.problem.target().surroundings().body_width().0 / 2;
        let body = self.outline(module, half);
        let way = body.clone().moved(((0, 0), by));
        let mut met = self.request.blocking(&way);
        met.all(|obstacle| body.overlaps(&obstacle, 0) && body.leaves(&obstacle, OVERDRAWN, by))
    }

    /// What a module would cover where it stands if its body were so wide.
    fn outline(&self, module: usize, half: i64) -> Shape {
        let pose = &self.problem.modules()[module].pose;
        self.form.shape(point(pose), pose.theta.0, half)
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
                let sites = near(point(&all[module].pose), FAR, self.lattice).filter(is_free);
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
impl RegroupingGround<'_> {
    fn entry(&self, module: usize) -> Option<Group> {
        let pose = &self.problem.modules()[module].pose;
        let turn = -off_quarter(pose.theta.0);
        if self.form.is_round || turn.abs() <= self.slack {
            return None;
        }
        let (from, body) = (point(pose), self.body(module).0);
        let modules = [module];
        let mut sites = near(from, FAR, self.lattice);
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

    /// A group that has no room to turn where it stands shifts as one body to where it has, and turns there. `None` if it has room
    /// nowhere near.
    pub fn enter(&self, group: &Group) -> Option<Group> {
        let all = self.problem.modules();
        let modules = &group.modules;
        let poses = modules.iter().map(|&module| point(&all[module].pose));
        let poses: Vec<Point> = poses.collect();
        let mut sites = near(group.centre, FAR_OF_GROUPS, self.lattice);
        sites.find_map(|site| {
            let to = self.lattice.point(site);
            let by = (to.0 - group.centre.0, to.1 - group.centre.1);
            let circle = Shape::circle(to, group.radius);
            let is_taken =
                |&(right, up): &Site| self.taken.contains(&(site.0 + right, site.1 + up));
            if group.offsets.iter().any(is_taken) || !self.is_clear(modules, &circle) {
                return None;
            }
            if !modules
                .iter()
                .all(|&module| self.may_shift(modules, module, by))
            {
                return None;
            }
            let ways = modules.iter().zip(&poses).map(|(&module, &from)| {
                let end = (from.0 + by.0, from.1 + by.1);
                self.outline(module, HALF).moved((from, end))
            });
            let mut ways: Vec<Shape> = ways.collect();
            ways.push(circle);
            let ends = poses.iter().map(|from| (from.0 + by.0, from.1 + by.1));
            Some(group.entering(site, to, ends.collect(), ways))
        })
    }
}

/// The cells around a point, at most so many columns and rows away, the nearest first.
fn near((x, y): Point, far: i64, lattice: &Lattice) -> impl Iterator<Item = Site> + use<> {
    let under = lattice.site((x, y));
    let around = (-far..=far).flat_map(move |up| (-far..=far).map(move |right| (right, up)));
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
