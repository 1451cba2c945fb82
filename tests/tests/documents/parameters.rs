//! The page on parameters is the shipped parameter file, which a test compares with what the programs declare.

use std::fmt::Write as _;

use formation_tests::root;

use super::files::TextFile;

const PAGE: &str = "docs/parameters.md";
const HEAD: &str = "\
# Parameters

<!-- Written from launch_scripts/config/formation.yaml by
     `FORMATION_UPDATE_DOCUMENTS=1 cargo test -p formation_tests --test all documents::parameters`. -->

Every ROS parameter of the suite. `launch_scripts/config/formation.yaml` has them all with their defaults: copy what you change, and
pass the file to any program with `--ros-args --params-file FILE`. A single one is `--ros-args -p NAME:=VALUE`. `ros2 param describe
NODE NAME` prints range and meaning, and whether a parameter can change at run time.
";

/// The page that belongs to the file.
fn page(file: &str) -> String {
    let mut page = HEAD.to_owned();
    let (_, parameters) = file.split_once("ros__parameters:\n").unwrap();
    let mut group = String::new();
    for section in parameters.split("\n\n") {
        for line in section.lines().filter(|line| !line.trim().is_empty()) {
            let indent = line.len() - line.trim_start().len();
            let line = line.trim();
            if let Some(title) = line.strip_prefix("# ") {
                let (title, note) = title.split_once("; ").unwrap_or((title, ""));
                let _ = write!(page, "\n## {title}\n\n");
                if !note.is_empty() {
                    let note = note[..1].to_uppercase() + &note[1..];
                    let _ = write!(page, "{note}.\n\n");
                }
                page.push_str("| parameter | default | |\n|---|---|---|\n");
                continue;
            }
            let (name, rest) = line.split_once(':').unwrap();
            if rest.is_empty() {
                group = format!("{name}.");
                continue;
            }
            if indent == 4 {
                group.clear();
            }
            let (value, meaning) = rest.split_once('#').unwrap();
            let meaning = meaning.trim().replace('|', "\\|");
            let _ = writeln!(page, "| `{group}{name}` | `{}` | {meaning} |", value.trim());
        }
    }
    page
}

#[test]
fn the_page_on_parameters_has_all_of_the_shipped_file() {
    let file = TextFile::read("launch_scripts/config/formation.yaml");
    let wanted = page(&file.text);
    if std::env::var_os("FORMATION_UPDATE_DOCUMENTS").is_some() {
        std::fs::write(root().join(PAGE), &wanted).unwrap();
    }
    assert!(
        TextFile::read(PAGE).text == wanted,
        "{PAGE} is out of date; its first lines say what writes it"
    );
}
