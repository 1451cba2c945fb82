//! Rows that move along their own line.

use std::fmt::Write as _;
use std::sync::Arc;

use formation_model::Scenario;
use formation_motion::paths::MotionParameters;
use formation_planner::plan;

use crate::support::motion::motion;

/// The makespan and the longest path of a row of modules that shifts along its line.
fn shifted(count: u32, shift: u32) -> (u32, u32) {
    let mut text = String::from("target:\n  spots:\n");
    for id in 1..=count {
        writeln!(text, "    - {{id: {id}, x: {}, y: 0}}", id - 1 + shift).unwrap();
    }
    let edges: Vec<String> = (1..count).map(|id| format!("[{id}, {}]", id + 1)).collect();
    writeln!(text, "  edges: [{}]\nsingletons:", edges.join(", ")).unwrap();
    for id in 1..=count {
        writeln!(text, "  - {{id: {id}, x: {}, y: 0}}", id - 1).unwrap();
    }
    let scenario = Scenario::from_yaml(&text).unwrap();
    let problem = Arc::new(scenario.problem().clone());
    let outcome = plan(Arc::clone(&problem));
    let motion = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
    (motion.makespan, motion.bound)
}

#[test]
fn a_row_of_twelve_shifts_by_two_in_at_most_fourteen_steps() {
    let (makespan, longest) = shifted(12, 2);
    assert!(makespan <= 14, "{makespan}");
    assert_eq!(longest, 2);
}

#[test]
fn a_row_of_twenty_moves_along_its_line_in_at_most_1_35_times_its_longest_path() {
    let (makespan, longest) = shifted(20, 60);
    assert_eq!(longest, 60);
    assert!(100 * makespan <= 135 * longest, "{makespan}");
}
