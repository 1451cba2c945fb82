//! Where modules keep what they agreed on.

use ros_runtime::parameters::{Tunable, Tunables, text};

/// Where modules keep what they agreed on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StoreOptions {
    /// The directory of the stores; `None` if what modules agree on ends with their process.
    pub state_dir: Option<String>,
}

impl Tunables for StoreOptions {
    const HEADING: &'static str = "StoreOptions";

    fn table() -> Vec<Tunable<Self>> {
        vec![
            Tunable::new(
                "state_dir",
                text("DIR"),
                |own: &mut Self| &mut own.state_dir,
                "Directory on a local disk, which processes may share: each keeps a file there of what its modules agreed on, \
                 with which they count and continue after a restart; without it, that ends with the process",
            )
            .at_start("the modules continue from it when their process starts"),
        ]
    }
}
