//! The utility-optimal maximum common subtree of a configuration and a target, both trees.
//!
//! This replaces the enumeration of candidate subtrees in the paper's section "Block Allocation by Modules Connected
//! in a Configuration": one dynamic programme over the directed edges of both trees finds the largest part of the
//! configuration that fits, and among the largest the one of greatest utility, exactly. An isomorphic subgraph is
//! the case in which everything fits.
//!
//! The scheme is that of Edmonds and Matula for subtree isomorphism (D. W. Matula, "Subtree isomorphism in
//! O(n^(5/2))", Annals of Discrete Mathematics 2, 1978), with weights. The configuration is rooted at a leaf.
//! `F[a][s|q]` is the best that the subtree below module `a` can do when `a` takes spot `s` while the parent of `a`
//! takes the neighbour `q` of `s`: the worth of the pair plus the best assignment of the children of `a` to the
//! neighbours of `s` other than `q`. A common subtree has exactly one topmost module, so trying every pair as the top
//! finds the optimum. With bounded degrees the time is proportional to the product of both sizes.

use crate::model::{MicroUnits, Topology};
use crate::planner::placement::small_assignment::{NO_COLUMN, Score, SmallAssignment};
use crate::planner::placement::{Matching, MatchingInput};

/// A weight row's entry for a forbidden pair.
const FORBIDDEN: i64 = i64::MIN;

/// Finds the largest connected part of the configuration that fits into the target, and among the largest the one
/// of greatest utility.
///
/// Both graphs must be trees; of a graph with cycles only a breadth-first spanning tree would be seen, which the
/// caller must not want. Ties go to the topmost pair met first in a fixed order of the nodes, then to the lower spot.
/// The answer is always proven.
#[must_use]
pub fn solve<W: Fn(usize, usize) -> Option<MicroUnits>>(input: &MatchingInput<'_, W>) -> Matching {
    let configuration = RootedTree::at_lowest_leaf(input.configuration);
    let target = DirectedEdges::of(input.target);
    let mut programme = Programme {
        configuration: &configuration,
        target: &target,
        weight: &input.weight,
        rows: vec![Row::Done; configuration.parents.len()],
        spare: Vec::new(),
        choices: vec![Vec::new(); configuration.parents.len()],
        top: Top::default(),
        wide: SmallAssignment::default(),
    };
    for &node in &configuration.post_order {
        programme.visit(node);
    }
    programme.trace_back()
}

/// A tree hung up at one of its nodes.
struct RootedTree {
    parents: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
    /// Children before parents, larger subtrees first, so that few rows are alive at once.
    post_order: Vec<usize>,
}

impl RootedTree {
    /// Hangs the tree up at its lowest leaf, which leaves every other node one child fewer than it has neighbours.
    fn at_lowest_leaf(topology: &Topology) -> Self {
        let node_count = topology.node_count();
        let root = (0..node_count)
            .find(|&node| topology.degree(node) <= 1)
            .unwrap_or(0);
        let mut parents = vec![None; node_count];
        let mut children = vec![Vec::new(); node_count];
        let mut seen = vec![false; node_count];
        let mut order = Vec::with_capacity(node_count);
        if root < node_count {
            seen[root] = true;
            order.push(root);
        }
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            for &neighbour in topology.neighbours(node) {
                if !seen[neighbour] {
                    seen[neighbour] = true;
                    parents[neighbour] = Some(node);
                    children[node].push(neighbour);
                    order.push(neighbour);
                }
            }
            next += 1;
        }
        let mut sizes = vec![1_usize; node_count];
        for &node in order.iter().rev() {
            if let Some(parent) = parents[node] {
                sizes[parent] += sizes[node];
            }
        }
        // Walking from the root and taking the smallest child first yields, reversed, an order in which every
        // subtree is finished before its parent and the largest subtree of a node is finished first.
        let mut post_order = Vec::with_capacity(order.len());
        let mut stack: Vec<usize> = order.first().copied().into_iter().collect();
        while let Some(node) = stack.pop() {
            post_order.push(node);
            let first = stack.len();
            stack.extend_from_slice(&children[node]);
            stack[first..].sort_by_key(|&child| (std::cmp::Reverse(sizes[child]), child));
        }
        post_order.reverse();
        Self {
            parents,
            children,
            post_order,
        }
    }
}

/// The edges of the target in both directions: those that leave spot `s` are `first[s]..first[s + 1]`.
struct DirectedEdges {
    first: Vec<usize>,
    /// The spot to which each directed edge leads.
    head: Vec<usize>,
    /// The position of the same edge in the other direction.
    reverse: Vec<usize>,
}

impl DirectedEdges {
    fn of(topology: &Topology) -> Self {
        let mut first = Vec::with_capacity(topology.node_count() + 1);
        let mut head = Vec::with_capacity(2 * topology.edges().len());
        for node in 0..topology.node_count() {
            first.push(head.len());
            head.extend_from_slice(topology.neighbours(node));
        }
        first.push(head.len());
        // Neighbours ascend, so the edges into any one node are met in the order of that node's own list.
        let mut met = first.clone();
        let reverse = head
            .iter()
            .map(|&node| {
                let position = met[node];
                met[node] += 1;
                position
            })
            .collect();
        Self {
            first,
            head,
            reverse,
        }
    }

    fn spot_count(&self) -> usize {
        self.first.len() - 1
    }
}

/// What is known of one module's subtree.
#[derive(Clone)]
enum Row {
    /// Not computed yet, or no longer needed.
    Done,
    /// A leaf is worth the same whatever its parent takes: one weight per spot.
    Leaf(Vec<i64>),
    /// `F[a][s|q]` for every directed edge from `s` to `q`.
    Inner(Vec<Score>),
}

/// The best topmost pair so far, and which neighbour of its spot each of its children takes.
#[derive(Default)]
struct Top {
    score: Score,
    pair: Option<(usize, usize)>,
    slots: Vec<u16>,
}

struct Programme<'a, W> {
    configuration: &'a RootedTree,
    target: &'a DirectedEdges,
    weight: &'a W,
    rows: Vec<Row>,
    spare: Vec<Vec<Score>>,
    /// For every node but the root, and every directed edge from `s` to `q`: which neighbour of `s` the node takes
    /// when its parent takes `s` and its grandparent `q`.
    choices: Vec<Vec<u16>>,
    top: Top,
    wide: SmallAssignment,
}

/// A neighbour of a spot and what a child earns below it.
#[derive(Clone, Copy)]
struct Candidate {
    score: Score,
    slot: u16,
}

const NOBODY: Candidate = Candidate {
    score: Score::NOTHING,
    slot: NO_COLUMN,
};

/// The best few neighbours of a spot for one child, best first, lower ones first among equals.
#[derive(Clone, Copy)]
struct Best<const COUNT: usize>([Candidate; COUNT]);

impl<const COUNT: usize> Best<COUNT> {
    fn of(candidates: impl Iterator<Item = Candidate>) -> Self {
        let mut best = [NOBODY; COUNT];
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

    /// The best two that are not `excluded`.
    fn two_without(&self, excluded: u16) -> [Candidate; 2] {
        let mut kept = self.0.iter().filter(|place| place.slot != excluded);
        [
            kept.next().copied().unwrap_or(NOBODY),
            kept.next().copied().unwrap_or(NOBODY),
        ]
    }
}

/// The best way for two children to take different neighbours.
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

impl<W: Fn(usize, usize) -> Option<MicroUnits>> Programme<'_, W> {
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
        let weights: Vec<i64> = (0..self.target.spot_count())
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

    /// What `child` earns below each neighbour of `spot` when its parent takes `spot`.
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
        for spot in 0..target.spot_count() {
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
        for spot in 0..target.spot_count() {
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
        let mut wide = std::mem::take(&mut self.wide);
        for spot in 0..target.spot_count() {
            let weight = self.weight_of(node, spot);
            if weight == FORBIDDEN {
                continue;
            }
            let own = Score::of_one(weight);
            let edges = target.first[spot]..target.first[spot + 1];
            wide.solve(
                children.len(),
                edges.len(),
                child_rows.iter().flat_map(|child_row| {
                    Self::candidates(target, child_row, spot).map(|candidate| candidate.score)
                }),
            );
            self.consider_top(node, spot, own + wide.score(), wide.columns());
            for (edge, slot) in edges.zip(0_u16..) {
                let (score, columns) = wide.without(slot);
                row[edge] = own + score;
                for (choice, &column) in choices.iter_mut().zip(columns) {
                    choice[edge] = column;
                }
            }
        }
        self.wide = wide;
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
        }
    }
}
