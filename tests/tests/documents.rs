//! What the documents say of tests is true of the tests that there are.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::fs;

use formation_tests::root;

/// The `file::test` references of a document.
fn references(text: &str) -> Vec<(&str, &str)> {
    text.split('`')
        .skip(1)
        .step_by(2)
        .filter_map(|quoted| quoted.split_once("::"))
        .filter(|(file, _)| file.ends_with(".rs"))
        .collect()
}

#[test]
fn every_test_that_the_fault_model_names_exists() {
    let text = fs::read_to_string(root().join("docs/fault_model.md")).unwrap();
    let references = references(&text);
    assert!(references.len() > 20, "found {}", references.len());
    for (file, test) in references {
        let source = fs::read_to_string(root().join(file))
            .unwrap_or_else(|error| panic!("docs/fault_model.md names {file}: {error}"));
        let header = format!("fn {test}(");
        let found = source.split("#[test]").skip(1).any(|rest| {
            let function = rest
                .lines()
                .find(|line| line.trim_start().starts_with("fn "));
            function.is_some_and(|line| line.contains(&header))
        });
        assert!(
            found,
            "docs/fault_model.md names {file}::{test}, which is no test"
        );
    }
}
