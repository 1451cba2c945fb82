//! The manual in the documents is the program's own.

use std::fs;
use std::process::{Command, Output};

fn manual(argument: &str) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["manual", argument])
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    output
}

#[test]
fn the_page_on_the_command_line_is_what_the_program_says() {
    let printed = String::from_utf8(manual("--markdown").stdout).unwrap();
    let page = formation_tests::root().join("docs/command_line.md");
    if std::env::var_os("FORMATION_UPDATE_DOCUMENTS").is_some() {
        fs::write(&page, &printed).unwrap();
    }
    let written = fs::read_to_string(&page).unwrap();
    assert!(
        written == printed,
        "docs/command_line.md is out of date; `formation manual --markdown >docs/command_line.md` writes it"
    );
}

#[test]
fn each_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    manual(folder.path().to_str().unwrap());
    for page in [
        "formation.1",
        "formation-run.1",
        "formation-security-create.1",
    ] {
        let text = fs::read_to_string(folder.path().join(page)).unwrap();
        assert!(text.contains(".SH NAME"), "{page}: {text}");
    }
}
