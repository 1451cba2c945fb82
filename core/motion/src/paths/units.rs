//! Units, their layouts and the discs in which blocks fold.

use super::exit::{Exit, ExitStep};
use super::lattice::{Arena, Site, Time, nearest_to_all, reach};

/// A place of a unit: a layout and the cell under the middle of it, as one number.
///
/// The number is `layout * area + cell`, so that the nodes of a single module are the cells.
pub(super) type Node = usize;

/// What a unit does in a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// It may step to the next cell.
    Place,
    /// It folds.
    Disc,
    /// It leaves the lattice, or rests off it.
    Exit,
}

/// The cells of a unit around its middle.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    stage: Stage,
    /// Where each member stands; empty for a disc and an exit.
    pub sites: Vec<Site>,
    /// All cells that the unit holds, as differences of indices.
    pub cells: Vec<isize>,
    /// For a step right, up, left and down, the cells that it newly holds, around the middle after the step.
    pub leading: [Vec<isize>; 4],
    /// The lowest and the highest column and row.
    extent: (Site, Site),
}

impl Layout {
    fn new(stage: Stage, sites: Vec<Site>, held: &[Site], arena: &Arena) -> Self {
        let row = arena.width.cast_signed();
        let index = |&(x, y): &Site| {
            let of = |along: i64| isize::try_from(along).unwrap_or_default();
            of(x) + of(y) * row
        };
        let leading = [(1, 0), (0, 1), (-1, 0), (0, -1)].map(|(right, up)| {
            let newly = held
                .iter()
                .filter(|&&(x, y)| !held.contains(&(x + right, y + up)));
            newly.map(index).collect()
        });
        Self {
            cells: held.iter().map(index).collect(),
            leading,
            extent: super::rectangle::bounds(held),
            sites,
            stage,
        }
    }

    /// A part of an exit in which a unit holds these cells.
    fn exit(cells: &[usize], middle: usize) -> Self {
        let from_middle = |cell: &usize| cell.cast_signed() - middle.cast_signed();
        Self {
            stage: Stage::Exit,
            sites: Vec::new(),
            cells: cells.iter().map(from_middle).collect(),
            leading: Default::default(),
            extent: ((0, 0), (0, 0)),
        }
    }

    /// Whether the layout around a cell lies in the arena.
    fn fits(&self, arena: &Arena, cell: usize) -> bool {
        let (x, y) = arena.site(cell);
        let (low, high) = self.extent;
        arena.cell((x + low.0, y + low.1)).is_some()
            && arena.cell((x + high.0, y + high.1)).is_some()
    }
}

/// A block of docked modules, or a single one.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    /// Positions in the problem, ascending.
    pub modules: Vec<usize>,
    /// One layout, or the start layout, the disc and the target layout. A single module that turns has these three, too.
    pub layouts: Vec<Layout>,
    /// The square of the disc's radius, in quarters of a cell's side squared.
    pub disc: i64,
    pub start: Node,
    pub goal: Option<Node>,
    /// When it is on the lattice.
    pub ready: Time,
    pub pinned: bool,
    /// Whether it never moves: it is pinned, or stands on its spots off the lattice already.
    pub stays: bool,
    /// Its way off the lattice, if its spots lie there.
    pub exit: Option<Exit>,
}

impl Unit {
    /// A unit with its start cells and, if it has spots, theirs, in the order of its modules. The cells must lie in the
    /// arena. It folds if the layouts differ, or if modules have to turn.
    pub fn new(
        modules: Vec<usize>,
        starts: &[Site],
        goals: Option<&[Site]>,
        turns: bool,
        arena: &Arena,
    ) -> Self {
        let around = |cells: &[Site], middle: usize| -> Vec<Site> {
            let (x, y) = cells[middle];
            cells.iter().map(|cell| (cell.0 - x, cell.1 - y)).collect()
        };
        let ends = [starts, goals.unwrap_or(starts)];
        // The member from whose cell the corners of both layouts are nearest.
        let (middle, reach) = nearest_to_all(starts.len(), |middle| {
            let [start, goal] = ends.map(|cells| reach(cells, middle));
            start.max(goal)
        });
        let first = around(starts, middle);
        let node = |cells: &[Site]| arena.cell(cells[middle]).unwrap_or_default();
        let mut unit = Self {
            start: node(starts),
            goal: goals.map(node),
            layouts: vec![Layout::new(Stage::Place, first.clone(), &first, arena)],
            disc: reach,
            modules,
            ready: 0,
            pinned: false,
            stays: false,
            exit: None,
        };
        if let Some(goals) = goals {
            let last = around(goals, middle);
            if last != first || turns {
                let disc = disc_cells(reach);
                let disc = Layout::new(Stage::Disc, Vec::new(), &disc, arena);
                let last = Layout::new(Stage::Place, last.clone(), &last, arena);
                unit.layouts.extend([disc, last]);
                unit.goal = Some(2 * arena.area() + node(goals));
            }
        }
        unit
    }

    pub fn is_block(&self) -> bool {
        self.modules.len() > 1
    }

    /// Whether it is a single module that holds one cell wherever it is on the lattice.
    pub fn is_simple(&self) -> bool {
        let next = self.layouts.get(1);
        self.modules.len() == 1 && next.is_none_or(|next| next.stage == Stage::Exit)
    }

    /// Whether it needs cells beside its own to turn.
    pub fn needs_room_to_turn(&self) -> bool {
        let disc = |layout: &Layout| layout.stage == Stage::Disc && layout.cells.len() > 1;
        self.layouts.iter().any(disc)
    }

    /// Whether it holds one cell at each of its nodes.
    pub fn holds_one_cell(&self) -> bool {
        self.modules.len() == 1 && self.layouts.len() == 1
    }

    /// A single round module turns within its own cell.
    pub fn turn_within_cell(&mut self, arena: &Arena) {
        if let [_, disc, _] = &mut self.layouts[..]
            && self.modules.len() == 1
        {
            *disc = Layout::new(Stage::Disc, Vec::new(), &[(0, 0)], arena);
            self.disc = 1;
        }
    }

    /// A unit that stays rests off the lattice and holds these cells.
    pub fn rest_on(&mut self, cells: &[usize], arena: &Arena) {
        let (_, middle) = split(arena, self.start);
        self.layouts = vec![Layout::exit(cells, middle)];
    }

    /// The unit leaves the lattice by an exit, after its last layout.
    pub fn leave_by(&mut self, exit: Exit, arena: &Arena) {
        let last = exit.steps.len().saturating_sub(1);
        for step in 0..exit.steps.len() {
            let cells = if step == last {
                &exit.rest
            } else {
                &exit.swept
            };
            self.layouts.push(Layout::exit(cells, exit.cell));
        }
        self.goal = Some((self.layouts.len() - 1) * arena.area() + exit.cell);
        self.exit = Some(exit);
    }

    /// How many of its layouts are on the lattice.
    fn layouts_on_lattice(&self) -> usize {
        self.layouts.len() - self.exit.as_ref().map_or(0, |exit| exit.steps.len())
    }

    /// The step of the exit that ends at a node.
    pub fn exit_step(&self, arena: &Arena, node: Node) -> Option<&ExitStep> {
        let (layout, _) = split(arena, node);
        let step = layout.checked_sub(self.layouts_on_lattice())?;
        self.exit.as_ref()?.steps.get(step)
    }

    /// The last of its layouts on the lattice.
    pub fn last_on_lattice(&self) -> usize {
        self.layouts_on_lattice().saturating_sub(1)
    }

    /// The cells that the unit holds at a node.
    pub fn cells(&self, arena: &Arena, node: Node) -> impl Iterator<Item = usize> + '_ {
        let (layout, cell) = split(arena, node);
        self.layouts[layout]
            .cells
            .iter()
            .map(move |&offset| cell.wrapping_add_signed(offset))
    }

    /// The next part of a fold or of the exit that begins at a node, if the arena has room for it.
    pub fn fold(&self, arena: &Arena, node: Node) -> Option<Node> {
        let (layout, cell) = split(arena, node);
        let next = layout + 1;
        let has_room = |next: &Layout| match next.stage {
            Stage::Exit => self.exit.as_ref().is_some_and(|exit| exit.cell == cell),
            Stage::Place | Stage::Disc => next.fits(arena, cell),
        };
        let has_room = self.layouts.get(next).is_some_and(has_room);
        has_room.then_some(next * arena.area() + cell)
    }

    /// Whether a node is a place where the unit folds.
    pub fn is_disc(&self, arena: &Arena, node: Node) -> bool {
        self.layouts[split(arena, node).0].stage == Stage::Disc
    }

    /// Whether the unit may step to the next cell from a node.
    pub fn may_step(&self, arena: &Arena, node: Node) -> bool {
        self.layouts.len() == 1 || self.layouts[split(arena, node).0].stage == Stage::Place
    }

    /// The steps between two nodes if nothing is in the way.
    pub fn distance(&self, arena: &Arena, from: Node, to: Node) -> Time {
        if self.layouts.len() == 1 {
            return arena.distance(from, to);
        }
        let ((layout, cell), (last, goal)) = (split(arena, from), split(arena, to));
        let folds = Time::try_from(last.abs_diff(layout)).unwrap_or_default();
        arena.distance(cell, goal) + folds
    }
}

/// The nodes of some units are below this number.
pub(super) fn node_count(units: &[Unit], arena: &Arena) -> usize {
    let layouts = units.iter().map(|unit| unit.layouts.len()).max();
    layouts.unwrap_or(1) * arena.area()
}

/// The layout and the cell of a node.
pub(super) fn split(arena: &Arena, node: Node) -> (usize, usize) {
    if node < arena.area() {
        return (0, node);
    }
    (node / arena.area(), node % arena.area())
}

/// The cells that a circle round the middle of a cell touches, given the square of its radius.
fn disc_cells(reach: i64) -> Vec<Site> {
    let side = reach.isqrt() / 2 + 1;
    let touches = |&(x, y): &Site| {
        let gap = |along: i64| (2 * along.abs() - 1).max(0);
        gap(x) * gap(x) + gap(y) * gap(y) < reach
    };
    (-side..=side)
        .flat_map(|y| (-side..=side).map(move |x| (x, y)))
        .filter(touches)
        .collect()
}
