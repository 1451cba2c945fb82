//! The lattice that the target spans, and the arena: the cells of it that the motion may use.

use std::cmp::Reverse;

use super::rectangle::bounds;
use super::result::{FIELD_CELLS_MAX, MotionError};
use formation_model::turning::{Point, off_quarter};
use formation_model::{Area, MICRO_PER_UNIT, MicroUnits, Pose, Target};

/// Plan time; one step takes one unit of it.
pub(super) type Time = u32;

/// The end of a visit that has no end.
pub(super) const FOREVER: Time = Time::MAX;

/// A cell of the lattice: column and row, counted from the first spot's.
pub(super) type Site = (i64, i64);

/// The unit lattice on whose cells the spots lie, or most of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    origin: Point,
}

impl Lattice {
    /// The lattice on which most spots lie, that of the first of equals; the cell of each spot, and which spots are off it.
    pub fn of(target: &Target, tolerance: MicroUnits) -> (Self, Vec<Site>, Vec<bool>) {
        let spots = target.spots();
        let at = |spot: usize| Self {
            origin: point(&spots[spot].pose),
        };
        let is_on = |lattice: &Self, pose: &Pose| {
            let centre = lattice.point(lattice.site(point(pose)));
            (pose.x.0 - centre.0).abs() <= tolerance.0
                && (pose.y.0 - centre.1).abs() <= tolerance.0
                && off_quarter(pose.theta.0).abs() <= tolerance.0
        };
        let count = |lattice: &Self| {
            let on = spots.iter().filter(|spot| is_on(lattice, &spot.pose));
            on.count()
        };
        let first = at(0);
        let lattice = if count(&first) == spots.len() {
            first
        } else {
            let all = (0..spots.len()).map(|spot| (count(&at(spot)), Reverse(spot)));
            all.max().map_or(first, |(_, Reverse(spot))| at(spot))
        };
        let sites = spots.iter().map(|spot| lattice.site(point(&spot.pose)));
        let is_off = spots.iter().map(|spot| !is_on(&lattice, &spot.pose));
        (lattice, sites.collect(), is_off.collect())
    }

    /// The cell under a point; a point between two cells falls to the one with the larger coordinate.
    pub fn site(&self, point: Point) -> Site {
        let along = |offset: i64| (offset + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
        (
            along(point.0 - self.origin.0),
            along(point.1 - self.origin.1),
        )
    }

    /// The middle of a cell.
    pub fn point(&self, site: Site) -> Point {
        (
            self.origin.0 + site.0 * MICRO_PER_UNIT,
            self.origin.1 + site.1 * MICRO_PER_UNIT,
        )
    }

    /// The cells that a rectangle overlaps: the lowest and the highest column and row.
    pub fn covered(&self, low: Point, high: Point) -> (Site, Site) {
        let half = MICRO_PER_UNIT / 2;
        let first = |offset: i64| (offset + half).div_euclid(MICRO_PER_UNIT);
        let last = |offset: i64| (offset + half - 1).div_euclid(MICRO_PER_UNIT);
        (
            (first(low.0 - self.origin.0), first(low.1 - self.origin.1)),
            (last(high.0 - self.origin.0), last(high.1 - self.origin.1)),
        )
    }
}

pub(super) fn point(pose: &Pose) -> Point {
    (pose.x.0, pose.y.0)
}

/// The cells of a rectangle of the lattice, row by row, with a closed ring around them.
#[derive(Clone, Debug)]
pub(super) struct Arena {
    /// The cell of index 0.
    low: Site,
    pub width: usize,
    height: usize,
    /// Cells that no unit may enter.
    pub closed: Vec<bool>,
    /// The steps right, up, left and down, as differences of indices.
    pub steps: [isize; 4],
}

impl Arena {
    /// Whether the indices of cells mean the same in another one.
    pub fn covers_same(&self, other: &Self) -> bool {
        (self.low, self.width, self.height) == (other.low, other.width, other.height)
    }

    /// The cells around some sites, `margin` in each direction, within the walls and without the obstacles.
    pub fn around(
        lattice: &Lattice,
        sites: &[Site],
        margin: i64,
        obstacles: &[Area],
        walls: Option<Area>,
    ) -> Result<Self, MotionError> {
        let (mut low, mut high) = bounds(sites);
        let side = (high.0 - low.0).max(high.1 - low.1);
        let margin = margin + (side / 3).max(8) + 1;
        low = (low.0 - margin, low.1 - margin);
        high = (high.0 + margin, high.1 + margin);
        let extent = |length: i64| usize::try_from(length + 1).unwrap_or(usize::MAX);
        let (width, height) = (extent(high.0 - low.0), extent(high.1 - low.1));
        let cells = (width as u64).saturating_mul(height as u64);
        if cells > FIELD_CELLS_MAX {
            return Err(MotionError::FieldTooLarge(cells));
        }
        let row = width.cast_signed();
        let mut arena = Self {
            low,
            width,
            height,
            closed: vec![false; width * height],
            steps: [1, row, -1, -row],
        };
        for cell in 0..arena.closed.len() {
            let (x, y) = (cell % width, cell / width);
            arena.closed[cell] = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        }
        for area in obstacles {
            let (low, high) = area.corners();
            for cell in arena.cells_between(lattice.covered(low, high)) {
                arena.closed[cell] = true;
            }
        }
        if let Some(walls) = walls {
            let (low, high) = walls.corners();
            for cell in 0..arena.closed.len() {
                let middle = lattice.point(arena.site(cell));
                let half = MICRO_PER_UNIT / 2;
                arena.closed[cell] |= middle.0 - half < low.0
                    || middle.1 - half < low.1
                    || middle.0 + half > high.0
                    || middle.1 + half > high.1;
            }
        }
        Ok(arena)
    }

    /// How many cells there are, closed ones included.
    pub fn area(&self) -> usize {
        self.closed.len()
    }

    /// The index of a cell, if it lies in the arena.
    pub fn cell(&self, site: Site) -> Option<usize> {
        let x = usize::try_from(site.0 - self.low.0).ok()?;
        let y = usize::try_from(site.1 - self.low.1).ok()?;
        (x < self.width && y < self.height).then_some(y * self.width + x)
    }

    /// The cell of that index.
    pub fn site(&self, cell: usize) -> Site {
        let at = |low: i64, offset: usize| low.saturating_add_unsigned(offset as u64);
        (
            at(self.low.0, cell % self.width),
            at(self.low.1, cell / self.width),
        )
    }

    /// The cells of a rectangle of the lattice, as far as they lie in the arena.
    pub fn cells_between(&self, (low, high): (Site, Site)) -> Vec<usize> {
        let last = self.site(self.area() - 1);
        let columns = low.0.max(self.low.0)..=high.0.min(last.0);
        let rows = low.1.max(self.low.1)..=high.1.min(last.1);
        rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
            .filter_map(|site| self.cell(site))
            .collect()
    }

    /// The cells to the right, above, to the left and below; only for cells within the closed ring.
    pub fn neighbours(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        self.steps
            .iter()
            .map(move |&step| cell.wrapping_add_signed(step))
    }

    /// The cells that are connected to some cells past shut ones, those cells included, which may be shut. All of them are
    /// shut afterwards.
    pub fn flood(&self, from: Vec<usize>, is_shut: &mut [bool]) -> Vec<usize> {
        let mut found = from;
        for &cell in &found {
            is_shut[cell] = true;
        }
        let mut next = 0;
        while let Some(&cell) = found.get(next) {
            next += 1;
            for neighbour in self.neighbours(cell) {
                if !is_shut[neighbour] {
                    is_shut[neighbour] = true;
                    found.push(neighbour);
                }
            }
        }
        found
    }

    /// Whether of some cells that may be shut only the ring is.
    pub fn is_open(&self, is_shut: &[bool]) -> bool {
        let rows = is_shut.chunks_exact(self.width).skip(1);
        let mut rows = rows.take(self.height.saturating_sub(2));
        rows.all(|row| !row[1..self.width - 1].contains(&true))
    }

    /// The steps between two cells if none is closed.
    pub fn distance(&self, from: usize, to: usize) -> Time {
        let columns = (from % self.width).abs_diff(to % self.width);
        let rows = (from / self.width).abs_diff(to / self.width);
        Time::try_from(columns + rows).unwrap_or(FOREVER)
    }
}

/// How far the corners of some cells are from the middle of one of them: the square of the greatest distance, in
/// quarters of a cell's side squared.
pub(super) fn reach(cells: &[Site], middle: usize) -> i64 {
    let (x, y) = cells[middle];
    let corner = |cell: &Site| {
        let (right, up) = (2 * (cell.0 - x).abs() + 1, 2 * (cell.1 - y).abs() + 1);
        right * right + up * up
    };
    cells.iter().map(corner).max().unwrap_or_default()
}

/// The first of `count` members with the least reach, and its reach.
pub(super) fn nearest_to_all(count: usize, reach: impl Fn(usize) -> i64) -> (usize, i64) {
    let members = (0..count).map(|member| (reach(member), member));
    let (reach, member) = members.min().unwrap_or_default();
    (member, reach)
}
