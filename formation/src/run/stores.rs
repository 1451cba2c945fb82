//! The session of a run, and where its modules keep what they agreed on.

use std::path::PathBuf;

use anyhow::{Context, anyhow};
use ros_runtime::exit::Failure;
use tempfile::TempDir;

use crate::arguments::RunArguments;
use crate::console;

/// The session of a run, and the directory of its stores.
pub struct RunStores {
    pub session: u32,
    /// Whether the session was drawn, so that nothing was agreed in it before.
    pub is_new_session: bool,
    pub directory: PathBuf,
    /// Deleted with this value; `None` if the user keeps the stores.
    _temporary: Option<TempDir>,
}

impl RunStores {
    /// The session and the directory that the user chose, or else a random session and an empty directory, which ends with
    /// the run.
    ///
    /// # Errors
    /// No directory can be created, or the operating system gives no random number.
    pub fn prepare(arguments: &RunArguments) -> Result<Self, Failure> {
        let session = match arguments.session {
            Some(session) => session,
            None => {
                let drawn = getrandom::u32().map_err(|error| {
                    Failure::Failed(anyhow!(error).context("cannot draw a session"))
                })?;
                // 0 is the session of nodes that are given none.
                let session = drawn.max(1);
                console::note(&format!("session {session}"));
                session
            }
        };
        let (directory, temporary) = match &arguments.state_dir {
            Some(kept) => (kept.clone(), None),
            None => {
                let temporary = tempfile::Builder::new()
                    .prefix("formation-run-")
                    .tempdir()
                    .context("cannot create a directory for the stores of the run")
                    .map_err(Failure::Failed)?;
                (temporary.path().to_owned(), Some(temporary))
            }
        };
        Ok(Self {
            session,
            is_new_session: arguments.session.is_none(),
            directory,
            _temporary: temporary,
        })
    }
}
