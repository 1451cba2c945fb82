//! One module as a plan sees it.

use std::collections::BTreeSet;

use crate::{ConfigurationId, ModuleId, Pose, SpotId};

/// The data about one module on which planning depends.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct PlanningModule {
    /// The module.
    pub id: ModuleId,
    /// Its pose.
    pub pose: Pose,
    /// The modules to which it is docked. A link counts only if both ends name it.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs. Reports show it; planning goes by the links.
    pub configuration: Option<ConfigurationId>,
    /// The module that it names as its leader.
    pub leader: Option<ModuleId>,
    /// The spot on which it has settled already and stays.
    pub pin: Option<SpotId>,
}
