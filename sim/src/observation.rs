//! What happens in a cluster, for transcripts and checks.

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{Digest, Epoch, Message, ModuleId, Pose, TargetAnnouncement};
use formation_protocol::Event;

use crate::faults::Fault;

/// An event, for transcripts and checks.
#[derive(Clone, Debug)]
pub enum Observation {
    /// A module published a message.
    Published(ModuleId, Message),
    /// An agent noted an event.
    Noted(ModuleId, Event),
    /// A drive received a goal of this plan. Its module may have left the plan by the time this is read.
    SetOff(ModuleId, Option<(Epoch, Digest)>),
    /// A drive stands or moves here. Between two of these it moves evenly.
    Stands(ModuleId, Pose),
    /// An outside hand has put the module here.
    Carried(ModuleId, Pose),
    /// An outside hand has torn a module off this docked part.
    Torn(BTreeSet<ModuleId>),
    /// The publisher of the target announced this.
    Announced(Arc<TargetAnnouncement>),
    /// A participant that is no module published a message.
    Injected(Message),
    /// A fault occurred, or ended.
    Fault(Fault),
}
