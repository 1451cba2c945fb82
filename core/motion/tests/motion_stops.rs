//! Stops at any moment, in mid-step, mid-turn and mid-fold: what is left is planned again, and executed without contact.

use std::sync::Arc;

use formation_generate::{Apart, Grouping};
use formation_model::Variant;
use formation_motion::paths::MotionParameters;
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::bodies::{Delays, MEASURED_BODY, execute};
use crate::support::motion::{Case, assert_sound_within, cases, motion, run_with_bodies, waits_of};
use crate::support::stops::Stop;

/// The modules of a halted block are off its layout by at most this, or each goes to a cell of its own.
const OFF: f64 = 0.1;

#[derive(Debug, Default)]
struct Counts {
    stops: usize,
    in_mid_fold: usize,
    with_pins: usize,
    serial: usize,
    refused: Vec<String>,
    contacts: Vec<String>,
}

impl Counts {
    fn is_clean(&self) -> bool {
        self.refused.is_empty() && self.contacts.is_empty()
    }
}

/// Stops the execution of a plan at a random moment, plans again from there, and so on.
fn stop_and_plan_again(case: &Case, stops: usize, unevenness: f64, counts: &mut Counts) {
    let mut problem = case.problem();
    let outcome = plan(Arc::clone(&problem));
    let mut first = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
    let mut numbers = Numbers(case.seed);
    for _ in 0..stops {
        let delays = [Delays::None, Delays::Random][numbers.below(2)];
        let execution = execute(&first, &waits_of(&first), delays, &mut numbers).unwrap();
        let share = numbers.below(1_000) as f64 / 1_500.0;
        let stop = Stop {
            problem: &problem,
            plan: &first,
            execution: &execution,
            time: share * Stop::last_end(&execution),
            unevenness,
        };
        let left = stop.problem_left(&mut numbers);
        counts.stops += 1;
        counts.in_mid_fold += usize::from(stop.is_in_mid_fold());
        counts.with_pins += usize::from(left.modules().iter().any(|it| it.pin.is_some()));
        let outcome = plan(Arc::clone(&left));
        let name = format!(
            "{} modules, seed {}, stop at {}",
            case.modules, case.seed, stop.time
        );
        match motion(&left, &outcome, &[], MotionParameters::default()) {
            Ok(second) => {
                counts.serial += usize::from(second.variant == Variant::Serial);
                assert_sound_within(OFF, &left, &outcome, &second);
                let waits = waits_of(&second);
                let found = run_with_bodies(&second, &waits, 1, &mut numbers, MEASURED_BODY);
                let contacts = found.iter().map(|contact| format!("{name}: {contact:?}"));
                counts.contacts.extend(contacts);
                (problem, first) = (left, second);
            }
            Err(error) => counts.refused.push(format!("{name}: {error}")),
        }
    }
}

/// Shows X10.
#[test]
fn stops_in_mid_step_and_mid_fold_are_starts_of_the_next_plan() {
    let mut counts = Counts::default();
    for seed in 0..30 {
        let case = Case {
            modules: 20,
            spots: 20,
            percent: 300,
            grouping: Grouping::Mixed,
            apart: Apart::Circles,
            seed,
        };
        stop_and_plan_again(&case, 5, 0.0, &mut counts);
    }
    assert!(counts.is_clean(), "{counts:#?}");
    assert!(counts.in_mid_fold >= 30, "{counts:?}");
}

/// The members of a block do not stop at the same moment.
#[test]
fn uneven_stops_are_starts_of_the_next_plan() {
    let mut counts = Counts::default();
    for case in cases(0..40) {
        stop_and_plan_again(&case, 3, 0.2, &mut counts);
    }
    assert!(counts.is_clean(), "{counts:#?}");
}

#[test]
#[ignore = "takes minutes; for changes to the planner"]
fn many_stops_are_starts_of_the_next_plan() {
    let mut all = Vec::new();
    for unevenness in [0.0, 0.05, 0.2] {
        let mut counts = Counts::default();
        for case in cases(5_000..5_200) {
            stop_and_plan_again(&case, 5, unevenness, &mut counts);
        }
        all.push(counts);
    }
    assert!(all.iter().all(Counts::is_clean), "{all:#?}");
}
