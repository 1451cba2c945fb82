//! Candidates on trees, by the dynamic programme of Edmonds and Matula (D. W. Matula, "Subtree isomorphism in O(n^5/2)",
//! Annals of Discrete Mathematics 2, 1978) with the target rooted at the candidates' top.

use fixedbitset::FixedBitSet;

use super::enumeration::{Mark, Oracle, Oracles};
use super::listed_from;
use crate::placement::{
    DirectedEdges, MatchingInput, NO_COLUMN, Pairs, Score, SmallAssignment, common_subtree,
};
use crate::rooted_tree::RootedTree;
use formation_model::{MicroUnits, Topology};

/// A configuration and a target, both trees.
pub(super) struct TreeProgramme<'a> {
    configuration: &'a Topology,
    target: &'a Topology,
    /// The links of the configuration, each in both directions. The branch of a directed edge is the part of the
    /// configuration on the side of its tail.
    branches: DirectedEdges,
    /// The greatest distance between two modules.
    diameter: usize,
    size: usize,
}

impl<'a> TreeProgramme<'a> {
    pub(super) fn new(configuration: &'a Topology, target: &'a Topology) -> Self {
        let matching = common_subtree::solve(&MatchingInput {
            configuration,
            target,
            weight: |_, _| Some(MicroUnits::ZERO),
        });
        Self {
            configuration,
            target,
            branches: DirectedEdges::of(configuration),
            diameter: diameter(configuration),
            size: matching.pairs.len(),
        }
    }

    /// The size of the largest common subtree.
    pub(super) fn greatest_size(&self) -> usize {
        self.size
    }

    /// The least of the embeddings of greatest weight on the spots of a candidate.
    pub(super) fn embedding(
        &self,
        top: usize,
        spots: &[usize],
        weight: impl Fn(usize, usize) -> i64,
    ) -> Pairs {
        let part = self.target.induced_by(spots);
        let list = listed_from(self.target, top, spots);
        let Some(&root) = list.first() else {
            return Pairs::new();
        };
        let mut table = Table::new(&part, root, usize::MAX, |_| true);
        for &spot in list.iter().rev() {
            table.fill(&self.branches, spot, |node| Some(weight(node, spots[spot])));
        }
        let mut pairs = table.first_of_the_best(self, root, |node| weight(node, spots[root]));
        for (_, spot) in &mut pairs {
            *spot = spots[*spot];
        }
        pairs.sort_unstable();
        pairs
    }
}

impl Oracles for TreeProgramme<'_> {
    type Oracle<'s>
        = TreeOracle<'s>
    where
        Self: 's;

    fn oracle<'s>(&'s self, top: usize, marks: &[Mark]) -> TreeOracle<'s> {
        let reach = self.diameter;
        let table = Table::new(self.target, top, reach, |spot| {
            marks[spot] != Mark::Excluded
        });
        TreeOracle {
            programme: self,
            top,
            applied: vec![None; marks.len()],
            table,
        }
    }
}

/// The greatest distance between two nodes of a tree.
fn diameter(tree: &Topology) -> usize {
    let farthest = |from: usize| {
        let rooted = RootedTree::new(tree, from);
        let mut depth = vec![0_usize; tree.node_count()];
        for &node in &rooted.order {
            depth[node] = rooted.parents[node].map_or(0, |parent| depth[parent] + 1);
        }
        let deepest = rooted.order.last().copied().unwrap_or(from);
        (deepest, depth.get(deepest).copied().unwrap_or(0))
    };
    farthest(farthest(0).0).1
}

/// Answers for one top.
pub(super) struct TreeOracle<'a> {
    programme: &'a TreeProgramme<'a>,
    top: usize,
    /// The marks for which the table was filled; `None` for a spot that was not filled.
    applied: Vec<Option<Mark>>,
    table: Table<'a>,
}

impl Oracle for TreeOracle<'_> {
    fn complete(&mut self, marks: &[Mark]) -> Option<FixedBitSet> {
        if self.table.order.len() < self.programme.size {
            return None;
        }
        let chosen = self.chosen_above(marks)?;
        self.refill(marks);
        let expected = Score::of(self.programme.size, chosen);
        let own = weight_of(marks[self.top]).unwrap_or(0);
        let node = (0..self.programme.configuration.node_count()).find(|&node| {
            let score = self
                .table
                .whole(&self.programme.branches, node, self.top, own);
            score == expected
        })?;
        Some(
            self.table
                .spots_of(&self.programme.branches, node, self.top),
        )
    }
}

/// One for a spot that candidates must have, so that a subtree of greatest weight has all of them.
fn weight_of(mark: Mark) -> Option<i64> {
    match mark {
        Mark::Open => Some(0),
        Mark::Chosen => Some(1),
        Mark::Excluded => None,
    }
}

impl TreeOracle<'_> {
    /// The number of chosen spots. `None` if they and the spots between them and the top are too many, if one of these is
    /// excluded, or if one is out of reach.
    fn chosen_above(&self, marks: &[Mark]) -> Option<usize> {
        let mut is_needed = FixedBitSet::with_capacity(marks.len());
        let (mut chosen, mut needed) = (0, 0);
        for spot in (0..marks.len()).filter(|&spot| marks[spot] == Mark::Chosen) {
            chosen += 1;
            let mut above = Some(spot);
            while let Some(spot) = above.filter(|&spot| !is_needed.contains(spot)) {
                if marks[spot] == Mark::Excluded || !self.table.is_within[spot] {
                    return None;
                }
                is_needed.insert(spot);
                needed += 1;
                above = self.table.parents[spot];
            }
        }
        (needed <= self.programme.size).then_some(chosen)
    }

    /// Fills the table again where the marks have changed, and above.
    fn refill(&mut self, marks: &[Mark]) {
        let mut is_stale = FixedBitSet::with_capacity(marks.len());
        for place in (0..self.table.order.len()).rev() {
            let spot = self.table.order[place];
            let mark = marks[spot];
            if self.applied[spot] == Some(mark) && !is_stale.contains(spot) {
                continue;
            }
            self.applied[spot] = Some(mark);
            // The top itself is looked at module by module.
            if let Some(parent) = self.table.parents[spot] {
                is_stale.insert(parent);
                self.table
                    .fill(&self.programme.branches, spot, |_| weight_of(mark));
            }
        }
    }
}

/// The scores of the largest common subtrees of the branches of a configuration and of a rooted target.
struct Table<'a> {
    target: &'a Topology,
    /// The spots within reach of the root, parents first.
    order: Vec<usize>,
    parents: Vec<Option<usize>>,
    is_within: Vec<bool>,
    /// For each spot, the score of each branch of the configuration with its root on the spot.
    rows: Vec<Vec<Score>>,
    assignment: SmallAssignment,
    /// Buffers of the children of a spot and of a node.
    columns: Vec<usize>,
}

impl<'a> Table<'a> {
    /// Roots the part of a tree that has no spots but those admitted, up to a depth.
    fn new(
        target: &'a Topology,
        root: usize,
        depth_max: usize,
        is_admitted: impl Fn(usize) -> bool,
    ) -> Self {
        let count = target.node_count();
        let mut table = Self {
            target,
            order: vec![root],
            parents: vec![None; count],
            is_within: vec![false; count],
            rows: vec![Vec::new(); count],
            assignment: SmallAssignment::default(),
            columns: Vec::new(),
        };
        table.is_within[root] = true;
        let mut depth = vec![0_usize; count];
        let mut next = 0;
        while let Some(&spot) = table.order.get(next) {
            next += 1;
            if depth[spot] == depth_max {
                continue;
            }
            for &child in target.neighbours(spot) {
                if !table.is_within[child] && is_admitted(child) {
                    table.is_within[child] = true;
                    table.parents[child] = Some(spot);
                    depth[child] = depth[spot] + 1;
                    table.order.push(child);
                }
            }
        }
        table
    }

    /// Computes the row of a spot from those of its children. `weight` is that of a node on the spot; `None` forbids it.
    fn fill(
        &mut self,
        branches: &DirectedEdges,
        spot: usize,
        weight: impl Fn(usize) -> Option<i64>,
    ) {
        let mut row = std::mem::take(&mut self.rows[spot]);
        row.clear();
        self.list_children(spot);
        for upward in 0..branches.head.len() {
            let node = branches.tail(upward);
            row.push(weight(node).map_or(Score::NOTHING, |own| {
                Score::of_one(own) + self.below(branches, node, Some(upward))
            }));
        }
        self.rows[spot] = row;
    }

    /// The score of the whole configuration with a node on a spot of weight `own`.
    fn whole(&mut self, branches: &DirectedEdges, node: usize, spot: usize, own: i64) -> Score {
        self.list_children(spot);
        Score::of_one(own) + self.below(branches, node, None)
    }

    fn list_children(&mut self, spot: usize) {
        let children = self.target.neighbours(spot).iter().copied();
        let is_child = |child: &usize| self.parents[*child] == Some(spot);
        self.columns.clear();
        self.columns.extend(children.filter(is_child));
    }

    /// The best assignment of the branches below a node to the listed children of a spot.
    fn below(&mut self, branches: &DirectedEdges, node: usize, upward: Option<usize>) -> Score {
        let rows = children_of(branches, node, upward);
        let row_count = rows.clone().count();
        if row_count == 0 || self.columns.is_empty() {
            return Score::NOTHING;
        }
        let (columns, table) = (&self.columns, &self.rows);
        let scores = rows.flat_map(|child| columns.iter().map(move |&spot| table[spot][child]));
        self.assignment.solve(row_count, columns.len(), scores);
        self.assignment.score()
    }

    /// The spots of a largest common subtree with a node on the root.
    fn spots_of(&mut self, branches: &DirectedEdges, node: usize, root: usize) -> FixedBitSet {
        let mut spots = FixedBitSet::with_capacity(self.rows.len());
        let mut open = vec![(node, None, root)];
        while let Some((node, upward, spot)) = open.pop() {
            spots.insert(spot);
            self.list_children(spot);
            if self.below(branches, node, upward) == Score::NOTHING {
                continue;
            }
            let children = children_of(branches, node, upward);
            for (child, &column) in children.zip(self.assignment.columns()) {
                if column != NO_COLUMN {
                    let spot = self.columns[usize::from(column)];
                    open.push((branches.tail(child), Some(child), spot));
                }
            }
        }
        spots
    }

    /// Of the common subtrees of greatest score with any node on the root, the one with the lowest nodes on the spots in
    /// breadth-first order.
    fn first_of_the_best(
        &mut self,
        programme: &TreeProgramme<'_>,
        root: usize,
        weight: impl Fn(usize) -> i64,
    ) -> Pairs {
        let branches = &programme.branches;
        let nodes = 0..programme.configuration.node_count();
        let scores: Vec<Score> = nodes
            .map(|node| self.whole(branches, node, root, weight(node)))
            .collect();
        let best = scores.iter().max();
        let Some(node) = best.and_then(|best| scores.iter().position(|score| score == best)) else {
            return Pairs::new();
        };
        let mut pairs = Pairs::new();
        let mut open = vec![(node, None, root)];
        while let Some((node, upward, spot)) = open.pop() {
            pairs.push((node, spot));
            self.list_children(spot);
            let rows: Vec<usize> = children_of(branches, node, upward).collect();
            let columns = self.columns.clone();
            for (child, spot) in self.lowest_assignment(rows, &columns) {
                open.push((branches.tail(child), Some(child), spot));
            }
        }
        pairs
    }

    /// An optimal assignment of branches to spots: the lowest possible branch on the first spot, then on the second, and
    /// so on.
    fn lowest_assignment(
        &mut self,
        mut rows: Vec<usize>,
        columns: &[usize],
    ) -> Vec<(usize, usize)> {
        let mut assigned = Vec::with_capacity(columns.len());
        let mut left = self.best_of(&rows, columns);
        for (place, &spot) in columns.iter().enumerate() {
            let later = &columns[place + 1..];
            for index in 0..rows.len() {
                let mut others = rows.clone();
                let row = others.remove(index);
                let (own, rest) = (self.rows[spot][row], self.best_of(&others, later));
                if own > Score::NOTHING && own + rest == left {
                    assigned.push((row, spot));
                    (rows, left) = (others, rest);
                    break;
                }
            }
        }
        assigned
    }

    fn best_of(&mut self, rows: &[usize], columns: &[usize]) -> Score {
        if rows.is_empty() || columns.is_empty() {
            return Score::NOTHING;
        }
        let table = &self.rows;
        let pairs = rows.iter();
        let scores = pairs.flat_map(|&row| columns.iter().map(move |&spot| table[spot][row]));
        self.assignment.solve(rows.len(), columns.len(), scores);
        self.assignment.score()
    }
}

/// The branches below a node, without the one beyond `upward`.
fn children_of(
    branches: &DirectedEdges,
    node: usize,
    upward: Option<usize>,
) -> impl Iterator<Item = usize> + Clone + '_ {
    (branches.first[node]..branches.first[node + 1])
        .filter(move |&edge| Some(edge) != upward)
        .map(|edge| branches.reverse[edge])
}
