//! What the core says arrives as it was said.

use std::time::Duration;

use crate::common::codec::over_the_wire;
use crate::common::core_values;
use crate::common::samples::header;
use formation::model::{self, MicroUnits};
use formation_msgs as wire;
use proptest::prelude::*;

proptest! {
    #[test]
    fn micro_units_survive_as_floats(micro in core_values::micro()) {
        prop_assert_eq!(MicroUnits::from_units(micro.to_units()), Ok(micro));
    }

    #[test]
    fn targets(announcement in core_values::announcement()) {
        let sent = over_the_wire(wire::TargetConfiguration::from(&announcement));
        prop_assert_eq!(model::TargetAnnouncement::try_from(sent), Ok(announcement));
    }

    #[test]
    fn module_states(states in core_values::module_states(), header in header()) {
        let sent = over_the_wire(wire::ModuleStates::new(header, Duration::ZERO, &states));
        prop_assert_eq!(Vec::<model::ModuleState>::try_from(sent), Ok(states));
    }

    #[test]
    fn one_module_state(state in core_values::module_state()) {
        let sent = over_the_wire(wire::ModuleState::from(&state));
        prop_assert_eq!(model::ModuleState::try_from(sent), Ok(state));
    }

    #[test]
    fn rosters(roster in core_values::roster_message()) {
        let sent = over_the_wire(wire::Roster::from(&roster));
        prop_assert_eq!(model::RosterMessage::try_from(sent), Ok(roster));
    }

    #[test]
    fn claims(claim in core_values::claim()) {
        let sent = over_the_wire(wire::SpotClaim::from(&claim));
        prop_assert_eq!(model::SpotClaim::try_from(sent), Ok(claim));
    }

    #[test]
    fn evictions(notice in core_values::eviction_notice()) {
        let sent = over_the_wire(wire::Eviction::from(&notice));
        prop_assert_eq!(model::EvictionNotice::try_from(sent), Ok(notice));
    }

    #[test]
    fn heartbeats(heartbeats in core_values::heartbeats()) {
        let sent = over_the_wire(wire::Heartbeat::new(&heartbeats));
        prop_assert_eq!(Vec::<model::Heartbeat>::try_from(sent), Ok(heartbeats));
    }
}

#[test]
fn an_unset_planner_means_the_default_one() {
    let core = model::PlannerParameters::default();
    let wire_default = wire::PlannerParameters::default();
    assert_eq!(wire_default, wire::PlannerParameters::from(&core));
    assert_eq!(wire_default.d_max, wire::PlannerParameters::D_MAX_UNBOUNDED);
}
