//! What the border refuses, and how it says so.

use formation::message::{ModuleState, TargetAnnouncement};
use formation_msgs as wire;

fn state() -> wire::ModuleState {
    wire::ModuleState {
        module_id: 4,
        incarnation: 1,
        sequence: 1,
        epoch: wire::Epoch::default(),
        has_digest: false,
        digest: 0,
        phase: wire::ModuleState::PHASE_LISTENING,
        x: 1.5,
        y: -2.0,
        theta: 0.0,
        links: vec![5, 6],
        configuration_id: 1,
        leader_id: 4,
        spot_id: wire::NONE,
        unit_id: wire::NONE,
        waited_for: Vec::new(),
        agreed_on: Vec::new(),
        quorum_bases: Vec::new(),
    }
}

#[test]
fn a_module_state_names_its_fault() {
    let refusal = |change: fn(&mut wire::ModuleState)| {
        let mut bad = state();
        change(&mut bad);
        ModuleState::try_from(bad).unwrap_err().to_string()
    };
    assert!(ModuleState::try_from(state()).is_ok());
    assert_eq!(
        refusal(|state| state.links = vec![5, 4]),
        "module_states: links[1]: names module 4 itself"
    );
    assert_eq!(
        refusal(|state| state.y = f64::NAN),
        "module_states: y: must be a finite number, got NaN"
    );
    assert_eq!(
        refusal(|state| {
            state.has_digest = true;
            state.digest = 7;
        }),
        "module_states: digest: there cannot be one without an epoch"
    );
}

#[test]
fn a_target_names_its_fault() {
    let target = wire::TargetConfiguration {
        spots: vec![wire::Spot::default(), wire::Spot::default()],
        ..wire::TargetConfiguration::default()
    };
    assert_eq!(
        TargetAnnouncement::try_from(target)
            .unwrap_err()
            .to_string(),
        "target: spots[1].id: spot 0 is used twice"
    );
}
