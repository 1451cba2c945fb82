//! The file of all parameters with their defaults, which ships with the suite.

use crate::programs::root;

/// A parameter file that has one section of the shipped one alone: that below the comment which begins with `title`.
#[must_use]
pub fn parameter_section(title: &str) -> String {
    let path = root().join("launch_scripts/config/formation.yaml");
    let text = std::fs::read_to_string(path).unwrap();
    let (_, below) = text.split_once(&format!("    # {title}")).unwrap();
    let section = below.split("\n\n").next().unwrap();
    let (_, lines) = section.split_once('\n').unwrap();
    format!("/**:\n  ros__parameters:\n{lines}\n")
}
