//! What is in the page, and in the film that it plays.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::time::Duration;

use crate::support::Formed;
use formation_event_log::{Entry, LogEvent, ModuleSnapshot};
use formation_model::{Decision, Epoch, ModuleId, ModulePhase, Pose, SpotId, SpotSelection};
use formation_report::{Fact, Summary, Tone, course_of_plan, page};
use serde_json::Value;

fn summary(outcome: &str) -> Summary {
    Summary {
        outcome: outcome.to_owned(),
        tone: Tone::Good,
        source: "from a test".to_owned(),
        facts: vec![Fact::new("total distance", "3.5 units")],
        notes: vec!["a note".to_owned()],
    }
}

/// The data that the player reads.
fn film(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"film\">").unwrap();
    let (film, _) = rest.split_once("</script>").unwrap();
    serde_json::from_str(film).unwrap()
}

fn planned(formed: &Formed) -> (Vec<Entry>, Value) {
    let course = course_of_plan(formed.problem(), &formed.outcome, &formed.motion, 5.0);
    let film = film(&page(&formed.subject(), &course, &summary("done")));
    (course, film)
}

fn last(list: &Value) -> &Value {
    list.as_array().unwrap().last().unwrap()
}

/// The sentences of the steps.
fn steps(film: &Value) -> Vec<&str> {
    let steps = film["steps"].as_array().unwrap();
    steps
        .iter()
        .map(|step| step["text"].as_str().unwrap())
        .collect()
}

#[test]
fn modules_are_played_along_their_paths() {
    let formed = Formed::of(
        "
target: {spots: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}], edges: [[1, 2]]}
singletons: [{id: 7, x: 0, y: 2}, {id: 8, x: 4, y: 3}]
",
    );
    let (_, film) = planned(&formed);
    let side = |module: usize, frame: usize| {
        let track = &film["modules"][module]["track"];
        let place = |frame: &Value| (frame[1].as_f64().unwrap(), frame[2].as_f64().unwrap());
        let (from, to) = (place(&track[frame]), place(&track[frame + 1]));
        ((to.0 - from.0).abs(), (to.1 - from.1).abs())
    };
    let frames = film["modules"][1]["track"].as_array().unwrap().len();
    let legs: Vec<(f64, f64)> = (0..frames - 1).map(|frame| side(1, frame)).collect();
    assert!(
        legs.iter().all(|leg| leg.0 < 0.1 || leg.1 < 0.1),
        "{legs:?}"
    );
    let length = |along: fn(&(f64, f64)) -> f64| legs.iter().map(along).sum::<f64>();
    assert!((length(|leg| leg.0) - 3.0 * 48.0).abs() < 1.0, "{legs:?}");
    assert!((length(|leg| leg.1) - 3.0 * 48.0).abs() < 1.0, "{legs:?}");
}

#[test]
fn a_plan_is_played_to_its_end() {
    for name in [
        "figure1_ladder17",
        "mcs_detach",
        "oversupply",
        "undersupply",
    ] {
        let formed = Formed::shipped(name);
        let (course, film) = planned(&formed);
        let modules = film["modules"].as_array().unwrap();
        for spot in film["spots"].as_array().unwrap() {
            let id = SpotId(u32::try_from(spot["id"].as_u64().unwrap()).unwrap());
            if formed.outcome.open_spots.contains(&id) {
                assert_eq!(spot["holders"], serde_json::json!([]), "{name}: {id}");
                continue;
            }
            let holder = usize::try_from(last(&spot["holders"])[1].as_u64().unwrap()).unwrap();
            let holder = &modules[holder];
            let module = ModuleId(u32::try_from(holder["id"].as_u64().unwrap()).unwrap());
            assert_eq!(formed.outcome.plan.assignments[&module], id, "{name}");
            assert_eq!(last(&holder["phases"])[1], "SETTLED");
            let end = last(&holder["track"]);
            assert_eq!(
                (&end[1], &end[2]),
                (&spot["x"], &spot["y"]),
                "{name}: {module}"
            );
        }
        let sentences = steps(&film);
        let turns = sentences
            .iter()
            .filter(|text| text.starts_with("Turn "))
            .count();
        assert_eq!(turns, formed.outcome.decisions.len());
        assert_eq!(sentences.last(), Some(&"done"));
        let units = &formed.outcome.plan.assembly.units;
        let set_off = sentences
            .iter()
            .filter(|text| text.contains(" off "))
            .count();
        assert_eq!(set_off, units.len(), "{name}");
        // All units move at the same time, at 5 steps a second.
        let seconds = f64::from(formed.motion.paths().unwrap().makespan) / 5.0;
        let recorded = Duration::from_millis(course.last().unwrap().at_ms);
        assert!((recorded.as_secs_f64() - seconds).abs() < 0.01, "{name}");
        assert_eq!(last(&film["clock"])[1], course.last().unwrap().at_ms);
    }
}

#[test]
fn the_film_begins_at_the_first_motion() {
    let formed = Formed::shipped("figure1_ladder17");
    let (_, film) = planned(&formed);
    let begin = film["begin"].as_f64().unwrap();
    let modules = film["modules"].as_array().unwrap();
    let phases = modules
        .iter()
        .flat_map(|module| module["phases"].as_array().unwrap());
    let moving = phases.filter(|phase| phase[1] == "MOVING");
    let first = moving.map(|phase| phase[0].as_f64().unwrap());
    assert!((first.fold(f64::INFINITY, f64::min) - begin).abs() < 1e-9);
    let steps = film["steps"].as_array().unwrap();
    let turns = steps
        .iter()
        .filter(|step| step["text"].as_str().unwrap().starts_with("Turn "));
    assert!(turns.clone().count() > 0);
    assert!(
        turns
            .map(|step| step["at"].as_f64().unwrap())
            .all(|at| at < begin)
    );
}

#[test]
fn planned_paths_lead_to_the_spots_round_obstacles() {
    let formed = Formed::shipped("two_rooms");
    let (_, film) = planned(&formed);
    assert_eq!(last(&film["planned"])[1], true);
    let assignments = &formed.outcome.plan.assignments;
    let modules = film["modules"].as_array().unwrap();
    let mut turns = 0;
    for module in modules {
        let id = ModuleId(u32::try_from(module["id"].as_u64().unwrap()).unwrap());
        let Some(spot) = assignments.get(&id) else {
            continue;
        };
        let spots = film["spots"].as_array().unwrap();
        let spot = spots.iter().find(|known| known["id"] == spot.0).unwrap();
        let path = module["path"].as_array().unwrap();
        let end = path.last().unwrap();
        assert_eq!((&end[0], &end[1]), (&spot["x"], &spot["y"]), "{id}");
        let start = &module["track"][0];
        assert_eq!((&path[0][0], &path[0][1]), (&start[1], &start[2]), "{id}");
        turns += path.len() - 2;
    }
    assert!(
        turns > 0,
        "the straight lines to the spots lead through the wall"
    );
}

#[test]
fn links_are_there_as_long_as_they_hold() {
    let formed = Formed::shipped("figure1_ladder17");
    let (_, film) = planned(&formed);
    let links = film["links"].as_array().unwrap();
    let of = |fate: &'static str| links.iter().filter(move |link| link[2] == fate);
    let statistics = formed.statistics();
    assert_eq!(of("kept").count(), statistics.changes.kept_links);
    assert!(of("kept").all(|link| link[4].is_null()), "kept to the end");
    assert_eq!(of("broken").count(), statistics.changes.broken_links);
    assert!(of("broken").all(|link| link[4].as_f64() > link[3].as_f64()));
    let edges = formed.problem().target().topology().edges().len();
    assert_eq!(of("new").count(), edges - statistics.changes.kept_links);
}

fn state(module: u32, phase: ModulePhase, x: f64, links: &[u32]) -> LogEvent {
    LogEvent::State(ModuleSnapshot {
        module: ModuleId(module),
        phase,
        pose: Pose::from_units(x, 1.0, 0.0).unwrap(),
        links: links.iter().copied().map(ModuleId).collect(),
        spot: (phase != ModulePhase::Listening).then_some(SpotId(1)),
        unit: None,
        in_service: true,
    })
}

fn claim(epoch: Epoch, module: u32) -> LogEvent {
    LogEvent::Claim {
        epoch,
        turn: 0,
        claimant: ModuleId(module),
        decision: Decision {
            selections: vec![SpotSelection {
                spot: SpotId(1),
                module: ModuleId(module),
            }],
            ..Decision::default()
        },
    }
}

/// A restart opens a second epoch, in which the decisions of the first are not shown.
#[test]
fn a_new_epoch_begins_with_free_spots() {
    use ModulePhase::{Listening, Moving, Settled, Waiting};
    let formed = Formed::of(
        "
target: {spots: [{id: 1, x: 0.0, y: 0.0}]}
singletons: [{id: 7, x: 0.0, y: 1.0}, {id: 8, x: 1.0, y: 1.0}]
",
    );
    let epoch = |number| Epoch {
        number,
        convener: ModuleId(7),
    };
    let events = [
        (0, state(7, Listening, 0.0, &[])),
        (900, state(8, Listening, 1.0, &[])),
        (1_000, LogEvent::Gathering(epoch(1))),
        (
            1_010,
            LogEvent::Roster {
                epoch: epoch(1),
                modules: vec![ModuleId(7), ModuleId(8)],
                out_of_service: Vec::new(),
                problem: None,
            },
        ),
        (1_020, claim(epoch(1), 7)),
        (1_030, state(7, Waiting, 0.0, &[])),
        (1_040, state(7, Moving, 0.0, &[])),
        (
            1_500,
            LogEvent::Pose {
                module: ModuleId(7),
                pose: Pose::from_units(-9.0, 1.0, 0.0).unwrap(),
            },
        ),
        (1_600, state(7, Listening, 0.0, &[])),
        (9_000, LogEvent::Gathering(epoch(2))),
        (
            9_010,
            LogEvent::Roster {
                epoch: epoch(2),
                modules: vec![ModuleId(8)],
                out_of_service: Vec::new(),
                problem: None,
            },
        ),
        (9_020, claim(epoch(2), 8)),
        (9_030, state(8, Moving, 1.0, &[])),
        (9_930, state(8, Settled, 0.0, &[])),
        (9_940, state(99, Settled, 0.0, &[])),
    ];
    let course: Vec<Entry> = events
        .into_iter()
        .map(|(at_ms, event)| Entry { at_ms, event })
        .collect();
    let film = film(&page(&formed.subject(), &course, &summary("well")));
    assert_eq!(
        steps(&film),
        [
            "All 2 modules have joined",
            "The roster is fixed: 2 modules take part",
            "Turn 1: module 7 takes spot 1",
            "All modules hold the same plan; they may move now",
            "Module 7 sets off to spot 1",
            "Module 7 starts again",
            "Epoch 2: all modules halt and gather again",
            "The roster is fixed: 1 module takes part",
            "Turn 1: module 8 takes spot 1",
            "All modules hold the same plan; they may move now",
            "Module 8 sets off to spot 1",
            "Module 8 has settled on spot 1",
            "well",
        ]
    );
    let follows = film["planned"].as_array().unwrap().iter();
    let follows: Vec<&Value> = follows.map(|entry| &entry[1]).collect();
    assert_eq!(
        follows,
        [false, false],
        "neither roster has the problem of the plan"
    );
    let holders: Vec<&Value> = film["spots"][0]["holders"]
        .as_array()
        .unwrap()
        .iter()
        .map(|holder| &holder[1])
        .collect();
    assert_eq!(holders, [&Value::from(0), &Value::Null, &Value::from(1)]);
    let length = film["length"].as_f64().unwrap();
    assert!(length < 9.0, "the wait of seven seconds is cut: {length}");
    let times: Vec<f64> = film["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| step["at"].as_f64().unwrap())
        .collect();
    assert!(times.is_sorted() && times.last() == Some(&length));
}

#[test]
fn nothing_from_outside_ends_the_script_or_fills_the_template() {
    let formed = Formed::of(
        r#"
name: "</script><b>{{film}}{{player}}"
target: {spots: [{id: 1, x: 0.0, y: 0.0}]}
singletons: [{id: 7, x: 0.0, y: 1.0}]
"#,
    );
    let course = course_of_plan(formed.problem(), &formed.outcome, &formed.motion, 5.0);
    let page = page(
        &formed.subject(),
        &course,
        &summary("</script><i>{{style}}"),
    );
    assert_eq!(
        page.matches("<script").count(),
        2,
        "the film and the player"
    );
    assert_eq!(page.matches("</script>").count(), 2);
    assert!(!page.contains("<b>") && !page.contains("<i>"));
    assert_eq!(steps(&film(&page)).last(), Some(&"</script><i>{{style}}"));
    // Only what came from outside still looks like a marker: the title twice, the outcome, and that in the film.
    assert_eq!(page.matches("{{").count(), 2 * 2 + 1 + 1);
}

#[test]
fn everything_stands_in_the_page() {
    let formed = Formed::shipped("figure1_ladder17");
    let course = course_of_plan(formed.problem(), &formed.outcome, &formed.motion, 5.0);
    let page = page(&formed.subject(), &course, &summary("all is well"));
    for part in [
        "all is well",
        "from a test",
        "total distance",
        "3.5 units",
        "a note",
        "configuration 2, leads it",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(
        !page.contains("{{"),
        "a marker of the template is not filled"
    );
    assert_eq!(page.matches("<tr data-row=").count(), 17);
    for address in ["http:", "https:", "//www", "@import", "src="] {
        let own = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!own.contains(address), "{address}");
    }
}
