//! The utility-optimal maximum common subtree of a configuration and a target, both trees.
//!
//! This replaces the enumeration of candidate subtrees in the paper's section "Block Allocation by Modules Connected
//! in a Configuration". One dynamic programme over the directed edges of both trees finds the largest part of the
//! configuration that fits, and among the largest the one of greatest utility, exactly. If the whole configuration fits, the
//! result is an isomorphic subgraph.
//!
//! The scheme is that of Edmonds and Matula for subtree isomorphism (D. W. Matula, "Subtree isomorphism in
//! O(n^(5/2))", Annals of Discrete Mathematics 2, 1978), with weights. The configuration is rooted at a leaf.
//! `F[a][s|q]` is the best score of the subtree below module `a` if `a` takes spot `s` and the parent of `a` takes the
//! neighbour `q` of `s`: the worth of the pair plus the best assignment of the children of `a` to the neighbours of `s` other
//! than `q`. A common subtree has exactly one topmost module, so the maximum over all pairs as the top is the optimum. With
//! bounded degrees the time is proportional to the product of both sizes.

use crate::placement::directed_edges::DirectedEdges;
use crate::placement::matching::{Matching, MatchingInput, Weight};
use crate::placement::small_assignment::{NO_COLUMN, Score, SmallAssignment};
use crate::rooted_tree::RootedTree;
use formation_model::Topology;

/// The entry of a weight row for a forbidden pair.
const FORBIDDEN: i64 = i64::MIN;

/// Finds the largest connected part of the configuration that fits into the target, and among the largest the one
/// of greatest utility.
///
/// Both graphs must be trees. Ties go to the first topmost pair in a fixed order of the nodes, then to the lower spot. The
/// answer is always proven.
#[must_use]
pub fn solve<W: Weight>(input: &MatchingInput<'_, W>) -> Matching {
    let configuration = RootedConfiguration::at_lowest_leaf(input.configuration);
    let target = DirectedEdges::of(input.target);
    let mut programme = Programme {
        configuration: &configuration,
        target: &target,
        weight: &input.weight,
        rows: vec![Row::Done; configuration.children.len()],
        spare: Vec::new(),
        choices: vec![Vec::new(); configuration.children.len()],
        top: Top::default(),
        assignment: SmallAssignment::default(),
    };
    for &node in &configuration.post_order {
        programme.visit(node);
    }
    programme.trace_back()
}

/// The configuration, rooted at a leaf.
struct RootedConfiguration {
    /// The children of each node, ascending.
    children: Vec<Vec<usize>>,
    /// Children before parents, larger subtrees first, so that few rows exist at a time.
    post_order: Vec<usize>,
}

impl RootedConfiguration {
    /// Roots the tree at its lowest leaf, so that every other node has one child fewer than neighbours.
    fn at_lowest_leaf(topology: &Topology) -> Self {
        let node_count = topology.node_count();
        let leaf = (0..node_count).find(|&node| topology.degree(node) <= 1);
        let tree = RootedTree::new(topology, leaf.unwrap_or(0));
        let mut children = vec![Vec::new(); node_count];
        for &node in &tree.order {
            if let Some(parent) = tree.parents[node] {
                children[parent].push(node);
            }
        }
        // A walk from the root that takes the smallest child first yields, reversed, an order in which every subtree is
        // finished before its parent, and the largest subtree of a node first.
        let mut post_order = Vec::with_capacity(node_count);
        let mut stack: Vec<usize> = tree.order.first().copied().into_iter().collect();
        while let Some(node) = stack.pop() {
            post_order.push(node);
            let first = stack.len();
            stack.extend_from_slice(&children[node]);
            stack[first..].sort_by_key(|&child| (std::cmp::Reverse(tree.sizes[child]), child));
        }
        post_order.reverse();
        Self {
            children,
            post_order,
        }
    }
}

/// The scores of one module's subtree.
#[derive(Clone)]
enum Row {
    /// Not computed yet, or no longer needed.
    Done,
    /// A leaf's score does not depend on its parent: one weight per spot.
    Leaf(Vec<i64>),
    /// `F[a][s|q]` for every directed edge from `s` to `q`.
    Inner(Vec<Score>),
}

/// The best topmost pair so far, and the neighbour of its spot that each of its children takes.
#[derive(Default)]
struct Top {
    score: Score,
    pair: Option<(usize, usize)>,
    slots: Vec<u16>,
}

struct Programme<'a, W> {
    configuration: &'a RootedConfiguration,
    target: &'a DirectedEdges,
    weight: &'a W,
    rows: Vec<Row>,
    /// Buffers of rows that are no longer needed.
    spare: Vec<Vec<Score>>,
    /// For every node but the root, and every directed edge from `s` to `q`: the neighbour of `s`, as a position in its
    /// list, that the node takes if its parent takes `s` and its grandparent takes `q`.
    choices: Vec<Vec<u16>>,
    top: Top,
    assignment: SmallAssignment,
}

/// A neighbour of a spot, as a position in its list, and the score of a child's subtree there.
#[derive(Clone, Copy)]
struct Candidate {
    score: Score,
    slot: u16,
}

const NO_CANDIDATE: Candidate = Candidate {
    score: Score::NOTHING,
    slot: NO_COLUMN,
};

/// The best neighbours of a spot for one child, best first, lower ones first among equals.
#[derive(Clone, Copy)]
struct Best<const COUNT: usize>([Candidate; COUNT]);

impl<const COUNT: usize> Best<COUNT> {
    fn of(candidates: impl Iterator<Item = Candidate>) -> Self {
        let mut best = [NO_CANDIDATE; COUNT];
        for mut candidate in candidates {
            if candidate.score == Score::NOTHING {
                continue;
            }
            for place in &mut best {
                if candidate.score > place.score {
                    std::mem::swap(place, &mut candidate);
                }
            }
        }
        Self(best)
    }

    /// The best two other than `excluded`.
    fn two_without(&self, excluded: u16) -> [Candidate; 2] {
        let mut kept = self.0.iter().filter(|place| place.slot != excluded);
        [
            kept.next().copied().unwrap_or(NO_CANDIDATE),
            kept.next().copied().unwrap_or(NO_CANDIDATE),
        ]
    }
}

/// The best choice of different neighbours for two children, given the best two neighbours for each.
fn best_of_two(
    [first, first_else]: [Candidate; 2],
    [second, second_else]: [Candidate; 2],
) -> (Candidate, Candidate) {
    if first.slot != second.slot || first.slot == NO_COLUMN {
        (first, second)
    } else if first.score + second_else.score >= first_else.score + second.score {
        (first, second_else)
    } else {
        (first_else, second)
    }
}

impl<W: Weight> Programme<'_, W> {
    fn weight_of(&self, node: usize, spot: usize) -> i64 {
        (self.weight)(node, spot).map_or(FORBIDDEN, |weight| weight.0)
    }

    fn visit(&mut self, node: usize) {
        let configuration = self.configuration;
        let children = &configuration.children[node];
        match children.as_slice() {
            [] => self.visit_leaf(node),
            &[child] => self.visit_with_one_child(node, child),
            &[first, second] => self.visit_with_two_children(node, first, second),
            many => self.visit_with_many_children(node, many),
        }
        for &child in children {
            if let Row::Inner(row) = std::mem::replace(&mut self.rows[child], Row::Done) {
                self.spare.push(row);
            }
        }
    }

    fn visit_leaf(&mut self, node: usize) {
        let weights: Vec<i64> = (0..self.target.node_count())
            .map(|spot| self.weight_of(node, spot))
            .collect();
        for (spot, &weight) in weights.iter().enumerate() {
            if weight != FORBIDDEN {
                self.consider_top(node, spot, Score::of_one(weight), &[]);
            }
        }
        self.rows[node] = Row::Leaf(weights);
    }

    fn consider_top(&mut self, node: usize, spot: usize, score: Score, slots: &[u16]) {
        if score > self.top.score {
            self.top.score = score;
            self.top.pair = Some((node, spot));
            self.top.slots.clear();
            self.top.slots.extend_from_slice(slots);
        }
    }

    /// The neighbours of `spot` with the scores of the subtree with this `row` if its parent takes `spot`.
    fn candidates<'b>(
        target: &'b DirectedEdges,
        row: &'b Row,
        spot: usize,
    ) -> impl Iterator<Item = Candidate> + 'b {
        (target.first[spot]..target.first[spot + 1])
            .zip(0_u16..)
            .map(move |(edge, slot)| Candidate {
                score: match row {
                    Row::Leaf(weights) => match weights[target.head[edge]] {
                        FORBIDDEN => Score::NOTHING,
                        weight => Score::of_one(weight),
                    },
                    Row::Inner(scores) => scores[target.reverse[edge]],
                    Row::Done => Score::NOTHING,
                },
                slot,
            })
    }

    fn blank_row(&mut self) -> Vec<Score> {
        let mut row = self.spare.pop().unwrap_or_default();
        row.clear();
        row.resize(self.target.head.len(), Score::NOTHING);
        row
    }

    fn blank_choices(&self) -> Vec<u16> {
        vec![NO_COLUMN; self.target.head.len()]
    }

    fn visit_with_one_child(&mut self, node: usize, child: usize) {
        let target = self.target;
        let child_row = std::mem::replace(&mut self.rows[child], Row::Done);
        let mut row = self.blank_row();
        let mut choices = self.blank_choices();
        for spot in 0..target.node_count() {
            let weight = self.weight_of(node, spot);
            if weight == FORBIDDEN {
                continue;
            }
            let own = Score::of_one(weight);
            let Best([best, other]) = Best::<2>::of(Self::candidates(target, &child_row, spot));
            self.consider_top(node, spot, own + best.score, &[best.slot]);
            for (edge, slot) in (target.first[spot]..target.first[spot + 1]).zip(0_u16..) {
                let chosen = if slot == best.slot { other } else { best };
                row[edge] = own + chosen.score;
                choices[edge] = chosen.slot;
            }
        }
        self.rows[child] = child_row;
        self.rows[node] = Row::Inner(row);
        self.choices[child] = choices;
    }

    fn visit_with_two_children(&mut self, node: usize, first: usize, second: usize) {
        let target = self.target;
        let first_row = std::mem::replace(&mut self.rows[first], Row::Done);
        let second_row = std::mem::replace(&mut self.rows[second], Row::Done);
        let mut row = self.blank_row();
        let mut choices = (self.blank_choices(), self.blank_choices());
        for spot in 0..target.node_count() {
            let weight = self.weight_of(node, spot);
            if weight == FORBIDDEN {
                continue;
            }
            let own = Score::of_one(weight);
            let ones = Best::<3>::of(Self::candidates(target, &first_row, spot));
            let others = Best::<3>::of(Self::candidates(target, &second_row, spot));
            let (one, other) = best_of_two([ones.0[0], ones.0[1]], [others.0[0], others.0[1]]);
            let score = own + one.score + other.score;
            self.consider_top(node, spot, score, &[one.slot, other.slot]);
            for (edge, slot) in (target.first[spot]..target.first[spot + 1]).zip(0_u16..) {
                let (one, other) = if slot == one.slot || slot == other.slot {
                    best_of_two(ones.two_without(slot), others.two_without(slot))
                } else {
                    (one, other)
                };
                row[edge] = own + one.score + other.score;
                choices.0[edge] = one.slot;
                choices.1[edge] = other.slot;
            }
        }
        self.rows[first] = first_row;
        self.rows[second] = second_row;
        self.rows[node] = Row::Inner(row);
        (self.choices[first], self.choices[second]) = choices;
    }

    fn visit_with_many_children(&mut self, node: usize, children: &[usize]) {
        let target = self.target;
        let child_rows: Vec<Row> = children
            .iter()
            .map(|&child| std::mem::replace(&mut self.rows[child], Row::Done))
            .collect();
        let mut row = self.blank_row();
        let mut choices: Vec<Vec<u16>> = children.iter().map(|_| self.blank_choices()).collect();
        let mut assignment = std::mem::take(&mut self.assignment);
        for spot in 0..target.node_count() {
            let weight = self.weight_of(node, spot);
            if weight == FORBIDDEN {
                continue;
            }
            let own = Score::of_one(weight);
            let edges = target.first[spot]..target.first[spot + 1];
            assignment.solve(
                children.len(),
                edges.len(),
                child_rows.iter().flat_map(|child_row| {
                    Self::candidates(target, child_row, spot).map(|candidate| candidate.score)
                }),
            );
            self.consider_top(node, spot, own + assignment.score(), assignment.columns());
            for (edge, slot) in edges.zip(0_u16..) {
                let (score, columns) = assignment.without(slot);
                row[edge] = own + score;
                for (choice, &column) in choices.iter_mut().zip(columns) {
                    choice[edge] = column;
                }
            }
        }
        self.assignment = assignment;
        for (&child, child_row) in children.iter().zip(child_rows) {
            self.rows[child] = child_row;
        }
        self.rows[node] = Row::Inner(row);
        for (&child, choice) in children.iter().zip(choices) {
            self.choices[child] = choice;
        }
    }

    fn trace_back(&self) -> Matching {
        let Some((node, spot)) = self.top.pair else {
            return Matching {
                proven: true,
                nodes: 0,
                ..Matching::default()
            };
        };
        let target = self.target;
        let children = &self.configuration.children;
        let mut pairs = vec![(node, spot)];
        // Each entry: a matched node, and the directed edge from its spot back to its parent's spot.
        let mut stack = Vec::new();
        for (&child, &slot) in children[node].iter().zip(&self.top.slots) {
            if slot != NO_COLUMN {
                let edge = target.first[spot] + usize::from(slot);
                pairs.push((child, target.head[edge]));
                stack.push((child, target.head[edge], target.reverse[edge]));
            }
        }
        while let Some((node, spot, back)) = stack.pop() {
            for &child in &children[node] {
                let slot = self.choices[child][back];
                if slot != NO_COLUMN {
                    let edge = target.first[spot] + usize::from(slot);
                    pairs.push((child, target.head[edge]));
                    stack.push((child, target.head[edge], target.reverse[edge]));
                }
            }
        }
        pairs.sort_unstable();
        Matching {
            pairs,
            utility: self.top.score.utility(),
            proven: true,
            nodes: 0,
        }
    }
}
