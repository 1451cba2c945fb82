//! Copies the sources of the protocol, and applies `bugs.patch` to the copy.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs, io};

const PROTOCOL: &str = "../../../core/protocol/src";
const PATCH: &str = "bugs.patch";
const MUTATIONS: &str = "mutation.rs";

fn main() -> ExitCode {
    let outcome = spoil();
    if let Err(error) = &outcome {
        eprintln!("error: {error}");
    }
    ExitCode::from(u8::from(outcome.is_err()))
}

fn spoil() -> Result<(), Box<dyn Error>> {
    for input in [PROTOCOL, PATCH, MUTATIONS] {
        println!("cargo:rerun-if-changed={input}");
    }
    let copy = PathBuf::from(env::var("OUT_DIR")?).join("protocol");
    if copy.exists() {
        fs::remove_dir_all(&copy)?;
    }
    copy_folder(Path::new(PROTOCOL), &copy)?;
    fs::copy(MUTATIONS, copy.join(MUTATIONS))?;
    let patch = fs::read_to_string(PATCH)?;
    for part in patch.split("--- a/core/protocol/src/").skip(1) {
        let (name, rest) = part.split_once('\n').ok_or("a file without hunks")?;
        let path = copy.join(name);
        let mut text = fs::read_to_string(&path)?;
        for hunk in rest.split("\n@@ ").skip(1) {
            text = spoiled(&text, hunk).map_err(|lines| {
                format!(
                    "core/protocol/src/{name} must have these lines exactly once, for a deliberate bug in \
                     sim/with_bugs/protocol/{PATCH}; adjust the patch:\n{lines}"
                )
            })?;
        }
        fs::write(path, text)?;
    }
    // Documentation of a whole file may not stand in one that is included.
    let root = copy.join("lib.rs");
    let text = fs::read_to_string(&root)?.replace("//!", "//");
    fs::write(root, text)?;
    Ok(())
}

fn copy_folder(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            copy_folder(&from, &to)?;
        } else {
            fs::copy(from, to)?;
        }
    }
    Ok(())
}

/// The text with one hunk of a unified diff, found by its lines and not by their numbers or indentation, so that other changes
/// of the protocol leave the patch valid. Fails with the lines if they are not there exactly once.
fn spoiled(text: &str, hunk: &str) -> Result<String, String> {
    let lines = hunk.lines().skip(1);
    let kept = |without: char| -> Vec<&str> {
        let lines = lines.clone().filter(|line| !line.starts_with(without));
        lines
            .map(|line| line.get(1..).unwrap_or_default())
            .collect()
    };
    let (sound, spoiled) = (kept('+'), kept('-'));
    let all: Vec<&str> = text.lines().collect();
    let is_same = |(one, other): (&&str, &&str)| one.trim() == other.trim();
    let mut places = all
        .windows(sound.len())
        .enumerate()
        .filter(|(_, window)| window.iter().zip(&sound).all(is_same))
        .map(|(place, _)| place);
    let (Some(place), None) = (places.next(), places.next()) else {
        return Err(sound.join("\n"));
    };
    let (before, rest) = all.split_at(place);
    let after = &rest[sound.len()..];
    Ok([before, &spoiled, after].concat().join("\n") + "\n")
}
