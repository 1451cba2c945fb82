//! Scenario files that last as long as a test.

use std::path::PathBuf;

/// A scenario file of this test run, removed with this value.
pub struct ScenarioFile(PathBuf);

impl ScenarioFile {
    /// Writes `text` under a name that no other test run uses.
    #[must_use]
    pub fn new(name: &str, text: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("formation-{}-{name}.yaml", std::process::id()));
        std::fs::write(&path, text).unwrap();
        Self(path)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for ScenarioFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
