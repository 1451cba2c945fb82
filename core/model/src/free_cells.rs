//! The cells of the target's lattice through which modules can get to its spots, past obstacles, walls and bodies.
//!
//! Modules move by steps from a cell to the next one to the right, above, to the left or below, so two cells that touch at
//! a corner alone are not next to each other. The rules are those of the motion: a cell is closed if an obstacle or a
//! body overlaps it, or if it is not wholly within the walls.

use crate::{Area, MICRO_PER_UNIT, MicroUnits, PlanningModule, Pose, Target};

/// The most cells that are looked at. With more, only obstacles near modules and spots count; if these are too far apart, none.
const CELLS_MAX: i64 = 4_000_000;

/// How far obstacles then count beyond the box of all modules and spots, in cells on top of that box's longer side. Ways lead
/// round what is farther away.
const MARGIN: i64 = 256;

/// A free row of cells round all obstacles, and round it a closed ring, at which searches end.
const RIM: i64 = 2;

/// How far a coordinate of a spot may be off its cell's middle.
const TOLERANCE: i64 = 1_000;

/// No steps lead there.
pub const CELL_UNREACHED: u32 = u32::MAX;

/// A cell: column and row, counted from the first spot's.
type Site = (i64, i64);

/// The cells in the box of all modules, spots and obstacles, with a rim through which a way can lead round all of them.
#[derive(Clone, Debug)]
pub struct FreeCells {
    /// The middle of the cell of the first spot.
    origin: Site,
    low: Site,
    width: usize,
    closed: Vec<bool>,
    body_width: MicroUnits,
    spots: Vec<usize>,
}

impl FreeCells {
    /// The cells around modules and the spots of a target; bodies that take no part stand on `bodies`. `None` if nothing
    /// stands there and no module has settled, if the spots are not cells of a lattice on which each edge is a step, or if there are too many cells.
    #[must_use]
    pub fn around(target: &Target, modules: &[PlanningModule], bodies: &[Area]) -> Option<Self> {
        let surroundings = target.surroundings();
        let has_settled = modules.iter().any(|module| module.pin.is_some());
        if surroundings.is_open() && bodies.is_empty() && !has_settled {
            return None;
        }
        let first = target.spots().first()?;
        let origin = (first.pose.x.0, first.pose.y.0);
        let sites = lattice_sites(target, origin)?;
        let starts = modules.iter().map(|module| site(origin, &module.pose));
        let inner = Frame::around(sites.iter().copied().chain(starts))?;
        let areas = surroundings.obstacles().iter().chain(bodies);
        let covered: Vec<Frame> = areas.map(|area| covered(origin, area)).collect();
        let frame = [None, Some(MARGIN)].into_iter().find_map(|margin| {
            let frame = inner.joined(&covered, margin).grown(RIM);
            (frame.cell_count() <= CELLS_MAX).then_some(frame)
        })?;
        let width = usize::try_from(frame.extent().0).ok()?;
        let height = usize::try_from(frame.extent().1).ok()?;
        let mut cells = Self {
            origin,
            low: frame.low,
            width,
            closed: vec![false; width * height],
            body_width: surroundings.body_width(),
            spots: Vec::new(),
        };
        cells.close_ring_and_walls(surroundings.arena());
        for area in &covered {
            cells.close(&area.within(&frame.grown(-RIM)));
        }
        // What stands on a spot is left to those who judge spots.
        cells.spots = sites.iter().filter_map(|&site| cells.index(site)).collect();
        for index in 0..cells.spots.len() {
            let spot = cells.spots[index];
            cells.closed[spot] = false;
        }
        Some(cells)
    }

    /// The same cells without those on which modules have settled.
    #[must_use]
    pub fn without(&self, settled: impl Iterator<Item = usize>) -> Self {
        let mut cells = self.clone();
        for spot in settled {
            cells.closed[self.spots[spot]] = true;
        }
        cells
    }

    /// The number of cells, closed ones included.
    #[must_use]
    pub fn count(&self) -> usize {
        self.closed.len()
    }

    /// The cell of each spot.
    #[must_use]
    pub fn spots(&self) -> &[usize] {
        &self.spots
    }

    /// The cell from which a module sets off: of the free cells that its body touches, the one whose middle is nearest to its
    /// own, the lowest of equals. `None` if no cell under its body is free.
    #[must_use]
    pub fn start(&self, pose: &Pose) -> Option<usize> {
        let Frame { low, high } = covered(self.origin, &Area::of_body(pose, self.body_width));
        let sites = (low.1..=high.1).flat_map(|y| (low.0..=high.0).map(move |x| (x, y)));
        let free = sites.filter_map(|site| {
            let cell = self.index(site).filter(|&cell| !self.closed[cell])?;
            let middle = (
                self.origin.0 + site.0 * MICRO_PER_UNIT - pose.x.0,
                self.origin.1 + site.1 * MICRO_PER_UNIT - pose.y.0,
            );
            let square = |offset: i64| i128::from(offset) * i128::from(offset);
            Some((square(middle.0) + square(middle.1), cell))
        });
        free.min().map(|(_, cell)| cell)
    }

    /// Where each module sets off that is to move; `None` for those that have settled.
    #[must_use]
    pub fn starts(&self, modules: &[PlanningModule]) -> Vec<Option<usize>> {
        let starts = modules.iter().map(|module| match module.pin {
            Some(_) => None,
            None => self.start(&module.pose),
        });
        starts.collect()
    }

    /// The number of steps from a cell to all others, [`CELL_UNREACHED`] where none lead; the search ends early once it has
    /// reached all of `wanted`. `steps` and `queue` are buffers.
    pub fn search(
        &self,
        from: usize,
        wanted: &[usize],
        steps: &mut Vec<u32>,
        queue: &mut Vec<usize>,
    ) {
        steps.clear();
        steps.resize(self.closed.len(), CELL_UNREACHED);
        let mut is_wanted = vec![false; self.closed.len()];
        let mut left = 0;
        for &cell in wanted {
            left += usize::from(!std::mem::replace(&mut is_wanted[cell], true));
        }
        queue.clear();
        queue.push(from);
        steps[from] = 0;
        let mut next = 0;
        while let Some(&cell) = queue.get(next) {
            next += 1;
            if is_wanted[cell] {
                left -= 1;
                if left == 0 {
                    return;
                }
            }
            let onward = steps[cell] + 1;
            let row = self.width;
            // The ring around the cells is closed, so each of these exists.
            for neighbour in [cell + 1, cell + row, cell - 1, cell - row] {
                if !self.closed[neighbour] && steps[neighbour] == CELL_UNREACHED {
                    steps[neighbour] = onward;
                    queue.push(neighbour);
                }
            }
        }
    }

    /// The number of steps between two cells if none is closed.
    #[must_use]
    pub fn steps_in_the_open(&self, one: usize, other: usize) -> u32 {
        let columns = (one % self.width).abs_diff(other % self.width);
        let rows = (one / self.width).abs_diff(other / self.width);
        u32::try_from(columns + rows).unwrap_or(CELL_UNREACHED)
    }

    /// The first closed cell on the straight line between two cells, as a rectangle.
    #[must_use]
    pub fn first_closed_between(&self, one: usize, other: usize) -> Option<Area> {
        let place = |cell: usize| {
            let at = |low: i64, offset: usize| low.saturating_add_unsigned(offset as u64);
            (
                at(self.low.0, cell % self.width),
                at(self.low.1, cell / self.width),
            )
        };
        let (from, to) = (place(one), place(other));
        let (right, up) = (to.0 - from.0, to.1 - from.1);
        let count = right.abs().max(up.abs()).max(1);
        let along = |start: i64, length: i64, step: i64| {
            start + (2 * length * step + count).div_euclid(2 * count)
        };
        let sites = (0..=count).map(|step| (along(from.0, right, step), along(from.1, up, step)));
        let is_closed = |site: &Site| self.index(*site).is_none_or(|cell| self.closed[cell]);
        sites
            .into_iter()
            .find(is_closed)
            .map(|site| self.area(site))
    }

    fn area(&self, site: Site) -> Area {
        let half = MICRO_PER_UNIT / 2;
        let corner = |sign: i64| {
            (
                MicroUnits(self.origin.0 + site.0 * MICRO_PER_UNIT + sign * half),
                MicroUnits(self.origin.1 + site.1 * MICRO_PER_UNIT + sign * half),
            )
        };
        Area {
            low: corner(-1),
            high: corner(1),
        }
    }

    fn index(&self, site: Site) -> Option<usize> {
        let x = usize::try_from(site.0 - self.low.0).ok()?;
        let y = usize::try_from(site.1 - self.low.1).ok()?;
        let cell = y * self.width + x;
        (x < self.width && cell < self.closed.len()).then_some(cell)
    }

    fn close_ring_and_walls(&mut self, arena: Option<Area>) {
        let height = self.closed.len() / self.width;
        for cell in 0..self.closed.len() {
            let (x, y) = (cell % self.width, cell / self.width);
            let is_ring = x == 0 || y == 0 || x + 1 == self.width || y + 1 == height;
            let at = |low: i64, offset: usize| low.saturating_add_unsigned(offset as u64);
            let area = self.area((at(self.low.0, x), at(self.low.1, y)));
            self.closed[cell] = is_ring || arena.is_some_and(|arena| !arena.holds(&area));
        }
    }

    /// Closes the cells of a rectangle.
    fn close(&mut self, frame: &Frame) {
        let columns = frame.low.0..=frame.high.0;
        let rows = frame.low.1..=frame.high.1;
        for site in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
            if let Some(cell) = self.index(site) {
                self.closed[cell] = true;
            }
        }
    }
}

/// The cells between two corners, both included.
#[derive(Clone, Copy, Debug)]
struct Frame {
    low: Site,
    high: Site,
}

impl Frame {
    fn around(mut sites: impl Iterator<Item = Site>) -> Option<Self> {
        let first = sites.next()?;
        let frame = Self {
            low: first,
            high: first,
        };
        Some(sites.fold(frame, Self::with))
    }

    fn with(self, (x, y): Site) -> Self {
        Self {
            low: (self.low.0.min(x), self.low.1.min(y)),
            high: (self.high.0.max(x), self.high.1.max(y)),
        }
    }

    /// The frame with others; with a margin, only as far as this many cells beyond the longer side of this one.
    fn joined(&self, others: &[Self], margin: Option<i64>) -> Self {
        let (width, height) = self.extent();
        let reach = margin.map(|margin| self.grown(margin.saturating_add(width.max(height))));
        let corners = others.iter().flat_map(|other| [other.low, other.high]);
        corners.fold(*self, |frame, (x, y)| {
            frame.with(match reach {
                Some(Self { low, high }) => (x.clamp(low.0, high.0), y.clamp(low.1, high.1)),
                None => (x, y),
            })
        })
    }

    fn grown(&self, by: i64) -> Self {
        Self {
            low: (self.low.0 - by, self.low.1 - by),
            high: (self.high.0 + by, self.high.1 + by),
        }
    }

    /// The part of it in another.
    fn within(&self, other: &Self) -> Self {
        Self {
            low: (self.low.0.max(other.low.0), self.low.1.max(other.low.1)),
            high: (self.high.0.min(other.high.0), self.high.1.min(other.high.1)),
        }
    }

    /// The numbers of columns and rows.
    fn extent(&self) -> (i64, i64) {
        (self.high.0 - self.low.0 + 1, self.high.1 - self.low.1 + 1)
    }

    fn cell_count(&self) -> i64 {
        let (width, height) = self.extent();
        width.saturating_mul(height)
    }
}

/// The cell of each spot; `None` if one is off its cell's middle, or an edge is no step.
fn lattice_sites(target: &Target, origin: Site) -> Option<Vec<Site>> {
    let spots = target.spots().iter();
    let sites: Vec<Site> = spots
        .map(|spot| {
            let (x, y) = site(origin, &spot.pose);
            let off = [
                spot.pose.x.0 - origin.0 - x * MICRO_PER_UNIT,
                spot.pose.y.0 - origin.1 - y * MICRO_PER_UNIT,
            ];
            let is_on = off.iter().all(|offset| offset.abs() <= TOLERANCE);
            is_on.then_some((x, y))
        })
        .collect::<Option<_>>()?;
    let is_step = |&(first, second): &(usize, usize)| {
        let (one, other): (Site, Site) = (sites[first], sites[second]);
        (one.0 - other.0).abs() + (one.1 - other.1).abs() == 1
    };
    target
        .topology()
        .edges()
        .iter()
        .all(is_step)
        .then_some(sites)
}

/// The cell under a pose; a place between two cells falls to the one with the larger coordinate.
fn site(origin: Site, pose: &Pose) -> Site {
    let along = |offset: i64| (offset + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
    (along(pose.x.0 - origin.0), along(pose.y.0 - origin.1))
}

/// The cells that a rectangle overlaps.
fn covered(origin: Site, area: &Area) -> Frame {
    let half = MICRO_PER_UNIT / 2;
    let first = |offset: i64| (offset + half).div_euclid(MICRO_PER_UNIT);
    let last = |offset: i64| (offset + half - 1).div_euclid(MICRO_PER_UNIT);
    let (low, high) = area.corners();
    Frame {
        low: (first(low.0 - origin.0), first(low.1 - origin.1)),
        high: (last(high.0 - origin.0), last(high.1 - origin.1)),
    }
}
