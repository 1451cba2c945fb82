//! A peer over Zenoh built on hiroz, an independent implementation.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use crate::programs::{root, target_directory};
use crate::tools::{Tool, tool_or_skip};

/// The package of the peer, as seen from the root of the repository.
const PACKAGE: &str = "tests/hiroz_peer";

/// The program of `tests/hiroz_peer`.
pub struct HirozPeer {
    path: PathBuf,
}

impl HirozPeer {
    /// The program that cargo built, be it in the target directory of the peer or, where `CARGO_TARGET_DIR` names one for both, in
    /// that of these tests. `None`, after a line that says so, where it is not built.
    ///
    /// # Panics
    /// When it is missing and `FORMATION_REQUIRE_TOOLS` names it.
    #[must_use]
    pub fn find() -> Option<Self> {
        let built = [root().join(PACKAGE).join("target"), target_directory()];
        let built = built.map(|folder| folder.join("debug/hiroz_peer"));
        let found = built.into_iter().find(|place| place.is_file());
        let found = found.ok_or_else(|| "the peer on hiroz is not built".to_owned());
        tool_or_skip(Tool::Hiroz, found).map(|path| Self { path })
    }

    /// Starts it, with its output piped.
    #[must_use]
    pub fn start(&self, arguments: &[&str]) -> Child {
        Command::new(&self.path)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap()
    }
}
