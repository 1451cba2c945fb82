//! Adding modules to a running process, taking modules out of service or back, and pushing simulated ones, by services.

use std::time::Duration;

use formation_model::text::joined;
use formation_model::{ModuleId, ModulePhase, ModuleSize, NO_ID, PoseError, Service as InService};
use formation_msgs::{
    AddModuleRequest, AddModuleResponse, PushModuleRequest, PushModuleResponse,
    RetireModuleRequest, RetireModuleResponse,
};
use formation_protocol::Command;
use ros_runtime::service::{Call, DeclaredService};

use crate::arguments::single_module;
use crate::host::Host;

pub(crate) const ADD_MODULE: DeclaredService<AddModuleRequest, AddModuleResponse> =
    DeclaredService::new("~/add_module", "formation_msgs", "AddModule");
pub(crate) const RETIRE_MODULE: DeclaredService<RetireModuleRequest, RetireModuleResponse> =
    DeclaredService::new("~/retire_module", "formation_msgs", "RetireModule");
pub(crate) const PUSH_MODULE: DeclaredService<PushModuleRequest, PushModuleResponse> =
    DeclaredService::new("~/push_module", "formation_msgs", "PushModule");

/// A request to one of the services.
pub(crate) enum MembershipRequest {
    Add(Call<AddModuleRequest, AddModuleResponse>),
    Retire(Call<RetireModuleRequest, RetireModuleResponse>),
    Push(Call<PushModuleRequest, PushModuleResponse>),
}

impl MembershipRequest {
    /// Carries out the request if possible, and answers with what will happen, once the store holds it.
    pub(crate) fn carry_out(self, host: &mut Host, size: ModuleSize, now: Duration) {
        match self {
            Self::Add(Call { request, reply }) => {
                let outcome = logged(request.module_id, add(host, size, now, request));
                host.answer(move || reply(outcome.into()));
            }
            Self::Retire(Call { request, reply }) => {
                let outcome = logged(request.module_id, retire(host, now, request));
                host.answer(move || reply(outcome.into()));
            }
            Self::Push(Call { request, reply }) => {
                let outcome = host.push_once((request.module_id, request.order), |host| {
                    push(host, size, now, request)
                });
                reply(logged(request.module_id, outcome).into());
            }
        }
    }
}

/// Logs a refusal, and passes the outcome on.
fn logged(module: u32, outcome: Result<String, String>) -> Result<String, String> {
    outcome.inspect_err(|reason| tracing::warn!(module, "refused a request: {reason}"))
}

/// Hosts one more module, which is docked to none and listens before it takes part. Says what will happen, or why nothing
/// does.
fn add(
    host: &mut Host,
    size: ModuleSize,
    now: Duration,
    request: AddModuleRequest,
) -> Result<String, String> {
    let module = ModuleId(request.module_id);
    if module.0 == NO_ID {
        return Err(format!("module_id: {NO_ID} is reserved and cannot be used"));
    }
    let pose = size
        .pose_from_metres(request.x, request.y, request.theta)
        .map_err(|PoseError { coordinate, source }| format!("{coordinate}: {source}"))?;
    if host.status_of(module).is_some() {
        return Err(format!(
            "{module} is hosted by this process already; if it is out of service, retire_module with `rejoin` takes it \
             back"
        ));
    }
    if host.poses().contains_key(&module) {
        return Err(format!("{module} is live already, in another process"));
    }
    if let Some((other, distance)) = host.too_near(module, &pose) {
        return Err(format!(
            "{other} stands there: {} m away, and a module needs {size}",
            size.to_metres(distance)
        ));
    }
    host.add(now, single_module(module, pose))?;
    Ok(format!(
        "{module} listens, and then joins as a newcomer: a new plan gives it a spot if one is open, else it stands by"
    ))
}

/// Moves the body of a simulated module. Says what will happen, or why nothing does.
fn push(
    host: &mut Host,
    size: ModuleSize,
    now: Duration,
    request: PushModuleRequest,
) -> Result<String, String> {
    let module = ModuleId(request.module_id);
    let way = size
        .pose_from_metres(request.x, request.y, 0.0)
        .map_err(|PoseError { coordinate, source }| format!("{coordinate}: {source}"))?;
    let torn_off = host.push_body(now, module, (way.x, way.y))?;
    Ok(match torn_off.is_empty() {
        true => format!("{module} was pushed"),
        false => format!(
            "{module} was pushed, and torn off {}",
            joined(torn_off.iter().map(|other| other.0), ", ")
        ),
    })
}

/// Takes a module out of service, or back. Says what will happen, or why nothing does.
fn retire(host: &mut Host, now: Duration, request: RetireModuleRequest) -> Result<String, String> {
    let module = ModuleId(request.module_id);
    let Some((service, phase)) = host.status_of(module) else {
        return Err(host.does_not_host(module));
    };
    let command = if request.rejoin {
        Command::Rejoin
    } else {
        Command::Retire
    };
    host.command(now, module, command);
    if !request.rejoin
        && host.status_of(module).map(|(service, _)| service) != Some(InService::Retired)
    {
        return Err(format!(
            "the drive of {module} has failed, and has not reported since that it stands: it is out of service, and stays where it is"
        ));
    }
    Ok(match (service, request.rejoin) {
        (InService::Active, true) => format!("{module} takes part already"),
        (InService::Retired, false) => format!("{module} is retired already"),
        (InService::Retired | InService::MotionFailed, true) => format!(
            "{module} takes part again: a new plan gives it a spot if one is open, else it stands by"
        ),
        (InService::MotionFailed, false) => {
            format!(
                "{module} was out of service already; now it is retired, and makes way for others"
            )
        }
        (InService::Active, false) => {
            let spot = match phase {
                ModulePhase::Settled => "a spare takes its spot, if there is one",
                _ => "it gets no spot",
            };
            format!(
                "{module} stands still and leaves the formation: a new plan is made without it, {spot}, and it undocks \
                 from its neighbours"
            )
        }
    })
}

#[cfg(test)]
mod tests {
    use formation_model::{Heartbeat, Incarnation, Message, Pose, SourceId};
    use formation_protocol::AgentParameters;

    use super::*;
    use crate::arguments::{DriveMode, Motion};
    use crate::journal::KeptMemory;

    const NOW: Duration = Duration::from_secs(1);
    const METRE: ModuleSize = ModuleSize::METRE;

    /// A process with module 4 at the origin.
    fn host(motion: &Motion) -> Host {
        let identity = single_module(ModuleId(4), Pose::default());
        let modules = [(identity, InService::Active)];
        let parameters = AgentParameters::default();
        let mut host = Host::new(
            SourceId(1),
            modules,
            parameters,
            motion,
            &[],
            KeptMemory::default(),
        );
        host.advance(NOW);
        host
    }

    fn service_of(host: &Host, module: u32) -> Option<InService> {
        host.status_of(ModuleId(module)).map(|(service, _)| service)
    }

    fn newcomer(module_id: u32, x: f64) -> AddModuleRequest {
        AddModuleRequest {
            module_id,
            x,
            ..AddModuleRequest::default()
        }
    }

    #[test]
    fn a_push_that_arrives_again_pushes_once() {
        let mut host = host(&Motion {
            pushable: true,
            ..Motion::default()
        });
        let mut place_after = |order| {
            let request = PushModuleRequest {
                module_id: 4,
                x: 1.0,
                y: 0.0,
                order,
            };
            let answer = host.push_once((4, order), |host| push(host, METRE, NOW, request));
            assert_eq!(answer, Ok("module 4 was pushed".to_owned()));
            host.poses()[&ModuleId(4)].map(|pose| pose.x.to_units())
        };
        let places = [7, 7, 8, 0, 0, 7].map(&mut place_after);
        assert_eq!(places, [1.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(Some));
    }

    #[test]
    fn a_module_is_added_where_there_is_room_for_it() {
        let mut host = host(&Motion::default());
        for (request, expected) in [
            (newcomer(NO_ID, 5.0), "is reserved"),
            (newcomer(5, f64::NAN), "x: must be a finite number"),
            (newcomer(4, 5.0), "hosted by this process already"),
            (
                newcomer(5, 0.5),
                "module 4 stands there: 0.5 m away, and a module needs 1 m",
            ),
        ] {
            let reason = add(&mut host, METRE, NOW, request).unwrap_err();
            assert!(reason.contains(expected), "{reason}");
        }
        assert_eq!(host.modules().len(), 1);
        assert!(add(&mut host, METRE, NOW, newcomer(5, 1.0)).is_ok());
        assert_eq!(service_of(&host, 5), Some(InService::Active));
        let answer = add(&mut host, METRE, NOW, newcomer(6, 1.5)).unwrap_err();
        assert!(answer.contains("module 5 stands there"), "{answer}");
        for module in 6..=19 {
            assert!(add(&mut host, METRE, NOW, newcomer(module, f64::from(module))).is_ok());
        }
        let full = add(&mut host, METRE, NOW, newcomer(20, 30.0)).unwrap_err();
        assert!(full.contains("at most 16 modules"), "{full}");
    }

    #[test]
    fn a_small_module_is_added_where_a_large_one_has_no_room() {
        let mut host = host(&Motion::default());
        let size = ModuleSize::from_metres(0.08).unwrap();
        let reason = add(&mut host, size, NOW, newcomer(5, 0.07)).unwrap_err();
        let expected = "module 4 stands there: 0.07 m away, and a module needs 0.08 m";
        assert!(reason.contains(expected), "{reason}");
        assert!(add(&mut host, size, NOW, newcomer(5, 0.08)).is_ok());
        let pose = host.modules()[1].0.pose;
        assert_eq!(pose, Pose::from_units(1.0, 0.0, 0.0).unwrap());
    }

    #[test]
    fn a_module_that_is_live_elsewhere_is_not_added_until_it_is_silent() {
        let mut host = host(&Motion::default());
        let heartbeat = Heartbeat {
            uptime: Duration::from_secs(1),
            ..Heartbeat::first(ModuleId(9).run(Incarnation(7)))
        };
        host.take_message(SourceId(2), Message::Heartbeat(heartbeat));
        host.advance(NOW);
        let answer = add(&mut host, METRE, NOW, newcomer(9, 5.0)).unwrap_err();
        assert!(answer.contains("is live already"), "{answer}");
        let later = NOW + Duration::from_secs(6);
        host.advance(later);
        assert!(add(&mut host, METRE, later, newcomer(9, 5.0)).is_ok());
    }

    #[test]
    fn drivers_are_set_up_at_the_start_only() {
        let mut host = host(&Motion {
            mode: DriveMode::External,
            ..Motion::default()
        });
        let answer = add(&mut host, METRE, NOW, newcomer(5, 5.0)).unwrap_err();
        assert!(answer.contains("--motion external --module 5"), "{answer}");
    }

    #[test]
    fn a_retired_module_says_so_until_it_rejoins_and_in_the_next_host_as_well() {
        let mut host = host(&Motion::default());
        let ask = |module_id, rejoin| RetireModuleRequest { module_id, rejoin };
        let answer = retire(&mut host, NOW, ask(7, false)).unwrap_err();
        assert!(answer.contains("which hosts 4"), "{answer}");
        let answer = retire(&mut host, NOW, ask(4, true)).unwrap();
        assert_eq!(answer, "module 4 takes part already");
        let answer = retire(&mut host, NOW, ask(4, false)).unwrap();
        assert!(answer.contains("leaves the formation"), "{answer}");
        let answer = retire(&mut host, NOW, ask(4, false)).unwrap();
        assert_eq!(answer, "module 4 is retired already");

        let parameters = AgentParameters::default();
        let motion = Motion::default();
        let mut next = Host::new(
            SourceId(1),
            host.modules(),
            parameters,
            &motion,
            &[],
            KeptMemory::default(),
        );
        assert_eq!(service_of(&next, 4), Some(InService::Retired));
        let answer = retire(&mut next, NOW, ask(4, true)).unwrap();
        assert!(answer.contains("takes part again"), "{answer}");
        assert_eq!(service_of(&next, 4), Some(InService::Active));
    }

    #[test]
    fn a_module_whose_motion_failed_is_retired_if_its_drive_is_known_to_stand() {
        let identity = single_module(ModuleId(4), Pose::default());
        let mut host = Host::new(
            SourceId(1),
            [(identity, InService::MotionFailed)],
            AgentParameters::default(),
            &Motion::default(),
            &[],
            KeptMemory::default(),
        );
        let (module_id, rejoin) = (4, false);
        let request = RetireModuleRequest { module_id, rejoin };
        let answer = retire(&mut host, NOW, request).unwrap();
        assert!(answer.contains("makes way"), "{answer}");
        assert_eq!(service_of(&host, 4), Some(InService::Retired));
    }
}
