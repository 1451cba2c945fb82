//! Motion plans are executed by their waits, with and without delays, and checked for contact by an independent model.

use std::sync::Arc;

use formation_generate::{Apart, Grouping};
use formation_model::Variant;
use formation_motion::paths::MotionParameters;
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::bodies::{CELL, Delays, contacts, execute};
use crate::support::motion::{Case, assert_sound, cases, cases_up_to, motion, run, waits_of};

#[derive(Debug, Default)]
struct Counts {
    plans: usize,
    contacts: usize,
    mutants: usize,
    mutants_found: usize,
    taken_apart: usize,
}

fn check(case: &Case, counts: &mut Counts, parameters: MotionParameters, repeats: usize) {
    let problem = case.problem();
    let outcome = plan(Arc::clone(&problem));
    let found = motion(&problem, &outcome, &[], parameters);
    let planned = found.unwrap_or_else(|error| panic!("seed {}: {error}", case.seed));
    assert_sound(&problem, &outcome, &planned);
    let mut numbers = Numbers(case.seed);
    let waits = waits_of(&planned);
    let found = run(&planned, &waits, repeats, &mut numbers);
    assert!(
        found.is_empty(),
        "{} modules, seed {}: {:?}",
        case.modules,
        case.seed,
        &found[..1]
    );
    counts.plans += 1;
    counts.contacts += found.len();
    counts.taken_apart += planned.taken_apart.len();
}

#[test]
fn no_execution_has_contact_or_deadlock() {
    let mut counts = Counts::default();
    for case in cases(0..60) {
        check(&case, &mut counts, MotionParameters::default(), 3);
    }
    assert_eq!((counts.plans, counts.contacts), (60, 0));
}

#[test]
#[ignore = "takes minutes; for changes to the planner"]
fn no_execution_of_many_has_contact_or_deadlock() {
    let mut counts = Counts::default();
    for case in cases_up_to(100, 1_000..2_000) {
        check(&case, &mut counts, MotionParameters::default(), 3);
    }
    assert_eq!((counts.plans, counts.contacts), (1_000, 0));
}

#[test]
fn the_serial_variant_has_no_contact_either() {
    let mut counts = Counts::default();
    let parameters = MotionParameters {
        expansions_max: 0,
        ..MotionParameters::default()
    };
    for case in cases(100..120) {
        check(&case, &mut counts, parameters, 2);
    }
    let problem = cases(7..8).next().unwrap().problem();
    let outcome = plan(Arc::clone(&problem));
    let planned = motion(&problem, &outcome, &[], parameters).unwrap();
    assert_eq!(planned.variant, Variant::Serial);
}

/// Without one wait of twenty, some execution has contact.
#[test]
fn missing_waits_are_found() {
    let mut counts = Counts::default();
    for case in cases(200..240) {
        let problem = case.problem();
        let outcome = plan(Arc::clone(&problem));
        let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
        let mut numbers = Numbers(case.seed);
        let mut waits = waits_of(&planned);
        let all: usize = waits.iter().map(Vec::len).sum();
        for unit in &mut waits {
            unit.retain(|_| !numbers.chance(5));
        }
        if waits.iter().map(Vec::len).sum::<usize>() + 4 > all {
            continue;
        }
        counts.mutants += 1;
        let mut has_contact = false;
        for _ in 0..20 {
            let execution = execute(&planned, &waits, Delays::Random, &mut numbers).unwrap();
            has_contact |= !contacts(&planned, &execution, CELL).is_empty();
        }
        counts.mutants_found += usize::from(has_contact);
    }
    assert!(
        counts.mutants >= 10 && counts.mutants_found * 4 >= counts.mutants * 3,
        "{counts:?}"
    );
}

/// A search does not look at all ways of waiting while the goal is held.
#[test]
fn paths_of_a_hundred_modules_take_few_search_nodes() {
    let case = Case {
        modules: 100,
        spots: 100,
        percent: 250,
        grouping: Grouping::Singletons,
        apart: Apart::Cells,
        seed: 1,
    };
    let problem = case.problem();
    let outcome = plan(Arc::clone(&problem));
    let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
    assert!(planned.expansions <= 50_000, "{}", planned.expansions);
}

#[test]
fn all_replicas_find_the_same_plan() {
    for case in cases(300..305) {
        let problem = case.problem();
        let outcome = plan(Arc::clone(&problem));
        let planned = || motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
        assert_eq!(planned(), planned());
    }
}
