//! What the core says arrives as it was said.

use std::time::Duration;

use crate::common::codec::over_the_wire;
use crate::common::core_values;
use crate::common::samples::header;
use formation_model::{self as model, MicroUnits, ModuleSize};
use formation_msgs as wire;
use formation_msgs::IntoCore;
use proptest::prelude::*;

/// From a millimetre to a kilometre, in whole micrometres.
fn module_size() -> impl Strategy<Value = ModuleSize> {
    (1_000_u32..=1_000_000_000)
        .prop_map(|micrometres| ModuleSize::from_metres(f64::from(micrometres) / 1.0e6).unwrap())
}

proptest! {
    #[test]
    fn micro_units_survive_as_floats(micro in core_values::micro()) {
        prop_assert_eq!(MicroUnits::from_units(micro.to_units()), Ok(micro));
    }

    #[test]
    fn targets(announcement in core_values::announcement(), size in module_size()) {
        let sent = over_the_wire(wire::TargetConfiguration::new(&announcement, size));
        prop_assert_eq!(sent.into_core(size), Ok(announcement));
    }

    #[test]
    fn module_states(
        states in core_values::module_states(),
        header in header(),
        size in module_size(),
    ) {
        let sent = over_the_wire(wire::ModuleStates::new(header, Duration::ZERO, &states, size));
        prop_assert_eq!(sent.into_core(size), Ok(states));
    }

    #[test]
    fn one_module_state(state in core_values::module_state(), size in module_size()) {
        let sent = over_the_wire(wire::ModuleState::new(&state, size));
        prop_assert_eq!(sent.into_core(size), Ok(state));
    }

    #[test]
    fn rosters(roster in core_values::roster_message(), size in module_size()) {
        let sent = over_the_wire(wire::Roster::new(&roster, size));
        prop_assert_eq!(sent.into_core(size), Ok(roster));
    }

    #[test]
    fn claims(claim in core_values::claim()) {
        let sent = over_the_wire(wire::SpotClaim::from(&claim));
        prop_assert_eq!(sent.into_core(ModuleSize::METRE), Ok(claim));
    }

    #[test]
    fn evictions(notice in core_values::eviction_notice()) {
        let sent = over_the_wire(wire::Eviction::from(&notice));
        prop_assert_eq!(sent.into_core(ModuleSize::METRE), Ok(notice));
    }

    #[test]
    fn heartbeats(heartbeats in core_values::heartbeats(), size in module_size()) {
        let sent = over_the_wire(wire::Heartbeat::new(&heartbeats, size));
        prop_assert_eq!(sent.into_core(size), Ok(heartbeats));
    }
}

#[test]
fn an_unset_planner_means_the_default_one() {
    let core = model::PlannerParameters::default();
    let wire_default = wire::PlannerParameters::default();
    assert_eq!(wire_default, wire::PlannerParameters::from(&core));
    assert_eq!(wire_default.d_max, wire::PlannerParameters::D_MAX_UNBOUNDED);
}

/// Some publishers fill what they leave out with zeros, not with the defaults of the file.
#[test]
fn an_empty_policy_means_the_default_one() {
    let mut target = wire::TargetConfiguration {
        withdrawn: true,
        ..wire::TargetConfiguration::default()
    };
    target.planner.policy.clear();
    let announcement: model::TargetAnnouncement = target.into_core(ModuleSize::METRE).unwrap();
    assert_eq!(announcement.parameters, model::PlannerParameters::default());
}
