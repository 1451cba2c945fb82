//! The interface files of the package, for programs that compute type hashes from them.

/// Each file with the name of its interface.
macro_rules! interface_files {
    ($($kind:literal: $($name:ident),+;)+) => {
        &[$($((
            concat!("formation_msgs/", $kind, "/", stringify!($name)),
            include_str!(concat!("../", $kind, "/", stringify!($name), ".", $kind)),
        )),+),+]
    };
}

/// The interfaces of the package: the name of each, such as `formation_msgs/msg/Spot`, and the text of its file.
pub const INTERFACES: &[(&str, &str)] = interface_files! {
    "msg":
        Area, Body, CausalMark, DockingRequest, DockingResult, Edge, Epoch, Eviction, EvictionRecord, Heartbeat,
        ModuleHeartbeat, ModuleState, ModuleStates, OperatorCommand, PlannerParameters, PolicyOption, Progress, QuorumBasis,
        Removal, Roster, RosterMember, Spot, SpotClaim, SpotSelection, Stop, TargetConfiguration, Verdict;
    "srv":
        AddModule, QueryStatus, RemoveModule, RetireModule, StopFormation, WithdrawTarget;
    "action":
        FormConfiguration;
};
