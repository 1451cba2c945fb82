//! The policy `given`: an allocation that was computed elsewhere.

use std::sync::Arc;

use formation_generate::{Grouping, Random};
use formation_model::{
    Decision, ModuleId, PlannerParameters, PlanningProblem, Policy, RawGiven, RawGivenSpot,
    Scenario, SpotId,
};
use formation_planner::{PlanOutcome, detached_by, given_by, plan, plan_with_allocation};
use formation_verify::check_plan;

use crate::support::problem;

const GROUPINGS: [Grouping; 3] = [
    Grouping::Singletons,
    Grouping::Mixed,
    Grouping::Configurations(4),
];

fn assert_valid(problem: &PlanningProblem, outcome: &PlanOutcome) {
    let decisions = outcome.decisions.iter();
    let decisions: Vec<Decision> = decisions.map(|(_, decision)| decision.clone()).collect();
    assert_eq!(check_plan(problem, &decisions, &outcome.plan), Ok(()));
}

fn pairs(outcome: &PlanOutcome) -> Vec<(ModuleId, SpotId)> {
    let assignments = outcome.plan.assignments.iter();
    assignments.map(|(&module, &spot)| (module, spot)).collect()
}

#[test]
fn a_random_allocation_is_followed_to_the_letter() {
    for seed in 0..50 {
        let mut random = Random::from_seed(seed);
        let grouping = GROUPINGS[random.index(3)];
        let (modules, spots) = [(20, 20), (23, 15)][random.index(2)];
        let problem = problem(modules, spots, grouping, seed, PlannerParameters::default());
        let mut ids: Vec<ModuleId> = problem.modules().iter().map(|module| module.id).collect();
        for last in (1..ids.len()).rev() {
            ids.swap(last, random.index(last + 1));
        }
        let spots = problem.target().spots().iter().map(|spot| spot.id);
        let mut allocation: Vec<(ModuleId, SpotId)> = ids.into_iter().zip(spots).collect();
        let outcome = plan_with_allocation(&problem, &allocation).unwrap();
        allocation.sort_unstable();
        assert_eq!(pairs(&outcome), allocation, "seed {seed}");
        let given = problem
            .with_given(&given_by(&problem, &allocation))
            .unwrap();
        assert_valid(&given, &outcome);
        assert_ne!(given.digest(), problem.digest());
    }
}

/// What another policy plans can be given to the modules, with the modules that it detaches; its blocks stay.
#[test]
fn a_plan_that_is_given_keeps_its_blocks() {
    for (seed, grouping) in (0..30).zip(GROUPINGS.into_iter().cycle()) {
        let problem = problem(20, 20, grouping, seed, PlannerParameters::default());
        let exact = plan(Arc::clone(&problem));
        let mut raw = given_by(&problem, &pairs(&exact));
        let detached: Vec<u32> = {
            let decisions = exact.decisions.iter();
            let mut all: Vec<u32> = decisions
                .flat_map(|(_, decision)| decision.detached.iter().map(|module| module.0))
                .collect();
            all.sort_unstable();
            all.dedup();
            all
        };
        raw.detached = detached;
        let given = Arc::new(problem.with_given(&raw).unwrap());
        let followed = plan(Arc::clone(&given));
        assert_valid(&given, &followed);
        assert_eq!(followed.plan.assignments, exact.plan.assignments);
        assert!(
            followed.plan.kept_links.is_superset(&exact.plan.kept_links),
            "seed {seed}"
        );
    }
}

/// A row of four spots, a row of three docked modules, and one alone.
const ROW: &str = "{target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}, {id: 3, x: 7, y: 5}, {id: 4, x: 8, y: 5}], \
                   edges: [[1, 2], [2, 3], [3, 4]] ALLOCATION}, \
                   configurations: [{id: 1, modules: [{id: 1, x: 5, y: 0}, {id: 2, x: 6, y: 0}, {id: 3, x: 7, y: 0}], \
                   edges: [[1, 2], [2, 3]]}], singletons: [{id: 4, x: 9, y: 0}] MORE}";

fn row(allocation: &str, more: &str) -> Result<Scenario, String> {
    let text = ROW.replace("ALLOCATION", allocation).replace("MORE", more);
    Scenario::from_yaml(&text).map_err(|error| error.to_string())
}

fn given(pairs: &[(u32, u32)], detached: &[u32]) -> Result<Scenario, String> {
    let pairs = pairs
        .iter()
        .map(|(module, spot)| format!("{{module: {module}, spot: {spot}}}"));
    let pairs: Vec<String> = pairs.collect();
    row(
        &format!(
            ", allocation: [{}], detached: {detached:?}",
            pairs.join(", ")
        ),
        ", planner: {policy: given}",
    )
}

#[test]
fn what_cannot_be_carried_out_is_refused_by_module_and_spot() {
    assert!(given(&[(1, 1), (2, 2), (3, 3), (4, 4)], &[]).is_ok());
    assert!(given(&[(1, 1), (2, 2), (4, 3), (3, 4)], &[3]).is_ok());
    for (pairs, detached, expected) in [
        (
            vec![(1, 1), (2, 2), (3, 3), (1, 4)],
            vec![],
            "target.allocation[3].module: module 1 is listed twice: it has spot 1",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3), (4, 3)],
            vec![],
            "target.allocation[3].spot: spot 3 is given twice: module 3 has it",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3), (4, 9)],
            vec![],
            "target.allocation[3].spot: spot 9 is not in the target",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3), (9, 4)],
            vec![],
            "target.allocation: module 9 takes no part; announce an allocation for the modules that do",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3)],
            vec![],
            "target.allocation: module 4 is missing, although there are spots for all modules",
        ),
        (
            vec![(1, 1), (2, 2), (4, 3), (3, 4)],
            vec![],
            "target.allocation: module 2 and module 3 are docked, but their spots are not adjacent; list in target.detached those that leave their configuration",
        ),
        (
            vec![(1, 1), (4, 2), (3, 3), (2, 4)],
            vec![2],
            "target.detached: module 1 and module 3 stay in one configuration, but all that links them leaves; list one of them",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3), (4, 4)],
            vec![9],
            "target.detached: module 9 takes no part",
        ),
        (
            vec![(1, 1), (2, 2), (3, 3), (4, 4)],
            vec![2, 2],
            "target.detached[1]: module 2 is listed twice",
        ),
    ] {
        assert_eq!(given(&pairs, &detached).unwrap_err(), expected);
    }
    for (allocation, more, expected) in [
        (
            "",
            ", planner: {policy: given}",
            "target.allocation: is missing, and `policy: given` needs it",
        ),
        (
            ", allocation: [{module: 1, spot: 1}]",
            "",
            "target.allocation: belongs to `policy: given`; the policy is exact",
        ),
        (
            ", detached: [1]",
            "",
            "target.detached: belongs to `allocation`, which is missing",
        ),
    ] {
        assert_eq!(row(allocation, more).unwrap_err(), expected);
    }
}

/// Walls round module 2 leave it no way; a spot more than there are modules is left between filled ones.
#[test]
fn what_cannot_be_reached_or_joined_is_refused() {
    let walled = "{target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}], edges: [[1, 2]], \
                  allocation: [{module: 1, spot: 1}, {module: 2, spot: 2}]}, planner: {policy: given}, \
                  singletons: [{id: 1, x: 5, y: 0}, {id: 2, x: 0, y: 0}], obstacles: [\
                  {x: 0, y: 1, width: 3, height: 1}, {x: 0, y: -1, width: 3, height: 1}, \
                  {x: 1, y: 0, width: 1, height: 1}, {x: -1, y: 0, width: 1, height: 1}]}";
    assert_eq!(
        Scenario::from_yaml(walled).unwrap_err().to_string(),
        "target.allocation: module 2 cannot reach spot 2: walls or bodies leave it no way to the target"
    );
    let apart = "{target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}, {id: 3, x: 7, y: 5}], edges: [[1, 2], [2, 3]], \
                 allocation: [{module: 1, spot: 1}, {module: 2, spot: 3}]}, planner: {policy: given KEEP}, \
                 singletons: [{id: 1, x: 5, y: 0}, {id: 2, x: 9, y: 0}]}";
    assert_eq!(
        Scenario::from_yaml(&apart.replace("KEEP", ""))
            .unwrap_err()
            .to_string(),
        "target.allocation: spot 1 and spot 3 are filled, but not joined by filled spots; planner.keep_all_spots allows that"
    );
    assert!(Scenario::from_yaml(&apart.replace("KEEP", ", keep_all_spots: true")).is_ok());
}

#[test]
fn the_allocation_is_part_of_the_digest() {
    let digest =
        |pairs: &[(u32, u32)], detached: &[u32]| given(pairs, detached).unwrap().problem().digest();
    let straight = digest(&[(1, 1), (2, 2), (3, 3), (4, 4)], &[]);
    assert_ne!(straight, digest(&[(1, 3), (2, 2), (3, 1), (4, 4)], &[]));
    assert_ne!(
        straight,
        digest(&[(1, 1), (2, 2), (3, 3), (4, 4)], &[1, 2, 3])
    );
    assert_eq!(straight, digest(&[(4, 4), (3, 3), (2, 2), (1, 1)], &[]));
}

/// A module that stands on its spot stays there.
#[test]
fn a_settled_module_stays() {
    let scenario = given(&[(1, 1), (2, 2), (3, 3), (4, 4)], &[]).unwrap();
    let problem = scenario.problem();
    let mut modules = problem.modules().to_vec();
    modules[3].pin = Some(SpotId(4));
    let settled = |given: &RawGiven| {
        let target = problem.target().as_ref().clone().with_given(given).unwrap();
        let problem =
            PlanningProblem::new(Arc::new(target), *problem.parameters(), modules.clone());
        problem
            .unwrap()
            .check_given()
            .map_err(|error| error.to_string())
    };
    let entry = |module, spot| RawGivenSpot { module, spot };
    let mut raw = RawGiven {
        allocation: vec![entry(1, 1), entry(2, 2), entry(3, 3), entry(4, 4)],
        detached: Vec::new(),
    };
    assert_eq!(settled(&raw), Ok(()));
    raw.allocation = vec![entry(1, 4), entry(2, 3), entry(3, 2), entry(4, 1)];
    assert_eq!(
        settled(&raw).unwrap_err(),
        "target.allocation: module 4 has settled on spot 4 and stays there; spot 1 is given to it"
    );
}

#[test]
fn those_that_an_allocation_tears_off_are_found() {
    let scenario = row("", "").unwrap();
    let detached = |pairs: &[(u32, u32)]| {
        let pairs = pairs
            .iter()
            .map(|&(module, spot)| (ModuleId(module), SpotId(spot)));
        let pairs: Vec<(ModuleId, SpotId)> = pairs.collect();
        let detached = detached_by(scenario.problem(), &pairs).into_iter();
        detached.map(|module| module.0).collect::<Vec<u32>>()
    };
    assert_eq!(detached(&[(1, 1), (2, 2), (3, 3), (4, 4)]), []);
    assert_eq!(detached(&[(1, 1), (2, 2), (3, 4), (4, 3)]), [3]);
    assert_eq!(detached(&[(1, 1), (2, 3), (3, 2), (4, 4)]), [1]);
    assert_eq!(detached(&[(1, 3), (2, 1), (3, 4), (4, 2)]), [1, 2, 3]);
    assert_eq!(Policy::named("given"), Some(Policy::Given));
}
