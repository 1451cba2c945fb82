//! The session of the modules: who votes in it, and where they keep what they agreed on.

use formation_model::ModuleId;
use formation_node_support::ModuleList;
use ros_runtime::parameters::{Tunable, Tunables, switch, text};

/// The session of the modules: who votes in it, and where they keep what they agreed on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StoreOptions {
    /// The voters of the session, such as `1-25`; `None` if the first target names them.
    pub voters: Option<String>,
    /// The directory of the stores; `None` if what modules agreed on ends with their process.
    pub state_dir: Option<String>,
    /// Whether no module of the session has taken part before the stores were made.
    pub new_session: bool,
}

impl Tunables for StoreOptions {
    const HEADING: &'static str = "StoreOptions";

    fn table() -> Vec<Tunable<Self>> {
        vec![
            Tunable::new(
                "voters",
                text("LIST"),
                |own: &mut Self| &mut own.voters,
                "The modules that vote in this session, such as 1-25 or 1,4,7-9: nothing moves without more than half of them; \
                 without it, the first target that names voters decides",
            )
            .at_start("voters belong to a session; begin another for others"),
            Tunable::new(
                "state_dir",
                text("DIR"),
                |own: &mut Self| &mut own.state_dir,
                "Directory on a local disk, which processes may share: each keeps a file there of what its modules agreed on, \
                 with which they count and continue after a restart; without it, that ends with the process",
            )
            .at_start("the modules continue from it when their process starts"),
            Tunable::new(
                "new_session",
                switch(),
                |own: &mut Self| &mut own.new_session,
                "Nothing was agreed in this session before its stores were made, so that modules without a file have forgotten nothing; \
                 needs --state-dir",
            )
            .at_start("it says what happened before the process started"),
        ]
    }
}

impl StoreOptions {
    /// The voters of the session, ascending; empty if none are named.
    ///
    /// # Errors
    /// They are no list of modules, or nothing tells a first start from a later one.
    pub fn checked_voters(&self) -> Result<Vec<ModuleId>, String> {
        if self.new_session && self.state_dir.is_none() {
            return Err("--new-session needs --state-dir: without a file, a restart looks like a first start".to_owned());
        }
        let Some(voters) = &self.voters else {
            return Ok(Vec::new());
        };
        let list: ModuleList = voters
            .parse()
            .map_err(|reason| format!("--voters: {reason}"))?;
        Ok(list.modules().to_vec())
    }
}
