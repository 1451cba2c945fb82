//! The harness with a handful of modules: files, resumption, determinism and errors.

use std::fs;
use std::path::Path;

use crate::support::{Stopwatch, finish, launcher};
use formation_experiments::{ExperimentError, Scale, Settings, names, run};

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
    finish(out.path(), &Settings::new(Scale::Tiny, 2, 1), &[]).unwrap();
    let summary = fs::read_to_string(out.path().join("summary.md")).unwrap();
    assert_eq!(names().len(), 15);
    for name in names() {
        let rows = rows(&out.path().join(name).with_extension("csv"));
        assert!(rows[0].iter().all(|head| !head.is_empty()));
        assert!(summary.contains(&format!("]({name}.svg)")), "{name}");
    }
    assert!(!summary.contains("NaN"));
    rows(&out.path().join("paper.csv"));
    rows(&out.path().join("processes_runs.csv"));
    let readings = rows(&out.path().join("readings.csv"));
    assert!(readings[1..].iter().all(|row| {
        row[5..]
            .iter()
            .all(|word| ["ahead", "equal", "behind"].contains(&word.as_str()))
    }));
    let comparison = rows(&out.path().join("comparison.csv"));
    let metrics: Vec<&str> = comparison[1..10]
        .iter()
        .map(|row| row[2].as_str())
        .collect();
    assert_eq!(
        metrics[..4],
        ["planning_ms", "utility", "distance_units", "broken_links"]
    );
    for row in &comparison[1..] {
        let reason = row.last().unwrap();
        assert_eq!(row[5] == "behind", !reason.is_empty(), "{row:?}");
    }
    assert_counts_all(&summary, &comparison, 1);
}

/// Checks that a text counts every row of a comparison, with the head, each time that it says in how many ours is ahead or equal.
fn assert_counts_all(text: &str, comparison: &[Vec<String>], times: usize) {
    let rows = &comparison[1..];
    let ahead = rows.iter().filter(|row| row[5] != "behind").count();
    // The text wraps, so that any space can be a line feed.
    let text: Vec<&str> = text.split_whitespace().collect();
    let text = text.join(" ");
    let counts = [
        format!("in {ahead} of {}", rows.len()),
        format!("in {ahead} of the {} numbers", rows.len()),
    ];
    let said: usize = counts.iter().map(|count| text.matches(count).count()).sum();
    assert_eq!(said, times, "ours is ahead or equal {counts:?}");
}

#[test]
fn the_published_evaluation_counts_all_metrics() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let text = fs::read_to_string(docs.join("evaluation.md")).unwrap();
    let comparison = rows(&docs.join("evaluation/comparison.csv"));
    assert_counts_all(&text, &comparison, 2);
    let (_, table) = text
        .split_once("### Ours against the paper policy")
        .unwrap();
    let heads = table.lines().find(|line| line.starts_with('|')).unwrap();
    let metrics: Vec<&String> = comparison[1..10].iter().map(|row| &row[2]).collect();
    // Besides the metrics: the instances, the filled spots, and where ours is behind.
    assert_eq!(heads.matches(" |").count(), metrics.len() + 3, "{heads}");
}

#[test]
fn an_interrupted_run_goes_on_where_it_stopped() {
    let settings = Settings::new(Scale::Tiny, 2, 1);
    let only = ["messages", "case_studies"];
    let whole = tempfile::tempdir().unwrap();
    let cells = finish(whole.path(), &settings, &only).unwrap().measured;

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
    assert_eq!(
        fs::read_to_string(out.path().join("messages.csv")).unwrap(),
        fs::read_to_string(whole.path().join("messages.csv")).unwrap()
    );

    let again = finish(out.path(), &settings, &only).unwrap();
    assert_eq!(again.measured, 0);
}

/// The rows without whatever the clock decides.
fn timeless(path: &Path) -> Vec<Vec<String>> {
    let mut rows = rows(path);
    // The times of this one are simulated.
    let simulated = path.ends_with("messages_over_time.csv");
    let is_timed = |head: &str| {
        let timed = head.contains("_ms") || head.contains("computing_time");
        let shared = head == "per_filled_spot_mean" && path.ends_with("planning_time.csv");
        (timed || shared) && !simulated
    };
    let kept: Vec<bool> = rows[0].iter().map(|head| !is_timed(head)).collect();
    rows.retain(|row| !row.contains(&"planning_ms".to_owned()));
    for row in &mut rows {
        let mut kept = kept.iter();
        row.retain(|_| *kept.next().unwrap());
    }
    rows
}

#[test]
fn the_seed_decides_everything_but_the_times() {
    let outs = [1, 1, 2].map(|seed| {
        let out = tempfile::tempdir().unwrap();
        finish(out.path(), &Settings::new(Scale::Tiny, 2, seed), &[]).unwrap();
        out
    });
    let mut differing = 0;
    for name in names().into_iter().chain(["comparison"]) {
        let [first, second, other] = outs
            .each_ref()
            .map(|out| timeless(&out.path().join(name).with_extension("csv")));
        assert_eq!(first, second, "{name}");
        differing += usize::from(first != other);
    }
    assert!(
        differing > 8,
        "another seed changes only {differing} tables"
    );
}

#[test]
fn a_changed_setting_is_noticed() {
    let out = tempfile::tempdir().unwrap();
    finish(
        out.path(),
        &Settings::new(Scale::Tiny, 1, 1),
        &["case_studies"],
    )
    .unwrap();
    let Err(error) = finish(
        out.path(),
        &Settings::new(Scale::Tiny, 3, 1),
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
        &Settings::new(Scale::Tiny, 1, 1),
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
    let settings = Settings::new(Scale::Tiny, 1, 1);
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
    let settings = Settings::new(Scale::Tiny, 1, 1);
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
    let Err(error) = finish(out.path(), &Settings::new(Scale::Tiny, 0, 1), &[]) else {
        panic!("no runs make no average");
    };
    assert_eq!(error.to_string(), "runs must be 1 to 100000, got 0");
}
