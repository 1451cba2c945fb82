use std::fs;
use std::path::PathBuf;

use formation_model::Scenario;
use tempfile::TempDir;

use super::*;

fn options() -> ImportOptions {
    ImportOptions {
        module_size: 1.0,
        modules: None,
        seed: 0,
        unknown_is_free: false,
    }
}

fn imported_file(path: &Path, options: &ImportOptions) -> Result<String, ImportError> {
    import(path, &fs::read_to_string(path).unwrap(), options)
}

/// A map of 4 by 3 pixels of half a metre: a black wall on the left, one unknown pixel at the top right.
fn occupancy_map(yaml: &str) -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let pixels = [0, 254, 254, 205, 0, 254, 254, 254, 0, 254, 254, 254];
    let mut image = b"P5\n# saved\n4 3\n255\n".to_vec();
    image.extend(pixels);
    fs::write(directory.path().join("floor.pgm"), image).unwrap();
    let path = directory.path().join("floor.yaml");
    fs::write(&path, yaml).unwrap();
    (directory, path)
}

const FLOOR: &str = "image: floor.pgm\nresolution: 0.5\norigin: [-0.25, -0.25, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n";

#[test]
fn walls_of_an_occupancy_map_are_those_of_a_scenario() {
    let (_directory, path) = occupancy_map(FLOOR);
    let half = ImportOptions {
        module_size: 0.5,
        ..options()
    };
    let text = imported_file(&path, &half).unwrap();
    assert_eq!(
        text,
        "module_size: 0.5\nobstacles:\n  - {x: 0.0, y: 0.0, width: 1, height: 1}\n  - {x: 0.0, y: 1.0, width: 1, height: 1}\n  \
         - {x: 0.0, y: 2.0, width: 1, height: 1}\n  - {x: 3.0, y: 2.0, width: 1, height: 1}\narena: {x: 1.5, y: 1.0, width: 4, height: 3}\n"
    );
    let known = ImportOptions {
        unknown_is_free: true,
        ..half
    };
    assert!(!imported_file(&path, &known).unwrap().contains("x: 3.0"));
    let scenario = format!(
        "target: {{spots: [{{id: 1, x: 1, y: 0}}]}}\nsingletons: [{{id: 1, x: 2, y: 2}}]\n{text}"
    );
    let scenario = Scenario::from_yaml(&scenario).unwrap();
    let obstacles = scenario.problem().target().surroundings().obstacles();
    assert_eq!(obstacles.len(), 2, "the wall is one rectangle");
}

/// Modules of two pixels: each cell into which an occupied pixel reaches is closed.
#[test]
fn a_pixel_closes_each_cell_that_it_reaches_into() {
    let (_directory, path) =
        occupancy_map(&FLOOR.replace("[-0.25, -0.25, 0.0]", "[0.25, -0.5, 0]"));
    let text = imported_file(&path, &options()).unwrap();
    // The image covers x 0.25 to 2.25 and y -0.5 to 1.0: one whole cell, from x 0.5 to 1.5, which the wall reaches by a quarter.
    assert_eq!(
        text,
        "module_size: 1.0\nobstacles:\n  - {x: 1.0, y: 0.0, width: 1, height: 1}\narena: {x: 1.0, y: 0.0, width: 1, height: 1}\n"
    );
}

#[test]
fn what_is_wrong_with_a_map_is_named() {
    for (change, expected) in [
        (
            ("resolution: 0.5", "resolution: 0"),
            "resolution: must be a positive number of metres, got 0",
        ),
        (
            ("0.25, 0.0]", "0.25, 0.3]"),
            "origin: the map is turned by 0.3; only maps along the axes of their frame can be read",
        ),
        (("floor.pgm", "none.pgm"), "image none.pgm: "),
        (
            ("resolution: 0.5\n", ""),
            "is no map of ROS 2: missing field `resolution`",
        ),
        (
            ("floor.pgm", "floor.yaml"),
            "image floor.yaml: is neither PGM nor PNG",
        ),
    ] {
        let (_directory, path) = occupancy_map(&FLOOR.replace(change.0, change.1));
        let error = format!("{:#}", imported_file(&path, &options()).unwrap_err());
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn a_scenario_is_drawn_between_the_walls_of_a_benchmark() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("ring.map");
    fs::write(
        &path,
        "type octile\nheight 4\nwidth 6\nmap\n......\n.@@@@.\n.@@@@.\n......\n",
    )
    .unwrap();
    let wanted = ImportOptions {
        modules: Some(8),
        seed: 3,
        ..options()
    };
    let text = imported_file(&path, &wanted).unwrap();
    let scenario = Scenario::from_yaml(&text).unwrap();
    assert_eq!(scenario.name(), "ring_8_3");
    assert_eq!(scenario.problem().modules().len(), 8);
    let surroundings = scenario.problem().target().surroundings();
    assert_eq!(
        (
            surroundings.obstacles().len(),
            surroundings.arena().is_some()
        ),
        (1, true)
    );
    let too_many = ImportOptions {
        modules: Some(9),
        ..wanted
    };
    assert_eq!(
        imported_file(&path, &too_many).unwrap_err().to_string(),
        "--modules 9: the largest connected part of the 16 free cells has no room for as many spots and modules"
    );
}

/// Robots on three cells in a row, of which the last crosses over; the targets are in two parts.
const INSTANCE: &str = r#"{"meta": {"number_of_robots": 3}, "name": "crossing", "starts": [[0, 0], [1, 0], [2, 0]],
    "targets": [[0, 2], [1, 2], [-3, 0]], "obstacles": [[2, 1], [1, 1], [-1, -4]]}"#;

fn instance(text: &str) -> Result<String, ImportError> {
    import(Path::new("file.instance.json"), text, &options())
}

#[test]
fn robots_of_an_instance_are_modules_with_given_spots() {
    let text = instance(INSTANCE).unwrap();
    let scenario = Scenario::from_yaml(&text).unwrap();
    assert_eq!(scenario.name(), "crossing");
    let target = scenario.problem().target();
    assert_eq!(target.topology().components().len(), 2);
    let given = target.given().unwrap().assignments();
    assert!(given.into_iter().all(|one| one.module.0 == one.spot.0));
    assert_eq!(target.surroundings().obstacles().len(), 2, "a run is one");
    assert!(scenario.check_formable().is_err());
    let nameless = INSTANCE.replace(r#""name": "crossing", "#, "");
    assert!(instance(&nameless).unwrap().starts_with("name: \"file\"\n"));
    let joined = instance(&INSTANCE.replace("[-3, 0]", "[2, 2]")).unwrap();
    assert!(!joined.contains("in_parts"));
    assert!(
        Scenario::from_yaml(&joined)
            .unwrap()
            .check_formable()
            .is_ok()
    );
}

#[test]
fn what_is_wrong_with_an_instance_is_named() {
    for (from, to, expected) in [
        ("[0, 2], ", "", "has 3 starts and 2 targets"),
        (
            "[1, 2]",
            "[0, 2]",
            "targets[1]: [0, 2] is targets[0] already",
        ),
        ("[1, 0]", "[1, 1]", "starts[1]: [1, 1] is an obstacle"),
        (
            "[-3, 0]",
            "[-3000000, 0]",
            "targets[2]: [-3000000, 0] is further than 100000 from the origin",
        ),
        (
            "[-3, 0]",
            "[0.5, 0]",
            "is no instance of CG:SHOP 2021: invalid type: floating point",
        ),
        (
            "obstacles",
            "walls",
            "is no instance of CG:SHOP 2021: missing field `obstacles`",
        ),
    ] {
        let error = instance(&INSTANCE.replace(from, to)).unwrap_err();
        assert!(error.to_string().starts_with(expected), "{error}");
    }
    let empty = r#"{"starts": [], "targets": [], "obstacles": []}"#;
    assert_eq!(instance(empty).unwrap_err().to_string(), "has no robots");
    let with_modules = ImportOptions {
        modules: Some(3),
        ..options()
    };
    let error = import(Path::new("file.json"), INSTANCE, &with_modules).unwrap_err();
    assert_eq!(
        error.to_string(),
        "--modules: an instance has robots of its own"
    );
}

#[test]
fn a_plan_is_a_solution_where_it_goes_from_cell_to_cell() {
    let plan = |text: &str| {
        let scenario = Scenario::from_yaml(text).unwrap();
        let problem = std::sync::Arc::new(scenario.problem().clone());
        crate::CheckedPlan::of_problem(problem).unwrap()
    };
    let text = instance(INSTANCE).unwrap();
    let solution = crate::CgshopSolution::of("crossing", &plan(&text)).unwrap();
    let mut at = [(0_i64, 0_i64), (1, 0), (2, 0)];
    for step in &solution.steps {
        assert!(!step.is_empty());
        for (&robot, &direction) in step {
            let cell = &mut at[robot as usize];
            match direction {
                "N" => cell.1 += 1,
                "S" => cell.1 -= 1,
                "E" => cell.0 += 1,
                _ => cell.0 -= 1,
            }
        }
    }
    assert_eq!(at, [(0, 2), (1, 2), (-3, 0)]);
    let turned = text.replace(
        "{id: 0, x: 0.0, y: 0.0, theta: 0.0}",
        "{id: 0, x: 0.0, y: 0.0, theta: 0.2}",
    );
    assert_ne!(turned, text);
    let refused = crate::CgshopSolution::of("crossing", &plan(&turned)).unwrap_err();
    assert!(
        refused
            .to_string()
            .starts_with("the plan is no solution of CG:SHOP: "),
        "{refused}"
    );
}
