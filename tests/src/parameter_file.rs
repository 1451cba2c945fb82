//! The file of all parameters with their defaults, which ships with the suite.

use crate::programs::root;

/// A parameter file that has some sections of the shipped one: those below the comments which begin with `titles`.
#[must_use]
pub fn parameter_section(titles: &[&str]) -> String {
    let path = root().join("launch_scripts/config/formation.yaml");
    let text = std::fs::read_to_string(path).unwrap();
    let sections = titles.iter().map(|title| {
        let (_, below) = text.split_once(&format!("    # {title}")).unwrap();
        let section = below.split("\n\n").next().unwrap();
        let (_, lines) = section.split_once('\n').unwrap();
        lines
    });
    let lines: Vec<&str> = sections.collect();
    format!("/**:\n  ros__parameters:\n{}\n", lines.join("\n"))
}
