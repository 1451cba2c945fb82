//! Reports that bodies were taken away, by a service of each process of modules: where a user's program announces the target, no target
//! publisher serves them.

use formation_model::{Message, Removal, Timing};
use formation_msgs::{RemoveModuleRequest, RemoveModuleResponse};
use formation_node_support::removal_requests::{self, Request};
use formation_protocol::{Agent, Arrived};
use ros_runtime::service::DeclaredService;

use super::Host;

pub(crate) const REMOVE_MODULE: DeclaredService<RemoveModuleRequest, RemoveModuleResponse> =
    DeclaredService::new("~/remove_module", "formation_msgs", "RemoveModule");

impl Host {
    /// Proposes the removal that a client asked for before its modules listened, and answers.
    pub(crate) fn report_removal(&mut self, request: Request) {
        let outcome = self.propose_removal(&request);
        request.answer(outcome);
    }

    /// Has the hosted modules propose a removal. Says what takes effect when, or why nothing does.
    fn propose_removal(&mut self, request: &Request) -> Result<String, String> {
        let module = request.module;
        if self.index_of(module).is_some() {
            return Err(format!(
                "{module} lives in this process, so nothing was removed"
            ));
        }
        let replica = &self.replica;
        let last = replica.last_heard(module);
        if last.is_some_and(|last| last > request.heard_after) {
            return Err(removal_requests::are_alive([module]));
        }
        let run = request.resolve(replica.latest_run_of(module))?;
        if !replica.agents().iter().any(Agent::is_member) {
            return Err(format!(
                "no module of this process is a member of the formation, so nothing was removed: ask the process of one that is, \
                 or use `formation remove {}`",
                module.0
            ));
        }
        let timing = replica.agents().first().map(Agent::timing);
        self.arrived.push(Arrived {
            source: Some(self.source),
            sender: None,
            message: Message::Removal(Removal::of_body(run)),
        });
        Ok(removal_requests::were_reported([module], timing))
    }

    /// How long to listen for heartbeats before a request is answered.
    pub(crate) fn timing(&self) -> Option<Timing> {
        self.replica.agents().first().map(Agent::timing)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use std::time::Duration;

    use formation_model::{Heartbeat, Incarnation, ModuleId, Pose, Service, SourceId};
    use formation_node_support::removal_requests::Requests;
    use formation_protocol::AgentParameters;
    use ros_runtime::service::Call;

    use super::*;
    use crate::arguments::{Motion, single_module};
    use crate::journal::KeptMemory;

    const SECOND: Duration = Duration::from_secs(1);

    fn heartbeat(module: u32, sequence: u64) -> Message {
        Message::Heartbeat(Heartbeat {
            sequence,
            uptime: SECOND * u32::try_from(sequence).unwrap(),
            ..Heartbeat::first(ModuleId(module).run(Incarnation(7)))
        })
    }

    /// The answer of a process of module 4 that has heard module 5 before the request, and after it or not.
    fn answer(module_id: u32, is_heard_after: bool) -> RemoveModuleResponse {
        let pose = Pose::from_units(0.0, 0.0, 0.0).unwrap();
        let modules = [(single_module(ModuleId(4), pose), Service::Active)];
        let parameters = AgentParameters::default();
        let motion = Motion::default();
        let mut host = Host::new(
            SourceId(1),
            modules,
            parameters,
            &motion,
            &[],
            KeptMemory::default(),
        );
        host.take_message(SourceId(2), heartbeat(5, 1));
        host.advance(SECOND);
        let answer = Rc::new(RefCell::new(None));
        let given = Rc::clone(&answer);
        let call = Call {
            request: RemoveModuleRequest {
                module_id,
                incarnation: 0,
            },
            reply: Box::new(move |answer| *given.borrow_mut() = Some(answer)),
        };
        let mut requests = Requests::default();
        requests.add(SECOND, host.timing(), call);
        if is_heard_after {
            host.take_message(SourceId(2), heartbeat(5, 2));
            host.advance(SECOND * 2);
        }
        for request in requests.take_due(SECOND * 10) {
            host.report_removal(request);
        }
        answer.take().unwrap()
    }

    #[test]
    fn a_process_of_modules_refuses_to_report_what_lives_or_is_unknown() {
        for (module, is_heard_after, reason) in [
            (4, false, "module 4 lives in this process"),
            (5, true, "heartbeats of module 5 arrive"),
            (6, false, "no message of module 6 came"),
            // Module 5 is known and silent, and module 4 has listened alone.
            (5, false, "no module of this process is a member"),
        ] {
            let answer = answer(module, is_heard_after);
            assert!(!answer.success);
            assert!(answer.message.contains(reason), "{answer:?}");
        }
    }
}
