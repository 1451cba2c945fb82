use std::sync::Arc;

use ::console::{measure_text_width, strip_ansi_codes};
use formation_event_log::{Entry, LogEvent, ModuleSnapshot};
use formation_model::{Epoch, ModuleId, ModulePhase, Pose, Scenario, SpotId};
use formation_offline::CheckedPlan;
use formation_report::course_of_plan;
use formation_verify::Progress;

use super::super::keys::HELP;
use super::*;
use crate::plan_output::PlanOutput;

const PLAIN: Style = Style {
    colours: false,
    unicode: true,
};
const LARGE: Size = Size {
    columns: 80,
    rows: 40,
};

/// Modules 1 and 2 are docked and fit onto spots 1 and 2; module 3 takes spot 3.
const SCENARIO: &str = "
target:
  spots: [{id: 1, x: 0.0, y: 0.0}, {id: 2, x: 1.0, y: 0.0}, {id: 3, x: 1.0, y: 1.0}]
  edges: [[1, 2], [2, 3]]
configurations:
  - {id: 1, leader: 1, modules: [{id: 1, x: 0.0, y: -3.0}, {id: 2, x: 1.0, y: -3.0}], edges: [[1, 2]]}
singletons: [{id: 3, x: 4.0, y: 1.0}]
";

fn plan() -> Arc<CheckedPlan> {
    Arc::new(CheckedPlan::of(&Scenario::from_yaml(SCENARIO).unwrap()).unwrap())
}

fn drawn(watched: &Watched, size: Size) -> String {
    frame(watched, Duration::from_millis(12_300), size, PLAIN, None).join("\n")
}

/// A run that goes as planned, after this many of its entries.
fn after(plan: &Arc<CheckedPlan>, entries: &[Entry], count: usize) -> Watched {
    let mut watched = Watched::new("three");
    watched.set_plan(Arc::clone(plan));
    for entry in &entries[..count] {
        watched.take(entry, Duration::from_millis(entry.at_ms));
    }
    watched
}

fn is_moving(entry: &Entry) -> bool {
    matches!(&entry.event, LogEvent::State(snapshot) if snapshot.phase == ModulePhase::Moving)
}

#[test]
fn it_shows_whose_turn_it_is_and_who_waits_for_whom() {
    let plan = plan();
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let roster = entries
        .iter()
        .position(|entry| matches!(entry.event, LogEvent::Roster { .. }))
        .unwrap();
    let (first, second) = match plan.outcome.decisions[0].0.claimant.0 {
        3 => ("3 decides", "1-2 wait for 3"),
        _ => ("1-2 decide", "3 waits for 1-2"),
    };
    let text = drawn(&after(&plan, &entries, roster + 1), LARGE);
    assert!(text.contains(&format!("now   {first}")), "{text}");
    assert!(text.contains(&format!("next  {second}")), "{text}");
    assert!(
        text.contains("The roster is fixed: 3 modules take part"),
        "{text}"
    );

    let text = drawn(&after(&plan, &entries, roster + 2), LARGE);
    assert!(text.contains("turn 1 of 2"), "{text}");
    assert!(text.contains("Turn 1: "), "{text}");

    assert!(plan.motion.paths().is_some());
    let first_motion = entries.iter().position(is_moving).unwrap();
    let text = drawn(&after(&plan, &entries, first_motion + 1), LARGE);
    let (now, next) = match &entries[first_motion].event {
        LogEvent::State(first) if first.module == ModuleId(3) => ("3 is on", "1-2 wait"),
        _ => ("1 is on", "2-3 wait"),
    };
    assert!(text.contains(&format!("now   {now}")), "{text}");
    assert!(text.contains(&format!("next  {next}")), "{text}");
}

#[test]
fn the_map_shows_what_is_filled_moving_claimed_and_free() {
    let plan = plan();
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let start = drawn(&after(&plan, &entries, 0), LARGE);
    assert!(
        start.contains("\n      · \n   ·  · \n".trim_end()),
        "{start}"
    );
    let end = drawn(&after(&plan, &entries, entries.len()), LARGE);
    assert!(
        end.contains("\n     [3]\n  [1][2]\n") || end.contains("\n     [3]\n  [2][1]\n"),
        "{end}"
    );
    assert!(
        !end.contains("now "),
        "no module is left to wait for: {end}"
    );
    let moving = entries.iter().rposition(is_moving).unwrap();
    let text = drawn(&after(&plan, &entries, moving + 1), LARGE);
    assert!(text.contains('>'), "{text}");
}

#[test]
fn where_a_run_leaves_the_plan_the_verifier_says_who_is_waited_for() {
    let plan = plan();
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let mut watched = after(&plan, &entries, entries.len());
    let entry = Entry {
        at_ms: 9_000,
        event: LogEvent::Gathering(Epoch {
            number: 2,
            convener: ModuleId(1),
        }),
    };
    // The verifier, whose clock the entry has, started later than the view.
    watched.take(&entry, Duration::from_millis(12_100));
    watched.progress = Some(Progress {
        stage: FormationStage::Gathering,
        epoch: None,
        joined: 2,
        expected: Some(3),
        planned: 0,
        agreed: 0,
        settled: 0,
        to_fill: 0,
        stopped: false,
        waiting_for: vec![ModuleId(3)],
    });
    let text = drawn(&watched, LARGE);
    for part in [
        "three  12.3 s, epoch 2",
        "[gathering] → planning",
        "  2/3",
        "waiting for 3",
        "   12.1 s  Epoch 2: all modules halt and gather again",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(
        watched.spot(SpotId(1)),
        super::super::watched::SpotStatus::Free
    );
}

#[test]
fn no_frame_is_larger_than_its_terminal() {
    let plan = plan();
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let mut watched = after(&plan, &entries, entries.len());
    watched.name = "a name\u{1b}[31m that is\nlonger than any terminal is wide, 模块化机器人 模块化机器人 模块化机器人"
        .to_owned();
    let colourful = Style {
        colours: true,
        unicode: false,
    };
    for columns in [1, 10, 39, 80, 300] {
        for rows in [1, 2, 7, 12, 24, 90] {
            let size = Size { columns, rows };
            let lines = frame(
                &watched,
                Duration::from_secs(1),
                size,
                colourful,
                Some(HELP),
            );
            assert!(lines.len() <= rows.max(1), "{size:?}");
            for line in &lines {
                assert!(
                    measure_text_width(line) < columns.max(2),
                    "{size:?}: {line}"
                );
                assert!(
                    !strip_ansi_codes(line).contains(char::is_control),
                    "{line:?}"
                );
            }
        }
    }
}

#[test]
fn colours_add_nothing_but_colour() {
    let plan = plan();
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let colourful = Style {
        colours: true,
        unicode: true,
    };
    for count in 0..=entries.len() {
        let watched = after(&plan, &entries, count);
        let plain = frame(&watched, Duration::ZERO, LARGE, PLAIN, None);
        assert!(plain.iter().all(|line| !line.contains('\u{1b}')));
        let stripped: Vec<String> = frame(&watched, Duration::ZERO, LARGE, colourful, None)
            .iter()
            .map(|line| strip_ansi_codes(line).into_owned())
            .collect();
        assert_eq!(plain, stripped);
    }
}

#[test]
fn a_module_that_only_settles_is_no_news() {
    let plan = plan();
    let mut watched = Watched::new("three");
    watched.set_plan(Arc::clone(&plan));
    let entry = Entry {
        at_ms: 1,
        event: LogEvent::State(ModuleSnapshot {
            module: ModuleId(3),
            phase: ModulePhase::Settled,
            pose: Pose::default(),
            links: [].into(),
            spot: Some(SpotId(3)),
            unit: None,
            in_service: true,
        }),
    };
    watched.take(&entry, Duration::from_millis(1));
    assert_eq!(watched.log.len(), 0);
}

#[test]
fn the_map_shows_obstacles_and_walls_around_the_target() {
    let walled = format!(
        "obstacles: [{{x: 0, y: 1, width: 1, height: 1}}]\narena: {{x: 1, y: -1, width: 9, height: 5}}{SCENARIO}"
    );
    let plan = Arc::new(CheckedPlan::of(&Scenario::from_yaml(&walled).unwrap()).unwrap());
    let entries = course_of_plan(&plan.problem, &plan.outcome, &plan.motion, 5.0);
    let text = drawn(&after(&plan, &entries, 0), LARGE);
    let map: Vec<&str> = text.lines().filter(|line| line.contains('▒')).collect();
    // The row above the arena, and the obstacle to the left of the upper spot.
    assert_eq!(map[0], "  ▒▒▒▒▒▒▒▒▒▒▒▒", "{text}");
    assert_eq!(map[1], "     ▒▒▒ · ", "{text}");
    assert!(text.contains("▒ wall"), "{text}");
}

#[test]
fn lines_that_do_not_fit_are_cut_between_words() {
    assert_eq!(cut("one two three", 13, "…"), "one two three");
    assert_eq!(cut("one two three", 12, "…"), "one two…");
    assert_eq!(cut("unbreakable word", 9, "…"), "unbreaka…");
    assert_eq!(
        cut("\x1b[1mone two\x1b[0m three", 12, "..."),
        "\x1b[1mone two\x1b[0m..."
    );
}
