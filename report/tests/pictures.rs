//! What is in the pictures of formations whose plans are known.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;

use crate::support::Formed;
use formation_event_log::{Entry, LogEvent, ModuleSnapshot};
use formation_model::{ModuleId, ModulePhase, Pose};
use formation_report::{PANELS_MAX, Subject, after, before, course_of_plan, figure};

fn count(text: &str, part: &str) -> usize {
    text.matches(part).count()
}

#[test]
fn every_module_spot_and_link_is_drawn_as_what_it_is() {
    for name in [
        "figure1_ladder17",
        "mcs_detach",
        "oversupply",
        "singletons_10",
        "undersupply",
    ] {
        let formed = Formed::shipped(name);
        let subject = formed.subject();
        let statistics = formed.statistics();
        let spots = formed.problem().target().spots().len();
        let (before, after) = (before(&subject), after(&subject));
        for picture in [&before, &after] {
            assert_eq!(
                count(picture, "data-module="),
                formed.problem().modules().len(),
                "{name}"
            );
            assert_eq!(count(picture, "data-spot="), spots, "{name}");
            // One of each more stands in the legend, if there are any.
            let with_legend = |number: usize| number + usize::from(number > 0);
            assert_eq!(
                count(picture, "class=\"link kept\""),
                with_legend(statistics.changes.kept_links),
                "{name}"
            );
            assert_eq!(
                count(picture, "class=\"cross\""),
                with_legend(statistics.changes.broken_links),
                "{name}"
            );
        }
        assert_eq!(count(&before, "spot open"), 0);
        let open = statistics.open_spots.len();
        assert_eq!(count(&after, "spot open"), open + usize::from(open > 0));
        assert!(after.contains(&format!("after: {} of {spots} spots filled", spots - open)));
    }
}

#[test]
fn configurations_differ_in_colour_and_are_named() {
    let picture = before(&Formed::shipped("figure1_ladder17").subject());
    for (colour, name) in [
        ("#56b4e9", "configuration 1, 8 modules"),
        ("#e69f00", "configuration 2, 6 modules"),
        ("#009e73", "configuration 3, 2 modules"),
        ("#d4d4d4", "1 single module"),
    ] {
        assert!(picture.contains(&format!(">{name}<")), "{name}");
        assert!(picture.contains(&format!("fill=\"{colour}\"")), "{colour}");
    }
}

#[test]
fn a_name_stays_a_name() {
    let formed = Formed::of(
        r#"
name: "<script>alert(1)</script>\u0007 & co"
target: {spots: [{id: 1, x: 0.0, y: 0.0}]}
singletons: [{id: 7, x: 0.0, y: 1.0}]
"#,
    );
    let picture = after(&formed.subject());
    assert!(!picture.contains("<script"));
    assert!(!picture.contains('\u{7}'));
    assert!(picture.contains("&lt;script&gt;alert(1)&lt;/script&gt;\u{fffd} &amp; co"));
}

#[test]
fn things_far_apart_still_make_a_picture() {
    let formed = Formed::of(
        "
target: {spots: [{id: 1, x: 0.0, y: 0.0}, {id: 4000000000, x: 1.0, y: 0.0}], edges: [[1, 4000000000]]}
singletons: [{id: 7, x: -1000000.0, y: 1000000.0}, {id: 8, x: 1000000.0, y: 0.0}]
",
    );
    let picture = before(&formed.subject());
    assert!(picture.contains("Modules are drawn larger than they are."));
    assert!(!picture.contains("NaN") && !picture.contains("inf"));
}

/// A wall between the modules and the target leaves no path, so none moves.
#[test]
fn a_plan_that_cannot_be_carried_out_ends_as_it_starts() {
    // The spot is turned by a quarter, and the corridor has no room to turn.
    let narrow = "arena: {x: 1.5, y: 0, width: 4, height: 1}\n\
                  target: {spots: [{id: 1, x: 3, y: 0, theta: 1.5708}]}\nsingletons: [{id: 1, x: 0, y: 0}]";
    let formed = Formed::of(narrow);
    assert!(formed.motion.refusal().is_some(), "{:?}", formed.motion);
    let picture = after(&formed.subject());
    assert!(picture.contains("after: 0 of 1 spot filled"), "{picture}");
    assert_eq!(count(&picture, "spot open"), 1 + 1);
}

#[test]
fn a_module_whose_process_died_looks_different_in_the_end() {
    let formed = Formed::of(
        "target: {map: 'o-o'}\nsingletons: [{id: 1, x: 0, y: 3}, {id: 2, x: 1, y: 3}, {id: 3, x: 2, y: 3}]",
    );
    let subject = formed.subject().with_dead(&BTreeSet::from([ModuleId(2)]));
    let (before, after) = (before(&subject), after(&subject));
    assert_eq!(count(&before, r#"<g class="dead">"#), 0);
    assert_eq!(count(&after, r#"<g class="dead">"#), 1);
    assert!(
        after.contains(r#"<g class="dead"><g class="module" data-module="2""#),
        "{after}"
    );
    assert!(after.contains(">module whose process died<"));
}

#[test]
fn a_figure_is_a_row_from_the_start_to_the_end() {
    let formed = Formed::shipped("figure1_ladder17");
    let course = course_of_plan(formed.problem(), &formed.outcome, &formed.motion, 1.0);
    let subject = formed.subject();
    let row = figure(&subject, &course, &[0, 50, 100]);
    assert_eq!(count(&row, "class=\"panel\""), 3);
    assert_eq!(count(&row, "data-module=\"4\""), 3);
    // Module 4 begins on the ground at its pose, moves, and ends elsewhere.
    let places: Vec<&str> = row
        .split("data-module=\"4\" transform=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    assert!(
        places[0] != places[1] && places[1] != places[2],
        "{places:?}"
    );
    assert!(row.contains("50 %"));
    let many = vec![0; PANELS_MAX + 5];
    assert_eq!(
        count(&figure(&subject, &course, &many), "class=\"panel\""),
        PANELS_MAX
    );
}

/// Where module 2 is drawn.
fn place_of_second(figure: &str) -> &str {
    let rest = figure
        .split("data-module=\"2\" transform=\"")
        .nth(1)
        .unwrap();
    rest.split('"').next().unwrap()
}

#[test]
fn the_moments_of_a_figure_are_shares_of_the_recorded_time() {
    let formed = Formed::shipped("singletons_10");
    let pose = |x: f64| Pose::from_units(x, 40.0, 0.0).unwrap();
    let state = |at_ms, module, phase, x| Entry {
        at_ms,
        event: LogEvent::State(ModuleSnapshot {
            module: ModuleId(module),
            phase,
            pose: pose(x),
            links: BTreeSet::new(),
            spot: None,
            unit: None,
            in_service: true,
        }),
    };
    // Module 1 drives for a second, and module 2 for a second after a wait of eight.
    let course = [
        state(0, 1, ModulePhase::Moving, 0.0),
        state(0, 2, ModulePhase::Waiting, 20.0),
        state(1_000, 1, ModulePhase::Settled, 10.0),
        state(9_000, 2, ModulePhase::Moving, 20.0),
        state(10_000, 2, ModulePhase::Settled, 30.0),
    ];
    let (problem, outcome) = (formed.problem(), &formed.outcome);
    let subject = Subject::of_course("waits", problem, outcome, &course, None);
    let at = |percent| {
        let row = figure(&subject, &course, &[percent]);
        place_of_second(&row).to_owned()
    };
    assert_eq!(at(80), at(20), "it waits");
    assert_ne!(at(95), at(80));
    assert_ne!(at(100), at(95));
}
