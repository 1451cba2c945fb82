//! Runs of the experiments with a stand-in for the launcher.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use formation_experiments::{ExperimentError, ExperimentSettings, ProgressSink, Work, run};

/// Goes on for a number of cells, and remembers how the work began.
pub struct Stopwatch {
    cells_left: usize,
    pub work: Option<Work>,
    pub measured: usize,
}

impl Stopwatch {
    pub fn stopping_after(cells: usize) -> Self {
        Self {
            cells_left: cells,
            work: None,
            measured: 0,
        }
    }

    pub fn never_stopping() -> Self {
        Self::stopping_after(usize::MAX)
    }
}

impl ProgressSink for Stopwatch {
    fn begin(&mut self, work: Work) {
        self.work = Some(work);
    }

    fn cell(&mut self, label: &str) {
        assert!(!label.is_empty());
    }

    fn finished(&mut self, cost: u64) {
        assert!(cost > 0);
        self.measured += 1;
        // Workers finish what they are at after the stop.
        self.cells_left = self.cells_left.saturating_sub(1);
    }

    fn goes_on(&self) -> bool {
        self.cells_left > 0
    }
}

/// A stand-in for the program `formation`, as real processes have tests of their own.
pub fn launcher(directory: &Path, script: &str) -> PathBuf {
    let path = directory.join("launcher");
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

pub const REPORT: &str = r#"
grep -q '"spots"' "$2" || exit 2
case "$1 $3 $*" in
"run --json "*" --plan-only")
    echo '{"verdict": "AGREED", "planning_ms": 12, "discovery_ms": 34, "planning_us": 56, "more": 1}' ;;
"run --json "*" --world"*)
    echo '{"verdict": "COMPLETE", "acting_ms": 4000, "assignments": [1, 2], "open_spots": [],
        "world": {"contacts": 1, "contacts_above_touch": 0, "more": 1}}' ;;
*)
    echo "odd arguments: $*" >&2
    exit 2 ;;
esac"#;

pub fn finish(
    out: &Path,
    settings: &ExperimentSettings,
    only: &[&str],
) -> Result<Stopwatch, ExperimentError> {
    let home = tempfile::tempdir().unwrap();
    let launcher = launcher(home.path(), REPORT);
    let only: Vec<String> = only.iter().map(|&name| name.to_owned()).collect();
    let mut progress = Stopwatch::never_stopping();
    run(out, settings, &only, &launcher, &mut progress).map(|()| progress)
}
