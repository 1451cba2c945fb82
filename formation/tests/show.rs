//! `formation show` and `formation schema`.

use std::process::{Command, Output};

use formation_model::Scenario;
use serde_json::Value;

fn formation(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(arguments)
        .output()
        .unwrap()
}

fn scenarios() -> Vec<std::path::PathBuf> {
    let folder = formation_tests::root().join("launch_scripts/scenarios");
    let files = std::fs::read_dir(folder).unwrap();
    let files = files.map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|end| end == "yaml"))
        .collect()
}

#[test]
fn a_drawn_scenario_is_a_scenario_file_with_the_same_problem() {
    let text = "name: drawn\ntarget: {map: \"o-o\\n|\\no\\n\"}\nmodules: {origin: [5, 1], map: \"A-A s\"}\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drawn.yaml");
    std::fs::write(&file, text).unwrap();
    let shown = formation(&["show", file.to_str().unwrap()]);
    assert!(shown.status.success());
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(
        shown.contains("  map: |\n    o-o\n    |\n    o\n"),
        "{shown}"
    );
    let again = Scenario::from_yaml(&shown).unwrap();
    assert_eq!(again, Scenario::from_yaml(text).unwrap());
}

#[test]
fn a_map_may_begin_further_in_and_a_name_may_need_quotes() {
    let text = "name: \"fleet: the first\"\ntarget: {map: \"    o\\n    |\\no-o-o\\n\", frame_id: hall}\n\
                modules: {origin: [5, 1], map: \"A-A s\"}\nplanner: {d_max: 3}\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drawn.yaml");
    std::fs::write(&file, text).unwrap();
    let shown = formation(&["show", file.to_str().unwrap()]);
    let notes = String::from_utf8(shown.stderr).unwrap();
    assert!(notes.contains("planner, frame_id"), "{notes}");
    let again = Scenario::from_yaml(&String::from_utf8(shown.stdout).unwrap()).unwrap();
    assert_eq!(again.name(), "fleet: the first");
    let first = Scenario::from_yaml(text).unwrap();
    let [first, again] = [&first, &again].map(|one| one.problem().target().spots());
    assert_eq!(first, again);
}

#[test]
fn what_stands_off_the_lattice_is_named_and_drawn_as_svg() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("off.yaml");
    std::fs::write(
        &file,
        "{target: {map: 'o'}, singletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 1.5, y: 0}]}",
    )
    .unwrap();
    let file = file.to_str().unwrap();
    let refused = formation(&["show", file]);
    assert_eq!(refused.status.code(), Some(2));
    let error = String::from_utf8(refused.stderr).unwrap();
    assert!(
        error.contains("module 2 stands off the lattice of module 1"),
        "{error}"
    );
    let drawn = formation(&["show", file, "--svg"]);
    assert!(drawn.status.success());
    assert!(drawn.stdout.starts_with(b"<svg"));
}

/// Whether a value has only what the schema allows, as far as objects, lists and choices go.
fn check(schema: &Value, root: &Value, value: &Value, at: &str) {
    if let Some(name) = schema["$ref"].as_str() {
        let pointer = name.strip_prefix('#').unwrap();
        return check(root.pointer(pointer).unwrap(), root, value, at);
    }
    match value {
        Value::Object(fields) => {
            for (name, field) in fields {
                let known = &schema["properties"][name];
                assert!(known.is_object(), "{at}.{name} is not in the schema");
                check(known, root, field, &format!("{at}.{name}"));
            }
            for required in schema["required"].as_array().into_iter().flatten() {
                assert!(
                    fields.contains_key(required.as_str().unwrap()),
                    "{at} lacks {required}"
                );
            }
        }
        Value::Array(items) => {
            for item in items {
                check(&schema["items"], root, item, at);
            }
        }
        other => {
            let choices = schema["enum"].as_array();
            assert!(
                choices.is_none_or(|choices| choices.contains(other)),
                "{at}: {other}"
            );
        }
    }
}

#[test]
fn the_schema_knows_every_field_of_the_scenarios_and_of_the_reader() {
    let printed = formation(&["schema"]);
    let schema: Value = serde_json::from_slice(&printed.stdout).unwrap();
    for path in scenarios() {
        let text = std::fs::read_to_string(&path).unwrap();
        let value: Value = serde_yaml::from_str(&text).unwrap();
        check(&schema, &schema, &value, &path.display().to_string());
        if value["target"]["map"].is_string() {
            continue;
        }
        let raw: formation_model::RawScenario = serde_yaml::from_str(&text).unwrap();
        let all_fields = serde_json::to_value(&raw).unwrap();
        check(&schema, &schema, &all_fields, "all fields");
    }
    // A field that the schema has is one that the reader takes.
    for (section, fields) in [("target", "map"), ("modules", "map")] {
        for name in schema["properties"][section]["properties"]
            .as_object()
            .unwrap()
            .keys()
        {
            let text = format!("target: {{{fields}: 'o'}}\n{section}: {{{name}: {{}}}}");
            let error = Scenario::from_yaml(&text).unwrap_err().to_string();
            assert!(
                !error.contains("unknown field"),
                "{section}.{name}: {error}"
            );
        }
    }
}
