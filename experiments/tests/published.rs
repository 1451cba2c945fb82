//! The published evaluation: every table follows from the committed results, and the results from the program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::support::Stopwatch;
use formation_experiments::{ExperimentError, ExperimentSettings, Publication, recompute, run};
use formation_tests::root;

const RESULTS: [&str; 3] = ["settings.json", "cells.jsonl", "times.jsonl"];

fn committed() -> PathBuf {
    root().join("docs/evaluation")
}

/// The CSV files and the results of a directory by name.
fn texts(directory: &Path) -> BTreeMap<String, String> {
    let entries = fs::read_dir(directory).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names
        .filter(|name| RESULTS.contains(&name.as_str()) || name.ends_with(".csv"))
        .map(|name| {
            let text = fs::read_to_string(directory.join(&name)).unwrap();
            (name, text)
        })
        .collect()
}

/// All files as the program writes them from the committed results, in which no cell may be missing.
fn generated() -> BTreeMap<String, String> {
    let out = tempfile::tempdir().unwrap();
    for name in RESULTS {
        fs::copy(committed().join(name), out.path().join(name)).unwrap();
    }
    let settings = fs::read_to_string(committed().join("settings.json")).unwrap();
    let settings: ExperimentSettings = serde_json::from_str(&settings).unwrap();
    let mut progress = Stopwatch::never_stopping();
    run(
        out.path(),
        &settings,
        &[],
        Path::new("/nowhere"),
        &mut progress,
    )
    .unwrap();
    assert_eq!(progress.measured, 0, "cells are missing");
    texts(out.path())
}

/// `FORMATION_UPDATE_DOCUMENTS=1` writes the tables instead.
#[test]
fn every_table_follows_from_the_committed_results() {
    let generated = generated();
    let page = root().join("docs/evaluation.md");
    let text = fs::read_to_string(&page).unwrap();
    let filled = Publication::read(&committed())
        .unwrap()
        .fill(&text)
        .unwrap();
    if std::env::var_os("FORMATION_UPDATE_DOCUMENTS").is_some() {
        for name in texts(&committed()).keys() {
            if !generated.contains_key(name) {
                fs::remove_file(committed().join(name)).unwrap();
            }
        }
        for (name, text) in &generated {
            fs::write(committed().join(name), text).unwrap();
        }
        fs::write(&page, &filled).unwrap();
        return;
    }
    let advice = "run `FORMATION_UPDATE_DOCUMENTS=1 cargo test -p formation_experiments --test all published`";
    let kept = texts(&committed());
    assert_eq!(
        kept.keys().collect::<Vec<_>>(),
        generated.keys().collect::<Vec<_>>(),
        "{advice}"
    );
    for (name, text) in &generated {
        assert_same(
            &format!("docs/evaluation/{name}"),
            &kept[name],
            text,
            advice,
        );
    }
    assert_same("docs/evaluation.md", &text, &filled, advice);
}

fn assert_same(name: &str, kept: &str, generated: &str, advice: &str) {
    let mut lines = (1..).zip(kept.lines().zip(generated.lines()));
    if let Some((number, (kept, generated))) =
        lines.find(|(_, (kept, generated))| kept != generated)
    {
        panic!(
            "{name}, line {number} does not follow from the results; {advice}\n  is:     {kept}\n  follows: {generated}"
        );
    }
    assert!(
        kept == generated,
        "{name} has more or fewer lines; {advice}"
    );
}

#[test]
fn the_page_has_every_table() {
    let page = fs::read_to_string(root().join("docs/evaluation.md")).unwrap();
    for name in Publication::read(&committed()).unwrap().blocks.keys() {
        let mark = format!("<!-- table: {name} -->");
        assert_eq!(page.matches(&mark).count(), 1, "{mark}");
    }
    // A table without a mark would be written by hand.
    let outside: String = page
        .split("<!-- table: ")
        .map(|part| {
            part.split_once("<!-- end of table -->")
                .map_or(part, |(_, after)| after)
        })
        .collect();
    let by_hand = outside.lines().find(|line| line.starts_with('|'));
    assert_eq!(by_hand, None);
}

#[test]
fn a_cell_of_each_experiment_is_what_the_program_computes() {
    let recomputed = recompute(&committed()).unwrap();
    let mut experiments: Vec<&str> = recomputed.iter().map(|cell| cell.experiment).collect();
    experiments.dedup();
    // All but those of real processes.
    assert_eq!(experiments.len(), 16);
    for cell in &recomputed {
        assert_eq!(
            cell.kept.as_deref(),
            Some(cell.now.as_str()),
            "{}: {}",
            cell.experiment,
            cell.label
        );
    }
}

#[test]
fn an_edited_table_is_replaced() {
    let blocks = [("sums", "| a | 1 |\n"), ("means", "| b | 2 |\n")];
    let publication = Publication {
        blocks: blocks
            .map(|(name, text)| (name.to_owned(), text.to_owned()))
            .into(),
        ..Publication::default()
    };
    let page = "# Page\n\n<!-- table: sums -->\n\n| a | 3 |\n\n<!-- end of table -->\n\nText.\n";
    let filled = publication.fill(page).unwrap();
    assert_eq!(filled, page.replace('3', "1"));
    assert_eq!(publication.fill(&filled).unwrap(), filled);

    let refused = |page: &str| match publication.fill(page) {
        Err(ExperimentError::BadInput(reason)) => reason,
        other => panic!("{other:?}"),
    };
    assert!(refused("<!-- table: other -->\n<!-- end of table -->\n").contains("other"));
    assert!(refused("<!-- table: means -->\n\n| b | 2 |\n").contains("no line"));
}
