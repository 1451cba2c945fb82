//! The tutorials as readers type them: every `sh` block of a page, in order, in one shell.

use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};

use formation_tests::{Domain, Python, program, root};

/// The commands of a page: its `sh` blocks. What is built or installed beforehand stands in `console` blocks.
fn commands(page: &str) -> String {
    let mut blocks = Vec::new();
    let mut rest = page;
    while let Some((_, after)) = rest.split_once("\n```sh\n") {
        let (block, after) = after.split_once("\n```").unwrap();
        blocks.push(block);
        rest = after;
    }
    assert!(blocks.len() > 1, "the page has {} blocks", blocks.len());
    blocks.join("\n")
}

/// Types a tutorial in a folder that looks like the clone, and returns what it printed.
fn typed(name: &str, domain: &Domain, python: Option<&Path>) -> String {
    let page = std::fs::read_to_string(root().join("docs/tutorials").join(name)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for shared in ["launch_scripts", "msgs", "tests"] {
        symlink(root().join(shared), folder.path().join(shared)).unwrap();
    }
    let programs = program("formation");
    let mut path = vec![programs.parent().unwrap().to_owned()];
    let of_python = python.and_then(Path::parent);
    path.extend(
        of_python
            .filter(|folder| *folder != Path::new(""))
            .map(Path::to_owned),
    );
    let inherited = std::env::var_os("PATH").unwrap();
    path.extend(std::env::split_paths(&inherited));
    let output = Command::new("bash")
        .args(["-euo", "pipefail", "-c", &commands(&page)])
        .current_dir(folder.path())
        .env("PATH", std::env::join_paths(path).unwrap())
        .env("ROS_DOMAIN_ID", &**domain)
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    let logged = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {printed}\n{logged}");
    printed.into_owned()
}

const COMPLETE: &str = "COMPLETE: all";

#[test]
fn your_first_shape() {
    let printed = typed("first_shape.md", &Domain::for_processes(9), None);
    assert!(printed.contains("corner; 5 modules"), "{printed}");
    assert!(printed.contains(COMPLETE), "{printed}");
    assert!(printed.contains("film: shapes/corner.svg"), "{printed}");
    assert!(printed.contains("status 1: a spot stays open"), "{printed}");
}

#[test]
fn policies_compared() {
    let printed = typed("policies.md", &Domain::for_processes(1), None);
    let page = std::fs::read_to_string(root().join("docs/tutorials/policies.md")).unwrap();
    // The page promises an order, and that the exact planner reaches the optimum of single modules.
    let number = |policy: &str, key: &str, from: usize| -> f64 {
        let mut lines = printed.lines().filter(|line| line.starts_with(policy));
        let line = lines.nth(from).unwrap();
        let (_, after) = line.split_once(&format!("\"{key}\":")).unwrap();
        after.split(' ').next().unwrap().parse().unwrap()
    };
    let broken = |policy| number(policy, "broken_links", 0);
    assert!(broken("exact") < broken("paper") && broken("paper") < broken("hungarian"));
    for policy in ["exact", "paper", "auction", "hungarian"] {
        let row = format!("| `{policy}` | {} |", broken(policy));
        assert!(page.contains(&row), "the page lacks {row}");
    }
    let utility = |policy| number(policy, "total_utility", 1);
    let difference: f64 = utility("exact:") - utility("hungarian:");
    assert!(difference.abs() < 1e-6, "{printed}");
}

#[test]
fn six_robots() {
    let Some(python) = Python::find() else {
        return;
    };
    let printed = typed(
        "six_robots.md",
        &Domain::for_processes(10),
        Some(python.path()),
    );
    assert_eq!(printed.matches(COMPLETE).count(), 3, "{printed}");
    assert!(printed.contains("status 1"), "{printed}");
}

#[test]
fn a_class() {
    let printed = typed("class.md", &Domain::for_processes(6), None);
    assert_eq!(printed.matches(COMPLETE).count(), 2, "{printed}");
    assert_eq!(printed.matches("d_max ").count(), 4, "{printed}");
    assert!(printed.contains("\"folding\""), "{printed}");
}
