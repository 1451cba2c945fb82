//! Cheapest routes of one unit among units that stand still.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::lattice::Arena;
use super::units::{Node, Unit, split};

/// The cost of a step.
pub(super) const STEP: u32 = 10;

/// Ordered by: the cost in all, more cost so far, the node.
type Open = (u32, Reverse<u32>, Node);

/// The memory of the search, used again by each query.
pub(super) struct Routes {
    stamp: u32,
    /// For each node the query that reached it, the cost and the node before.
    reached: Vec<(u32, u32, Node)>,
    open: BinaryHeap<Reverse<Open>>,
    /// The nodes expanded so far.
    pub expansions: u64,
}

/// What is searched for.
pub(super) struct Errand<'a> {
    pub arena: &'a Arena,
    pub unit: &'a Unit,
    pub from: Node,
    /// Whether the unit may fold on its way.
    pub folds: bool,
}

impl Routes {
    /// Memory for nodes below a number.
    pub fn new(nodes: usize) -> Self {
        Self {
            stamp: 0,
            reached: vec![(0, 0, 0); nodes],
            open: BinaryHeap::new(),
            expansions: 0,
        }
    }

    /// The cheapest nodes from the present one, included, to a goal; `None` if there is no way.
    ///
    /// A step costs [`STEP`] and what `cost` gives for each cell that is newly held; a cell without a cost is closed.
    /// `rest` never exceeds the cost that is left.
    pub fn find(
        &mut self,
        errand: &Errand,
        cost: impl Fn(usize) -> Option<u32>,
        rest: impl Fn(Node) -> u32,
        is_goal: impl Fn(Node) -> bool,
    ) -> Option<Vec<Node>> {
        let Errand {
            arena,
            unit,
            from,
            folds,
        } = *errand;
        self.stamp += 1;
        self.open.clear();
        self.reached[from] = (self.stamp, 0, from);
        self.open.push(Reverse((rest(from), Reverse(0), from)));
        while let Some(Reverse((_, Reverse(so_far), node))) = self.open.pop() {
            if self.reached[node].1 < so_far {
                continue;
            }
            if is_goal(node) {
                return Some(self.traced(node));
            }
            self.expansions += 1;
            let (layout, cell) = split(arena, node);
            if unit.may_step(arena, node) {
                for (direction, next) in arena.neighbours(cell).enumerate() {
                    let leading = unit.layouts[layout].leading[direction].iter();
                    let total = leading
                        .map(|&offset| cost(next.wrapping_add_signed(offset)))
                        .sum();
                    self.reach(node, node - cell + next, so_far, total, &rest);
                }
            }
            if folds && let Some(next) = unit.fold(arena, node) {
                let total = unit.cells(arena, next).map(&cost).sum();
                self.reach(node, next, so_far, total, &rest);
            }
        }
        None
    }

    fn reach(
        &mut self,
        from: Node,
        next: Node,
        so_far: u32,
        extra: Option<u32>,
        rest: &impl Fn(Node) -> u32,
    ) {
        let Some(extra) = extra else { return };
        let cost = so_far + STEP + extra;
        let (stamp, known, _) = self.reached[next];
        if stamp == self.stamp && known <= cost {
            return;
        }
        self.reached[next] = (self.stamp, cost, from);
        self.open
            .push(Reverse((cost + rest(next), Reverse(cost), next)));
    }

    fn traced(&self, mut node: Node) -> Vec<Node> {
        let mut nodes = vec![node];
        while self.reached[node].2 != node {
            node = self.reached[node].2;
            nodes.push(node);
        }
        nodes.reverse();
        nodes
    }
}
