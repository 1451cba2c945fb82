//! The parameters of an observer.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{MicroUnits, ModuleId};

/// The tolerances and limits of an observer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObserverParameters {
    /// The greatest distance of a settled module from its spot, in micro-units. Between the ends of two steps, docked modules may
    /// be off their places to each other by twice as much, or by the clearance if that is more.
    pub position_tolerance: MicroUnits,
    /// The greatest difference of its heading, in micro-radians.
    pub heading_tolerance: MicroUnits,
    /// A formation that is not done within this time has failed. The time counts from the announcement of a target with new
    /// content, or from the observer's start while there is no target.
    pub time_limit: Duration,
    /// The time that an end state with violations has to become right, since messages that prove it can be delayed, such as those of a
    /// module that seems to be run into. An end state with fewer modules than expected waits as long for more of them.
    pub grace: Duration,
    /// A member that is silent for longer than this does not count as living, so no formation with it is done.
    pub silence: Duration,
    /// The greatest difference between the clocks of two processes.
    pub clock_error: Duration,
    /// The modules that are to take part, if known beforehand, so that absent ones can be named.
    pub expected: BTreeSet<ModuleId>,
}

impl Default for ObserverParameters {
    fn default() -> Self {
        Self {
            position_tolerance: MicroUnits(50_000),
            heading_tolerance: MicroUnits(50_000),
            time_limit: Duration::from_secs(120),
            grace: Duration::from_secs(3),
            silence: Duration::from_secs(5),
            clock_error: Duration::from_millis(50),
            expected: BTreeSet::new(),
        }
    }
}
