//! The policy `paper` against Algorithms 1 and 2 by brute force.

#![allow(
    clippy::unwrap_used,
    clippy::cast_precision_loss,
    reason = "helpers of tests fail the test; numbers are small"
)]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    Embedding, Evicted, Fallback, MicroUnits, ModuleId, PaperBundle, PlannerParameters,
    PlanningModule, PlanningProblem, Pose, RawSpot, RawTarget, Scenario, SpotId, SpotValue, Target,
    Topology,
};
use formation_planner::baseline::{CandidateInput, Candidates};
use formation_planner::{PlanOutcome, Statistics, plan};

use crate::support::Numbers;
use crate::support::paper::candidates::{Graph, all_candidates};
use crate::support::paper::{Instance, Readings, run};
use crate::support::{random_tree, shipped_scenario, with_parameters};

const BUNDLES: [PaperBundle; 2] = [PaperBundle::Literal, PaperBundle::Charitable];

/// A random connected graph: a tree with up to `chords` more edges.
fn random_graph(numbers: &mut Numbers, count: usize, chords: usize) -> Graph {
    let tree = random_tree(numbers, count);
    let mut edges = tree.edges().to_vec();
    for _ in 0..chords {
        let (one, other) = (numbers.below(count), numbers.below(count));
        let chord = (one.min(other), one.max(other));
        if one != other && !edges.contains(&chord) {
            edges.push(chord);
        }
    }
    Graph { count, edges }
}

fn topology(graph: &Graph) -> Topology {
    Topology::new(graph.count, &graph.edges)
}

/// The candidates of both sides for random values, few of them distinct, and random utilities with ties.
struct Case {
    configuration: Graph,
    target: Graph,
    values: Vec<i64>,
    utilities: Vec<Vec<i64>>,
    embedding: Embedding,
}

impl Case {
    fn random(numbers: &mut Numbers) -> Self {
        let modules = 2 + numbers.below(5);
        let spots = 2 + numbers.below(11);
        let of_target = [0, 0, 1, 2, 4][numbers.below(5)];
        let of_configuration = [0, 0, 0, 1, 2][numbers.below(5)];
        let configuration = random_graph(numbers, modules, of_configuration);
        let target = random_graph(numbers, spots, of_target);
        let utility = |numbers: &mut Numbers| numbers.within(-4, 0) * 1_000_000;
        Self {
            values: (0..spots).map(|_| numbers.within(0, 5) * 100_000).collect(),
            utilities: (0..modules)
                .map(|_| (0..spots).map(|_| utility(numbers)).collect())
                .collect(),
            embedding: [Embedding::First, Embedding::Best][numbers.below(2)],
            configuration,
            target,
        }
    }

    fn found(&self, limit: usize) -> Candidates {
        let (configuration, target) = (topology(&self.configuration), topology(&self.target));
        let input = CandidateInput {
            configuration: &configuration,
            target: &target,
            value: |spot: usize| MicroUnits(self.values[spot]),
            utility: |node: usize, spot: usize| MicroUnits(self.utilities[node][spot]),
            embedding: self.embedding,
            nodes_max: u64::MAX,
        };
        input.candidates(limit)
    }

    fn expected(&self) -> Vec<Vec<(usize, usize)>> {
        let utility = |node: usize, spot: usize| self.utilities[node][spot];
        let takes_best = self.embedding == Embedding::Best;
        let (configuration, target) = (&self.configuration, &self.target);
        let all = all_candidates(configuration, target, &self.values, &utility, takes_best);
        all.into_iter()
            .map(|(_, map)| map.into_iter().collect())
            .collect()
    }
}

#[test]
fn candidates_equal_exhaustive_enumeration() {
    let mut numbers = Numbers(7);
    let (mut with_cycles, mut cut_off) = (0, 0);
    for number in 0..2_000 {
        let case = Case::random(&mut numbers);
        let expected = case.expected();
        let found = case.found(usize::MAX);
        assert!(found.proven, "case {number}");
        assert_eq!(found.embeddings, expected, "case {number}");
        let first = case.found(20);
        assert!(first.proven);
        assert_eq!(first.embeddings[..], expected[..expected.len().min(20)]);
        cut_off += usize::from(expected.len() > 20);
        with_cycles += usize::from(case.target.edges.len() >= case.target.count);
    }
    assert!(
        with_cycles > 500 && cut_off > 100,
        "{with_cycles}, {cut_off}"
    );
}

/// Micro-units, in a box of some units.
fn position(numbers: &mut Numbers, extent: i64) -> (i64, i64) {
    let mut coordinate = || numbers.within(0, extent * 1_000) * 1_000;
    (coordinate(), coordinate())
}

/// A target of up to 10 spots with up to 12 modules, some of them in configurations.
fn instance(numbers: &mut Numbers) -> Instance {
    let spots = 4 + numbers.below(7);
    let chords = [0, 0, 0, 2, 4][numbers.below(5)];
    let target = random_graph(numbers, spots, chords);
    let wanted = (spots + numbers.below(5)).saturating_sub(2);
    let (mut modules, mut edges) = (0, Vec::new());
    while modules < wanted {
        let size = [1, 1, 1, 1, 2, 3, 4, 5][numbers.below(8)];
        let chords = usize::from(size > 2 && numbers.chance(10));
        let part = random_graph(numbers, size, chords);
        edges.extend(
            part.edges
                .iter()
                .map(|(one, other)| (one + modules, other + modules)),
        );
        modules += size;
    }
    Instance {
        spots: (0..spots).map(|_| position(numbers, 4)).collect(),
        modules: (0..modules).map(|_| position(numbers, 10)).collect(),
        links: Graph {
            count: modules,
            edges,
        },
        target,
    }
}

fn problem(instance: &Instance, parameters: PlannerParameters) -> Arc<PlanningProblem> {
    let id = |position: usize| u32::try_from(position).unwrap();
    let units = |micro: i64| micro as f64 / 1e6;
    let spots = instance.spots.iter().enumerate();
    let edges = instance.target.edges.iter();
    let target = Target::try_from(RawTarget {
        frame_id: "map".to_owned(),
        spots: spots
            .map(|(spot, &(x, y))| RawSpot {
                id: id(spot),
                x: units(x),
                y: units(y),
                theta: 0.0,
            })
            .collect(),
        edges: edges.map(|&(one, other)| [id(one), id(other)]).collect(),
    });
    let modules = instance.modules.iter().enumerate();
    let modules = modules.map(|(module, &(x, y))| PlanningModule {
        id: ModuleId(id(module)),
        pose: Pose::from_units(units(x), units(y), 0.0).unwrap(),
        links: instance
            .links
            .around(module)
            .into_iter()
            .map(|one| ModuleId(id(one)))
            .collect(),
        configuration: None,
        leader: None,
        pin: None,
    });
    let target = Arc::new(target.unwrap());
    Arc::new(PlanningProblem::new(target, parameters, modules.collect()).unwrap())
}

fn readings(parameters: &PlannerParameters) -> Readings {
    let options = &parameters.paper;
    Readings {
        fewest: options.fallback == Fallback::Fewest,
        best: options.embedding == Embedding::Best,
        lost: options.evicted == Evicted::Lost,
        mean_of_ratios: options.val == SpotValue::MeanOfRatios,
        d_max: parameters.d_max.map_or(usize::MAX, |d_max| d_max as usize),
        max: options.max(),
    }
}

fn assert_plans_as_written(instance: &Instance, parameters: PlannerParameters) -> usize {
    let expected = run(instance, readings(&parameters));
    let outcome = plan(problem(instance, parameters));
    let position = |id: u32| id as usize;
    let assignments = outcome.plan.assignments.iter();
    let spot_of = assignments.map(|(module, spot)| (position(module.0), position(spot.0)));
    assert_eq!(
        spot_of.collect::<std::collections::BTreeMap<_, _>>(),
        expected.spot_of,
        "{instance:?}"
    );
    let decisions = outcome.decisions.iter().map(|(_, decision)| decision);
    let detached = decisions.clone().flat_map(|decision| &decision.detached);
    let detached: BTreeSet<usize> = detached.map(|module| position(module.0)).collect();
    assert_eq!(detached, expected.detached);
    let evictions = decisions.flat_map(|decision| &decision.evictions);
    let mut evictions: Vec<(usize, usize)> = evictions
        .map(|eviction| (position(eviction.evicted.0), position(eviction.by.0)))
        .collect();
    let mut expected = expected.evictions;
    evictions.sort_unstable();
    expected.sort_unstable();
    assert_eq!(evictions, expected);
    assert!(outcome.proven);
    evictions.len()
}

#[test]
fn plans_equal_the_algorithms_under_each_bundle() {
    for bundle in BUNDLES {
        let mut numbers = Numbers(11);
        let mut evictions = 0;
        for _ in 0..500 {
            let instance = instance(&mut numbers);
            evictions += assert_plans_as_written(&instance, PlannerParameters::of_paper(bundle));
        }
        assert!(evictions > 30, "{evictions}");
    }
}

#[test]
fn plans_equal_the_algorithms_for_each_option_alone() {
    let mut numbers = Numbers(13);
    for bundle in BUNDLES {
        let other = BUNDLES[usize::from(bundle == BUNDLES[0])].options();
        for (key, value) in other.named() {
            let mut parameters = PlannerParameters::of_paper(bundle);
            parameters.paper.set(key, &value).unwrap();
            for (d_max, max) in [(Some(3), 20), (None, 3), (Some(1), 200)] {
                parameters.d_max = d_max;
                parameters.paper = parameters.paper.with_max(max).unwrap();
                for _ in 0..10 {
                    let instance = instance(&mut numbers);
                    assert_plans_as_written(&instance, parameters);
                }
            }
        }
    }
}

/// A shipped scenario with other planner parameters.
fn shipped(name: &str, parameters: PlannerParameters) -> PlanOutcome {
    plan(with_parameters(&shipped_problem(name), parameters))
}

fn shipped_problem(name: &str) -> PlanningProblem {
    Scenario::from_yaml(shipped_scenario(name))
        .unwrap()
        .problem()
        .clone()
}

fn of_module(outcome: &PlanOutcome, module: u32) -> Option<SpotId> {
    outcome.plan.assignments.get(&ModuleId(module)).copied()
}

#[test]
fn every_subgraph_is_a_candidate() {
    for bundle in BUNDLES {
        let outcome = shipped(
            "paper/missing_candidate",
            PlannerParameters::of_paper(bundle),
        );
        let spots: BTreeSet<_> = (1..=3).map(|module| of_module(&outcome, module)).collect();
        assert_eq!(spots, [1, 3, 5].map(|spot| Some(SpotId(spot))).into());
        assert_eq!(outcome.plan.kept_links.len(), 2);
    }
}

#[test]
fn a_target_with_a_cycle_has_more_than_one_candidate() {
    for bundle in BUNDLES {
        let parameters = PlannerParameters::of_paper(bundle);
        let name = "case_studies/case_6_ring_with_tail";
        let problem = with_parameters(&shipped_problem(name), parameters);
        let outcome = plan(Arc::clone(&problem));
        let changes = Statistics::of(&problem, &outcome).changes;
        assert_eq!(changes.broken_links, 0, "{bundle:?}");
        assert!(outcome.proven);
    }
}

#[test]
fn three_modules_evict_in_a_chain_only_if_a_lost_spot_no_longer_counts() {
    let chain = |evicted| {
        let mut parameters = PlannerParameters::of_paper(PaperBundle::Literal);
        parameters.paper.evicted = evicted;
        let outcome = shipped("paper/eviction_chain", parameters);
        let decisions = outcome.decisions.iter();
        let longest = decisions
            .map(|(_, decision)| decision.evictions.len())
            .max();
        let spots = [1, 2, 3].map(|module| of_module(&outcome, module).unwrap().0);
        (longest.unwrap(), spots)
    };
    assert_eq!(chain(Evicted::Lost), (2, [3, 1, 2]));
    assert_eq!(chain(Evicted::Literal).0, 0);
}

#[test]
fn what_is_not_known_of_the_paper_is_refused_by_name() {
    let planner = |text: &str| {
        let text = format!("{{target: {{map: 'o-o'}}, modules: {{map: 'A-A'}}, planner: {text}}}");
        let scenario = Scenario::from_yaml(&text);
        scenario.map(|scenario| *scenario.problem().parameters())
    };
    let literal = PlannerParameters::of_paper(PaperBundle::Literal);
    assert_eq!(planner("{policy: paper}").unwrap(), literal);
    assert_eq!(planner("{policy: paper, paper: literal}").unwrap(), literal);
    let charitable = PlannerParameters::of_paper(PaperBundle::Charitable);
    assert_eq!(
        planner("{policy: paper, paper: charitable}").unwrap(),
        charitable
    );
    let unbounded = planner("{policy: paper, d_max: null}").unwrap();
    assert_eq!(
        unbounded,
        PlannerParameters {
            d_max: None,
            ..literal
        }
    );
    let own = planner("{policy: paper, paper: {bundle: charitable, max: 200, fallback: last}}");
    let mut expected = charitable;
    expected.paper = expected.paper.with_max(200).unwrap();
    expected.paper.fallback = Fallback::Last;
    assert_eq!(own.unwrap(), expected);
    assert_eq!(planner("{d_max: 3}").unwrap().d_max, Some(3));
    assert_eq!(planner("{}").unwrap(), PlannerParameters::default());
    for (text, named) in [
        ("{policy: paper, paper: generous}", "generous"),
        ("{policy: paper, paper: {evictd: lost}}", "evictd"),
        ("{policy: paper, paper: {evicted: gone}}", "gone"),
        (
            "{policy: paper, paper: {max: 0}}",
            "must be from 1 to 10000, got 0",
        ),
        ("{paper: literal}", "belongs to `policy: paper`"),
    ] {
        let refused = planner(text).unwrap_err().to_string();
        assert!(
            refused.contains(named) && refused.contains("planner"),
            "{refused}"
        );
    }
}
