//! Deliberate protocol bugs, by which the simulator shows that it would find real ones.
//!
//! Without the cargo feature `mutations`, which only the tests of `formation_sim` ask for, no agent can be given one:
//! [`Switch::is`] is then a constant `false`, and the compiler removes every branch that asks. Building the whole
//! workspace's tests turns the feature on for all crates at once, as cargo unifies features; even then nothing changes
//! unless a test calls `Agent::mutated`, which no program does.

/// One bug.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Mutation {
    /// Follows rosters of epochs that are over.
    AcceptStaleEpoch,
    /// Counts everybody as agreed without looking at digests.
    SkipDigestBarrier,
    /// Sets off as soon as all agree.
    SkipLeaseWait,
    /// Goes on moving when members are no longer heard to agree.
    IgnoreLapse,
    /// Takes a restarted process for the one that it knew.
    DropIncarnationCheck,
    /// Applies claims that differ from its own recomputation.
    AcceptWithoutRecomputation,
    /// Notes claims in the order in which they arrive.
    ApplyOutOfTurn,
    /// Needs no majority of earlier rosters.
    IgnoreQuorum,
    /// Counts a module that was started anew as if it remembered what it agreed on.
    CountForgetful,
    /// Moves without waiting for earlier units.
    MoveOutOfOrder,
    /// Forgets the spot on which it has settled.
    ForgetPins,
    /// Freezes with the spot of whatever target it knows.
    PinForAnyTarget,
    /// Plans as if nobody were docked, and so evicts members of configurations.
    EvictConfigurationMember,
    /// Takes everybody that was ever heard for living.
    CountDeadAsAlive,
    /// Takes heartbeats that lay in a buffer for fresh ones.
    TrustBufferedHeartbeats,
    /// Holds another plan than it should, as a module of another build might.
    DifferentPlan,
    /// Never asks whoever came late to fill an open spot.
    IgnoreNewcomers,
}

/// Which bug an agent has; none, outside of tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Switch {
    #[cfg(feature = "mutations")]
    pub(super) chosen: Option<Mutation>,
}

impl Switch {
    /// Whether the agent has this bug.
    #[cfg(feature = "mutations")]
    pub(super) fn is(self, mutation: Mutation) -> bool {
        self.chosen == Some(mutation)
    }

    /// Never, in what is shipped.
    #[cfg(not(feature = "mutations"))]
    pub(super) const fn is(self, _mutation: Mutation) -> bool {
        false
    }
}
