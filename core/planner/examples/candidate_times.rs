//! Prints how long the candidates of the policy `paper` take: the first 20 of a configuration on 100 spots, with the best
//! embedding. Targets are random trees, each spot joined to a random earlier one, such trees with five edges more, and a grid.
//!
//! `cargo run --release -p formation_planner --example candidate_times`

#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints and takes the time"
)]

use std::time::Instant;

use formation_model::{Embedding, MicroUnits, Topology};
use formation_planner::baseline::CandidateInput;
use formation_planner::betweenness;

/// Random numbers (SplitMix64 with Sebastiano Vigna's constants).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        usize::try_from((mixed ^ (mixed >> 31)) % bound as u64).unwrap_or(0)
    }
}

fn random_graph(numbers: &mut Numbers, count: usize, chords: usize) -> Topology {
    let mut edges: Vec<(usize, usize)> =
        (1..count).map(|node| (numbers.below(node), node)).collect();
    while edges.len() < count - 1 + chords {
        let (one, other) = (numbers.below(count), numbers.below(count));
        let chord = (one.min(other), one.max(other));
        if one != other && !edges.contains(&chord) {
            edges.push(chord);
        }
    }
    Topology::new(count, &edges)
}

fn grid(side: usize) -> Topology {
    let right = (0..side * side).filter(|spot| spot % side + 1 < side);
    let below = (0..side * (side - 1)).map(|spot| (spot, spot + side));
    let edges: Vec<(usize, usize)> = right.map(|spot| (spot, spot + 1)).chain(below).collect();
    Topology::new(side * side, &edges)
}

fn main() {
    println!("target               modules  median, ms  worst, ms  proven  candidates");
    for (name, chords) in [
        ("tree", Some(0)),
        ("tree and 5 edges", Some(5)),
        ("grid", None),
    ] {
        for size in [5, 10, 25, 50] {
            let (mut took, mut proven, mut count) = (Vec::new(), 0, 0);
            for seed in 0..10 {
                let mut numbers = Numbers(seed);
                let configuration = random_graph(&mut numbers, size, 0);
                let target = match chords {
                    Some(chords) => random_graph(&mut numbers, 100, chords),
                    None => grid(10),
                };
                let values = betweenness(&target);
                let worth = |node: usize, spot: usize| i64::try_from(node * spot % 17).unwrap_or(0);
                let input = CandidateInput {
                    configuration: &configuration,
                    target: &target,
                    value: |spot: usize| values[spot],
                    utility: |node: usize, spot: usize| MicroUnits(worth(node, spot)),
                    embedding: Embedding::Best,
                    nodes_max: 12_000_000,
                };
                let start = Instant::now();
                let found = input.candidates(20);
                took.push(start.elapsed().as_secs_f64() * 1e3);
                proven += usize::from(found.proven);
                count += found.embeddings.len();
            }
            took.sort_by(f64::total_cmp);
            let (median, worst) = (took[5], took[9]);
            println!("{name:20} {size:7} {median:11.1} {worst:10.1} {proven:7} {count:11}");
        }
    }
}
