//! `plot.py` draws every plot from the CSV files, and the committed plots are those of the committed CSV files.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Stdio;

use crate::support::finish;
use formation_experiments::{ExperimentSettings, Scale, names};
use formation_tests::{Python, Tool, root, tool_or_skip};

/// Runs `plot.py`; returns false, with a line that says so, where matplotlib is missing.
fn draw(from: &Path, to: &Path) -> bool {
    let Some(python) = Python::find() else {
        return false;
    };
    let arguments = [from.to_str().unwrap(), "--to", to.to_str().unwrap()];
    let child = python.start("experiments/plot.py", &arguments, Stdio::piped());
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    if errors.contains("matplotlib is missing") {
        let missing = format!("matplotlib is missing ({})", python.advice());
        return tool_or_skip::<()>(Tool::Python, Err(missing)).is_some();
    }
    assert!(output.status.success(), "{errors}");
    true
}

fn plot(directory: &Path, name: &str) -> String {
    fs::read_to_string(directory.join(name).with_extension("svg")).unwrap()
}

/// The texts of a plot: title, axes, ticks and legend.
fn texts(plot: &str) -> Vec<&str> {
    let elements = plot.split("<text").skip(1);
    let texts = elements.map(|element| element.split(['>', '<']).nth(1).unwrap());
    texts.collect()
}

#[test]
fn every_experiment_has_a_plot_for_light_and_dark_surroundings() {
    let out = tempfile::tempdir().unwrap();
    finish(out.path(), &ExperimentSettings::new(Scale::Tiny, 2, 1), &[]).unwrap();
    if !draw(out.path(), out.path()) {
        return;
    }
    for name in names() {
        let plot = plot(out.path(), name);
        assert!(texts(&plot).len() > 8, "{name}");
        assert!(plot.contains("prefers-color-scheme: dark"), "{name}");
        assert!(!plot.contains("NaN") && !plot.contains("inf"), "{name}");
    }
    assert!(texts(&plot(out.path(), "processes")).contains(&"3 on 3"));
}

#[test]
fn the_committed_plots_show_the_committed_numbers() {
    let committed = root().join("docs/evaluation");
    let document = fs::read_to_string(root().join("docs/evaluation.md")).unwrap();
    let drawn = tempfile::tempdir().unwrap();
    if !draw(&committed, drawn.path()) {
        return;
    }
    for name in names() {
        assert!(
            document.contains(&format!("evaluation/{name}.svg")),
            "{name}"
        );
        let (committed, drawn) = (plot(&committed, name), plot(drawn.path(), name));
        assert_eq!(texts(&committed), texts(&drawn), "{name}");
        for element in ["<path", "<use", "<g "] {
            let count = |plot: &str| plot.matches(element).count();
            assert_eq!(count(&committed), count(&drawn), "{name}: {element}");
        }
    }
    assert!(texts(&plot(&committed, "messages")).contains(&"1,000,000"));
}

#[test]
fn the_tests_use_the_version_that_users_install() {
    let versions = |file: &str| -> BTreeSet<String> {
        let text = fs::read_to_string(root().join(file)).unwrap();
        let lines = text.lines().filter(|line| line.starts_with("matplotlib"));
        lines.map(str::to_owned).collect()
    };
    let pinned = versions("experiments/plot_requirements.txt");
    assert_eq!(pinned.len(), 1);
    assert_eq!(pinned, versions("tests/requirements.txt"));
}
