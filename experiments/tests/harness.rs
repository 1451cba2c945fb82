//! The harness with a handful of modules: files, resumption, determinism and errors.

use std::fs;
use std::path::Path;

use crate::support::{Stopwatch, finish, launcher};
use formation_experiments::{ExperimentError, ExperimentSettings, Scale, names, run};

/// The fields of a line of CSV; commas within quotation marks separate nothing.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for character in line.chars() {
        match character {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            other => fields.last_mut().unwrap().push(other),
        }
    }
    fields
}

fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<String>> = text.lines().map(fields).collect();
    assert!(rows.len() > 1, "{} has no rows", path.display());
    for row in &rows {
        assert_eq!(row.len(), rows[0].len(), "{}: {row:?}", path.display());
    }
    rows
}

#[test]
fn every_experiment_has_its_table_and_its_section() {
    let out = tempfile::tempdir().unwrap();
    finish(out.path(), &ExperimentSettings::new(Scale::Tiny, 2, 1), &[]).unwrap();
    let summary = fs::read_to_string(out.path().join("summary.md")).unwrap();
    assert_eq!(names().len(), 18);
    for name in names() {
        let rows = rows(&out.path().join(name).with_extension("csv"));
        assert!(rows[0].iter().all(|head| !head.is_empty()));
        assert!(summary.contains(&format!("]({name}.svg)")), "{name}");
    }
    assert!(!summary.contains("NaN"));
    rows(&out.path().join("paper.csv"));
    rows(&out.path().join("processes_runs.csv"));
    assert_headline_counts_all(&summary, out.path());
}

/// Checks that the headline counts every line of both comparisons once, for each reading.
fn assert_headline_counts_all(text: &str, directory: &Path) {
    let mut lines = Vec::new();
    for name in ["comparison.csv", "comparison_times.csv"] {
        lines.extend(rows(&directory.join(name)).into_iter().skip(1));
    }
    let all = lines.len();
    for reading in [7, 8] {
        let [ahead, equal, behind] = ["ahead", "equal", "behind"].map(|standing| {
            lines
                .iter()
                .filter(|line| line[reading] == standing)
                .count()
        });
        assert_eq!(ahead + equal + behind, all);
        let said =
            format!("ahead in {ahead}, equal in {equal} and behind in {behind} of {all} numbers");
        assert_eq!(text.matches(&said).count(), 1, "{said}");
    }
}

#[test]
fn the_comparison_hides_no_metric() {
    let out = tempfile::tempdir().unwrap();
    finish(out.path(), &ExperimentSettings::new(Scale::Tiny, 1, 1), &[]).unwrap();
    let metrics = |name: &str| -> Vec<String> {
        let mut metrics = Vec::new();
        for row in rows(&out.path().join(name)).into_iter().skip(1) {
            if !metrics.contains(&row[3]) {
                metrics.push(row[3].clone());
            }
        }
        metrics
    };
    assert_eq!(
        metrics("comparison.csv"),
        [
            "broken_links",
            "port_changes",
            "outside_largest_piece",
            "alone",
            "distance_units",
            "utility",
            "filled_spots",
            "decisions",
            "samples",
            "pairs_delivered",
            "samples_same_protocol",
            "pairs_same_protocol"
        ]
    );
    assert_eq!(
        metrics("comparison_times.csv"),
        ["planning_ms", "selected_percent_at_half_time"]
    );
}

#[test]
fn an_interrupted_run_goes_on_where_it_stopped() {
    let settings = ExperimentSettings::new(Scale::Tiny, 2, 1);
    let only = ["messages", "case_studies"];
    let whole = tempfile::tempdir().unwrap();
    let cells = finish(whole.path(), &settings, &only).unwrap().measured;
    let whole = |name: &str| fs::read_to_string(whole.path().join(name)).unwrap();

    let out = tempfile::tempdir().unwrap();
    let only_owned = only.map(str::to_owned);
    let mut progress = Stopwatch::stopping_after(5);
    let interrupted = run(
        out.path(),
        &settings,
        &only_owned,
        Path::new("/nowhere"),
        &mut progress,
    );
    assert!(matches!(interrupted, Err(ExperimentError::Interrupted)));
    assert!(!out.path().join("summary.md").exists());

    // What a kill in the middle of a write leaves behind.
    let kept = out.path().join("cells.jsonl");
    let mut text = fs::read_to_string(&kept).unwrap();
    let finished = text.lines().count();
    assert!(finished >= 5 && finished < cells, "{finished} of {cells}");
    text.push_str("{\"cell\":{\"kind\"");
    fs::write(&kept, text).unwrap();

    let progress = finish(out.path(), &settings, &only).unwrap();
    let work = progress.work.unwrap();
    assert_eq!((work.cells, work.finished_cells), (cells, finished));
    assert_eq!(progress.measured, cells - finished);
    for name in ["messages.csv", "cells.jsonl"] {
        let resumed = fs::read_to_string(out.path().join(name)).unwrap();
        assert!(resumed == whole(name), "{name}");
    }

    let again = finish(out.path(), &settings, &only).unwrap();
    assert_eq!(again.measured, 0);
}

/// Whether the clock decides the numbers of a file.
fn is_timed(name: &str) -> bool {
    name.ends_with("_times.csv")
        || name.ends_with("_time.csv") && name != "messages_over_time.csv"
        || name.starts_with("processes")
        || name == "physical_world.csv"
}

#[test]
fn the_seed_decides_everything_but_the_times() {
    let outs = [1, 1, 2].map(|seed| {
        let out = tempfile::tempdir().unwrap();
        finish(
            out.path(),
            &ExperimentSettings::new(Scale::Tiny, 2, seed),
            &[],
        )
        .unwrap();
        out
    });
    let entries = fs::read_dir(outs[0].path()).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let names: Vec<String> = names
        .filter(|name| name == "cells.jsonl" || name.ends_with(".csv") && !is_timed(name))
        .collect();
    let mut differing = 0;
    for name in &names {
        let [first, second, other] = outs
            .each_ref()
            .map(|out| fs::read_to_string(out.path().join(name)).unwrap());
        assert!(first == second, "{name}");
        differing += usize::from(first != other);
    }
    assert!(
        differing > 8,
        "another seed changes only {differing} of {} files",
        names.len()
    );
}

#[test]
fn a_changed_setting_is_noticed() {
    let out = tempfile::tempdir().unwrap();
    finish(
        out.path(),
        &ExperimentSettings::new(Scale::Tiny, 1, 1),
        &["case_studies"],
    )
    .unwrap();
    let Err(error) = finish(
        out.path(),
        &ExperimentSettings::new(Scale::Tiny, 3, 1),
        &["case_studies"],
    ) else {
        panic!("the number of runs has changed");
    };
    assert!(matches!(error, ExperimentError::BadInput(_)));
    let message = error.to_string();
    assert!(message.contains("runs was 1, now 3"), "{message}");
    assert!(message.contains("settings.json"), "{message}");
}

#[test]
fn an_unknown_name_is_an_error_that_lists_the_names() {
    let out = tempfile::tempdir().unwrap();
    let Err(error) = finish(
        out.path(),
        &ExperimentSettings::new(Scale::Tiny, 1, 1),
        &["distance", "nonsense"],
    ) else {
        panic!("there is no such experiment");
    };
    let message = error.to_string();
    assert!(matches!(error, ExperimentError::BadInput(_)) && message.contains("nonsense"));
    for name in names() {
        assert!(message.contains(name), "{name} is missing in: {message}");
    }
    assert!(!out.path().join("settings.json").exists());
}

#[test]
fn what_is_no_result_is_named_with_its_line() {
    let out = tempfile::tempdir().unwrap();
    let settings = ExperimentSettings::new(Scale::Tiny, 1, 1);
    finish(out.path(), &settings, &["case_studies"]).unwrap();
    let path = out.path().join("cells.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, format!("{text}{{}}\n")).unwrap();
    let Err(error) = finish(out.path(), &settings, &["case_studies"]) else {
        panic!("an empty object is no result");
    };
    let line = text.lines().count() + 1;
    assert!(
        error.to_string().contains(&format!("line {line}")),
        "{error}"
    );
}

#[test]
fn processes_that_fail_are_an_error_and_the_rest_is_kept() {
    let home = tempfile::tempdir().unwrap();
    let out = tempfile::tempdir().unwrap();
    let settings = ExperimentSettings::new(Scale::Tiny, 1, 1);
    for (script, words) in [
        ("echo 'error: no room' >&2; exit 2", "no room"),
        ("echo '{}'", "verdict"),
        (
            r#"echo '{"verdict": "FAILED", "planning_ms": 1, "discovery_ms": 1, "planning_us": 1}'"#,
            "FAILED",
        ),
    ] {
        let launcher = launcher(home.path(), script);
        let mut progress = Stopwatch::never_stopping();
        let only = ["processes".to_owned(), "case_studies".to_owned()];
        let Err(error) = run(out.path(), &settings, &only, &launcher, &mut progress) else {
            panic!("`{script}` is no success");
        };
        let cause = std::error::Error::source(&error).unwrap().to_string();
        assert!(cause.contains(words), "{cause}");
        assert!(error.to_string().contains("processes"), "{error}");
    }
    let kept = fs::read_to_string(out.path().join("cells.jsonl")).unwrap();
    assert_eq!(kept.lines().count(), 24, "the plans of the case studies");
}

#[test]
fn an_average_over_nothing_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let Err(error) = finish(out.path(), &ExperimentSettings::new(Scale::Tiny, 0, 1), &[]) else {
        panic!("no runs make no average");
    };
    assert_eq!(error.to_string(), "runs must be 1 to 100000, got 0");
}
