//! Adding modules to a process that runs, and taking modules out of service or back, as services ask for it.

use std::time::Duration;

use formation::model::{MicroUnits, ModuleId, ModulePhase, NO_ID, Pose, PoseError, Service};
use formation::protocol::{Command, Identity};
use formation_msgs::{
    AddModuleRequest, AddModuleResponse, RetireModuleRequest, RetireModuleResponse, bounds,
};

use crate::host::Host;
use formation_node::stamp;
use ros_runtime::services;

/// Two modules stand at least so far apart: the width of one, less what a pose may be off.
const DISTANCE_MIN: MicroUnits = MicroUnits(950_000);

services! {
    /// The serving ends.
    MembershipServices,
    /// What one of them was asked.
    MembershipRequest in "formation_msgs":
    AddModule add_module "~/add_module": AddModuleRequest => AddModuleResponse;
    RetireModule retire_module "~/retire_module": RetireModuleRequest => RetireModuleResponse;
}

impl MembershipServices {
    /// Does what was asked, if that can be, and says what will come of it.
    pub(crate) fn answer(&self, request: &MembershipRequest, host: &mut Host, now: Duration) {
        match *request {
            MembershipRequest::AddModule(id, request) => {
                let outcome = add(host, now, request);
                let (success, message) = told(request.module_id, outcome);
                self.add_module
                    .answer(id, AddModuleResponse { success, message });
            }
            MembershipRequest::RetireModule(id, request) => {
                let outcome = retire(host, now, request);
                let (success, message) = told(request.module_id, outcome);
                self.retire_module
                    .answer(id, RetireModuleResponse { success, message });
            }
        }
    }
}

fn told(module: u32, outcome: Result<String, String>) -> (bool, String) {
    let success = outcome.is_ok();
    let message = outcome.unwrap_or_else(|reason| reason);
    if !success {
        tracing::warn!(module, "refused a request: {message}");
    }
    (
        success,
        bounds::shortened(message, bounds::ANSWER_BYTES_MAX),
    )
}

/// Takes one more module in, which stands alone and listens before it takes part. Says what will happen, or why nothing does.
fn add(host: &mut Host, now: Duration, request: AddModuleRequest) -> Result<String, String> {
    let module = ModuleId(request.module_id);
    if module.0 == NO_ID {
        return Err(format!("module_id: {NO_ID} is reserved and cannot be used"));
    }
    let pose = Pose::from_units(request.x, request.y, request.theta)
        .map_err(|PoseError { coordinate, source }| format!("{coordinate}: {source}"))?;
    if host.service_of(module).is_some() {
        return Err(format!(
            "{module} is hosted by this process already; if it is out of service, retire_module with `rejoin` takes it \
             back"
        ));
    }
    let standing = host.standing();
    if standing.contains_key(&module) {
        return Err(format!("{module} lives already, in another process"));
    }
    for (other, place) in standing {
        let distance = place.map(|place| place.distance_to(&pose));
        if let Some(distance) = distance.filter(|&distance| distance < DISTANCE_MIN) {
            return Err(format!(
                "{other} stands there: {} units away, and a module is one unit wide",
                distance.to_units()
            ));
        }
    }
    host.add(
        now,
        Identity {
            module,
            incarnation: stamp::incarnation(),
            pose,
            links: [].into(),
            configuration: None,
            leader: None,
        },
    )?;
    Ok(format!(
        "{module} listens, and then joins as a newcomer: a new plan gives it a spot if one is open, else it stands by"
    ))
}

/// Takes a module out of service, or back. Says what will happen, or why nothing does.
fn retire(host: &mut Host, now: Duration, request: RetireModuleRequest) -> Result<String, String> {
    let module = ModuleId(request.module_id);
    let (Some(service), Some(phase)) = (host.service_of(module), host.phase_of(module)) else {
        return Err(format!(
            "{module} is not hosted by this process, which hosts {}",
            host.named()
        ));
    };
    let command = if request.rejoin {
        Command::Rejoin
    } else {
        Command::Retire
    };
    host.command(now, module, command);
    Ok(match (service, request.rejoin) {
        (Service::Active, true) => format!("{module} takes part already"),
        (Service::Retired, false) => format!("{module} is retired already"),
        (Service::Retired | Service::MotionFailed, true) => format!(
            "{module} takes part again: a new plan gives it a spot if one is open, else it stands by"
        ),
        (Service::MotionFailed, false) => format!(
            "{module} was out of service already, since its drive gave up; now it is retired"
        ),
        (Service::Active, false) => {
            let spot = match phase {
                ModulePhase::Settled => "a spare takes its spot, if there is one",
                _ => "it gets no spot",
            };
            format!(
                "{module} stands still and leaves the formation: a new plan is made without it, {spot}, and it lets go of \
                 what it is docked to"
            )
        }
    })
}

#[cfg(test)]
mod tests {
    use formation::model::{Heartbeat, Incarnation, Message};
    use formation::protocol::{AgentParameters, SourceId};

    use super::*;
    use crate::drive::MotionParameters;
    use crate::drivers::ExternalMotion;

    const NOW: Duration = Duration::from_secs(1);

    /// A process with module 4 at the origin.
    fn host(motion: &MotionParameters) -> Host {
        let identity = Identity {
            module: ModuleId(4),
            incarnation: Incarnation(1),
            pose: Pose::default(),
            links: [].into(),
            configuration: None,
            leader: None,
        };
        let modules = [(identity, Service::Active)];
        let parameters = AgentParameters::default();
        let mut host = Host::new(SourceId(1), modules, parameters, motion);
        host.advance(NOW);
        host
    }

    fn newcomer(module_id: u32, x: f64) -> AddModuleRequest {
        AddModuleRequest {
            module_id,
            x,
            ..AddModuleRequest::default()
        }
    }

    #[test]
    fn a_module_is_added_where_there_is_room_for_it() {
        let mut host = host(&MotionParameters::default());
        for (request, told) in [
            (newcomer(NO_ID, 5.0), "is reserved"),
            (newcomer(5, f64::NAN), "x: must be a finite number"),
            (newcomer(4, 5.0), "hosted by this process already"),
            (newcomer(5, 0.5), "module 4 stands there: 0.5 units away"),
        ] {
            let reason = add(&mut host, NOW, request).unwrap_err();
            assert!(reason.contains(told), "{reason}");
        }
        assert_eq!(host.modules().len(), 1);
        assert!(add(&mut host, NOW, newcomer(5, 1.0)).is_ok());
        assert_eq!(host.service_of(ModuleId(5)), Some(Service::Active));
        let told = add(&mut host, NOW, newcomer(6, 1.5)).unwrap_err();
        assert!(told.contains("module 5 stands there"), "{told}");
        for module in 6..=19 {
            assert!(add(&mut host, NOW, newcomer(module, f64::from(module))).is_ok());
        }
        let full = add(&mut host, NOW, newcomer(20, 30.0)).unwrap_err();
        assert!(full.contains("at most 16 modules"), "{full}");
    }

    #[test]
    fn a_module_that_lives_elsewhere_is_not_added_until_it_is_dead() {
        let mut host = host(&MotionParameters::default());
        let heartbeat = Heartbeat {
            module: ModuleId(9),
            incarnation: Incarnation(7),
            sequence: 1,
            uptime: Duration::from_secs(1),
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            phase: ModulePhase::Listening,
        };
        host.receive(NOW, SourceId(2), &Message::Heartbeat(heartbeat));
        let told = add(&mut host, NOW, newcomer(9, 5.0)).unwrap_err();
        assert!(told.contains("lives already"), "{told}");
        let later = NOW + Duration::from_secs(6);
        host.advance(later);
        assert!(add(&mut host, later, newcomer(9, 5.0)).is_ok());
    }

    #[test]
    fn drivers_are_set_up_at_the_start_only() {
        let mut host = host(&MotionParameters::External(ExternalMotion::default()));
        let told = add(&mut host, NOW, newcomer(5, 5.0)).unwrap_err();
        assert!(told.contains("--motion external --module 5"), "{told}");
    }

    #[test]
    fn a_retired_module_says_so_until_it_rejoins_and_in_the_next_host_as_well() {
        let mut host = host(&MotionParameters::default());
        let ask = |module_id, rejoin| RetireModuleRequest { module_id, rejoin };
        let told = retire(&mut host, NOW, ask(7, false)).unwrap_err();
        assert!(told.contains("which hosts 4"), "{told}");
        let told = retire(&mut host, NOW, ask(4, true)).unwrap();
        assert_eq!(told, "module 4 takes part already");
        let told = retire(&mut host, NOW, ask(4, false)).unwrap();
        assert!(told.contains("leaves the formation"), "{told}");
        let told = retire(&mut host, NOW, ask(4, false)).unwrap();
        assert_eq!(told, "module 4 is retired already");

        let parameters = AgentParameters::default();
        let motion = MotionParameters::default();
        let mut next = Host::new(SourceId(1), host.modules(), parameters, &motion);
        assert_eq!(next.service_of(ModuleId(4)), Some(Service::Retired));
        let told = retire(&mut next, NOW, ask(4, true)).unwrap();
        assert!(told.contains("takes part again"), "{told}");
        assert_eq!(next.service_of(ModuleId(4)), Some(Service::Active));
    }
}
