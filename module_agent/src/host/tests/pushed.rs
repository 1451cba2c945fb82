//! Simulated modules that are pushed.

use super::*;
use formation_model::MicroUnits;

const UNIT: i64 = formation_model::MICRO_PER_UNIT;

fn links_of(hosts: &[Host], module: u32) -> BTreeSet<ModuleId> {
    let mut agents = hosts.iter().flat_map(|host| host.replica.agents());
    let found = agents.find(|agent| agent.module() == ModuleId(module));
    found.unwrap().links().clone()
}

/// Each module is in a process of its own, so the neighbour of the one that is pushed only sees its states.
#[test]
fn a_settled_module_that_is_pushed_is_torn_off_on_both_sides_and_comes_back() {
    let (mut hosts, targets): (Vec<Host>, Vec<Message>) =
        [&[4][..], &[5], &[17]].map(host).into_iter().unzip();
    for (host, target) in hosts.iter_mut().zip(targets) {
        host.take_message(TARGET_PUBLISHER, target);
    }
    let formed = Duration::from_secs(30);
    run(&mut hosts, formed);
    let end = [4, 5, 17]
        .into_iter()
        .find(|&module| links_of(&hosts, module).len() == 1);
    let end = end.unwrap();
    let [neighbour] = Vec::from_iter(links_of(&hosts, end))[..] else {
        unreachable!("it has one link");
    };
    let index = [4, 5, 17].iter().position(|&module| module == end).unwrap();
    let refused = hosts[index].push_body(formed, ModuleId(99), (MicroUnits(UNIT), MicroUnits(0)));
    assert!(
        refused
            .unwrap_err()
            .contains("not hosted by this process, which hosts")
    );
    let beside = {
        let place = hosts[index].replica.agents()[0].pose();
        let other = hosts[index].poses()[&neighbour].unwrap();
        (
            MicroUnits(other.x.0 - place.x.0),
            MicroUnits(other.y.0 - place.y.0),
        )
    };
    let short = (MicroUnits(UNIT / 5), MicroUnits(0));
    let refused = hosts[index].push_body(formed, ModuleId(end), short);
    assert!(refused.unwrap_err().contains("too short"));
    let refused = hosts[index].push_body(formed, ModuleId(end), beside);
    assert!(
        refused
            .unwrap_err()
            .contains("is there, 0.00 module sizes away")
    );
    // It ends beside its neighbour, as near as before.
    let way = (MicroUnits(UNIT), MicroUnits(UNIT));
    assert_eq!(
        hosts[index].push_body(formed, ModuleId(end), way),
        Ok(vec![neighbour])
    );
    assert_eq!(links_of(&hosts, end), BTreeSet::new());
    let torn = formed + Duration::from_millis(500);
    run_between(&mut hosts, formed, torn);
    assert!(
        !links_of(&hosts, neighbour.0).contains(&ModuleId(end)),
        "its port is open"
    );
    run_between(&mut hosts, torn, Duration::from_secs(70));
    assert_eq!(links_of(&hosts, end), BTreeSet::from([neighbour]));
    for (host, module) in hosts.iter().zip([4, 5, 17]) {
        assert_eq!(phase_of(host, module), Some(ModulePhase::Settled));
    }
}
