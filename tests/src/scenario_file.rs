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

/// Eight spots for eight modules; modules 1, 2 and 3 are docked and led by 2.
pub const EIGHT: &str = "
name: eight
target:
  frame_id: map
  spots:
    - {id: 1, x: 5, y: 5}
    - {id: 2, x: 6, y: 5}
    - {id: 3, x: 7, y: 5}
    - {id: 4, x: 8, y: 5}
    - {id: 5, x: 5, y: 6}
    - {id: 6, x: 6, y: 6}
    - {id: 7, x: 7, y: 6}
    - {id: 8, x: 8, y: 6}
  edges: [[1, 2], [2, 3], [3, 4], [1, 5], [2, 6], [3, 7], [4, 8]]
configurations:
  - id: 1
    leader: 2
    modules: [{id: 1, x: 1, y: 1}, {id: 2, x: 2, y: 1}, {id: 3, x: 3, y: 1}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 9, y: 2}
  - {id: 5, x: 2, y: 9, theta: 1.0}
  - {id: 6, x: 9, y: 9}
  - {id: 7, x: 6, y: 2}
  - {id: 8, x: 4, y: 3}
";
