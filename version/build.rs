//! Finds the commit that a release build is made of. Other builds do not name it, so that a commit does not have all
//! programs rebuilt while they are developed.

use std::env;
use std::path::Path;
use std::process::Command;

/// The output of git, if it is installed and this is a repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let text = text.trim();
    (output.status.success() && !text.is_empty()).then(|| text.to_owned())
}

fn commit() -> Option<String> {
    // Both change with a commit or a checkout; a clone may lack the second.
    for file in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", file])?;
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    git(&["rev-parse", "--short=10", "HEAD"])
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let is_release = env::var("PROFILE").is_ok_and(|profile| profile == "release");
    match is_release.then(commit).flatten() {
        Some(commit) => println!("cargo::rustc-env=FORMATION_VERSION={version} ({commit})"),
        None => println!("cargo::rustc-env=FORMATION_VERSION={version}"),
    }
}
