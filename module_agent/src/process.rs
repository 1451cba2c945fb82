//! The node of a process that hosts modules.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::{Incarnation, ModuleId, ModuleSize, Service};
use formation_motion::PlannedMotion;
use formation_msgs::{
    Eviction, Heartbeat, InSession, ModuleStates, RemoveModuleRequest, RemoveModuleResponse,
    Roster, SpotClaim,
};
use formation_node_support::messages::{
    Received, module_size_of, session_of, source_id, subscribe, subscribe_all,
};
use formation_node_support::removal_requests::Requests;
use formation_node_support::{stamp, topics};
use formation_planner::plan;
use formation_protocol::{ComputedPlan, Identity, PlanJob};
use ros_runtime::PublisherQueue;
use ros_runtime::diagnostics::Report;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::parameters::{NodeParameters, ParameterError, Tunables, Values};
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::service::Call;
use ros_runtime::settings::Settings;
use ros_runtime::stamp::since_boot;
use ros_runtime::topic::Topic;
use serde::Serialize;

use crate::arguments::{AgentTiming, DriveMode, HostedModules, Motion, StoreOptions};
use crate::drivers::{self, DriverMessage, DriverPublishers};
use crate::host::{Host, Outgoing, REMOVE_MODULE};
use crate::journal::{Journal, KeptMemory, WriteJob};
use crate::membership::{ADD_MODULE, MembershipRequest, PUSH_MODULE, RETIRE_MODULE};
use crate::replays::Replays;
use crate::worker::Worker;

/// A process that hosts modules.
#[derive(Clone, Debug)]
pub struct ModuleProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// The modules that it hosts; at least one.
    pub hosted: HostedModules,
    /// How long the agents wait.
    pub timing: AgentTiming,
    /// How the modules move.
    pub motion: Motion,
    /// Where they keep what they agreed on.
    pub memory: StoreOptions,
}

impl ModuleProcess {
    /// Hosts the modules until `stop` yields, then leaves the graph.
    ///
    /// When the DDS library no longer receives, or not at all addresses, or the clock stood still, the modules begin new runs where
    /// they stand, with all that they know; those that were added and those out of service as well.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined, no driver sent a pose, or the store cannot be used.
    pub fn run(self, stop: &Receiver<()>) -> Result<(), RosContextError> {
        let hosted = self.hosted.modules.iter();
        let ids: Vec<u32> = hosted.clone().map(|module| module.module.0).collect();
        let name = node_name(&ids);
        let active = |module: &Identity| (module.clone(), Service::Active);
        let mut modules = hosted.map(active).collect();
        let mut memory = KeptMemory::default();
        // When the machine started, by its wall clock as it is now, which may be set later: observers compare times of runs.
        let mut started = stamp::since_1970(Duration::ZERO);
        rejoining(|| {
            let end = self.take_part(&name, started, &mut modules, &mut memory, stop);
            if let Err(RosContextError::ClockStoodStill(time)) = &end {
                started += *time;
            }
            end
        })
    }

    /// Takes part with these modules until `stop` yields or the library no longer receives, and leaves them as they are
    /// then.
    fn take_part(
        &self,
        name: &str,
        started: Duration,
        modules: &mut Vec<(Identity, Service)>,
        memory: &mut KeptMemory,
        stop: &Receiver<()>,
    ) -> Result<(), RosContextError> {
        let mut declarations = self.timing.declarations();
        declarations.extend(self.motion.declarations());
        declarations.extend(self.memory.declarations());
        let parameters = self.settings.declare(name, declarations)?;
        let timing = self.timing.read(parameters.values())?;
        let motion = self.motion.clone().read(parameters.values())?;
        if motion.mode == DriveMode::External
            && let Some(scenario) = &self.hosted.scenario
        {
            let problem = scenario.problem();
            let planned = plan(Arc::new(problem.clone()));
            let (planned, _) = PlannedMotion::of(problem, planned.plan);
            planned.check().map_err(RosContextError::BadInput)?;
        }
        let options = self.memory.clone().read(parameters.values())?;
        let voters = options
            .checked_voters()
            .map_err(RosContextError::BadInput)?;
        self.begin_runs(name, parameters.values(), modules, memory)?;
        let mut ros = RosContext::join(&self.settings, name, parameters)?;
        let mut inputs = Inputs::default();
        let mut drivers = None;
        if motion.mode == DriveMode::External {
            let ids = modules.iter().map(|(identity, _)| identity.module);
            let frame_id = motion.frame_id.as_deref().unwrap_or(&self.hosted.frame_id);
            let (mut messages, mut publishers) =
                drivers::open(&mut ros, ids, motion.pose_source, frame_id)?;
            let (from, to) = (&mut messages, &mut publishers);
            if !drivers::wait_for_poses(from, to, modules, &motion, &ros, stop)? {
                return Ok(());
            }
            inputs.append(messages, |(module, message)| Input::Driver(module, message));
            drivers = Some(publishers);
        }
        add_topics_and_services(&mut inputs, &mut ros, modules.len())?;
        if motion.pushable {
            inputs.add(ros.serve(&PUSH_MODULE)?, |call| {
                Input::Membership(MembershipRequest::Push(call))
            });
        }
        let journal = match memory {
            KeptMemory::File(journal) => Some(&*journal),
            KeptMemory::Process(_) => None,
        };
        let workers = Workers::start(&mut inputs, journal)?;
        let source = source_id(ros.participant());
        let publishers = Publishers {
            states: ros.publisher(&topics::MODULE_STATES)?,
            claims: ros.publisher(&topics::claims(modules.len()))?,
            heartbeats: ros.publisher(&topics::HEARTBEATS)?,
            roster: None,
            evictions: None,
            drivers,
        };
        let starting = modules.iter().cloned();
        let start = since_boot();
        let mut node = ModuleNode {
            start,
            clock_zero: started + start,
            publishers,
            host: Host::new(
                source,
                starting,
                timing.0,
                &motion,
                &voters,
                std::mem::take(memory),
            ),
            workers,
            removals: Requests::default(),
            replays: Replays::default(),
            failure: None,
            frame_id: self.hosted.frame_id.clone(),
            module_size: module_size_of(&ros),
        };
        let ended = ros.run(&mut node, inputs, stop);
        for (module, refusals) in node.host.refusals() {
            if refusals.total() > 0 {
                tracing::info!(module = module.0, "refused: {refusals}");
            }
        }
        *modules = node.host.modules();
        *memory = node.host.into_memory();
        for (identity, _) in modules {
            let next = Incarnation(identity.incarnation.0.saturating_add(1));
            identity.incarnation = stamp::incarnation().max(next);
        }
        ended
    }

    /// Opens the store when the process starts, and writes the incarnations of the runs that begin, if there is a store.
    fn begin_runs(
        &self,
        name: &str,
        values: &Values,
        modules: &mut Vec<(Identity, Service)>,
        memory: &mut KeptMemory,
    ) -> Result<(), RosContextError> {
        let options = self.memory.clone().read(values)?;
        let Some(directory) = options.state_dir else {
            return Ok(());
        };
        if let KeptMemory::Process(_) = memory {
            let session = NodeParameters::default().read(values)?.session;
            let session = session.unwrap_or_default();
            let session = (session, options.new_session);
            let opened = Journal::open(Path::new(&directory), name, session, modules);
            *memory = KeptMemory::File(opened.map_err(RosContextError::BadInput)?);
        }
        if let KeptMemory::File(journal) = memory {
            journal.begin(modules).map_err(RosContextError::Failed)?;
        }
        Ok(())
    }
}

fn add_topics_and_services(
    inputs: &mut Inputs<Input>,
    ros: &mut RosContext,
    modules: usize,
) -> Result<(), RosContextError> {
    for messages in subscribe_all(ros, modules)? {
        inputs.add(messages, Input::Messages);
    }
    let commands = subscribe(ros, &topics::COMMANDS)?;
    inputs.add(commands, Input::Messages);
    // Left out where the node serves no tools, as discovery grows with the number of endpoints.
    if ros.node_parameters().start_parameter_services {
        let (add, retire) = (ros.serve(&ADD_MODULE)?, ros.serve(&RETIRE_MODULE)?);
        inputs.add(add, |call| Input::Membership(MembershipRequest::Add(call)));
        inputs.add(retire, |call| {
            Input::Membership(MembershipRequest::Retire(call))
        });
        inputs.add(ros.serve(&REMOVE_MODULE)?, Input::Removal);
    }
    Ok(())
}

enum Input {
    Messages(Received),
    Driver(ModuleId, DriverMessage),
    Membership(MembershipRequest),
    Removal(Call<RemoveModuleRequest, RemoveModuleResponse>),
    Computed(Arc<ComputedPlan>),
    /// The store holds the contents of this number.
    Written(u64),
    /// What the process cannot go on without has ended, for this reason.
    Failed(String),
}

/// Slow work, each kind on its own thread.
/// Enforces Q10.
struct Workers {
    plans: Worker<PlanJob>,
    /// `None` without a store.
    store: Option<Worker<WriteJob>>,
}

impl Workers {
    fn start(
        inputs: &mut Inputs<Input>,
        journal: Option<&Journal>,
    ) -> Result<Self, RosContextError> {
        let ended = |name: &str| Input::Failed(format!("the thread for {name} has ended"));
        let (plans, computed) = Worker::start("plans", |job: PlanJob| Arc::new(job.run()))?;
        inputs.add_urgent(computed, move |computed| match computed {
            Some(computed) => Input::Computed(computed),
            None => ended("plans"),
        });
        let Some(journal) = journal else {
            return Ok(Self { plans, store: None });
        };
        let store = journal.store();
        let (writer, written) = Worker::start("store", move |job: WriteJob| job.run(&store))?;
        inputs.add_urgent(written, move |written| match written {
            Some(Ok(number)) => Input::Written(number),
            Some(Err(reason)) => Input::Failed(format!(
                "{reason}; the modules stop, because after a restart they would lack what they agreed on"
            )),
            None => ended("the store"),
        });
        let store = Some(writer);
        Ok(Self { plans, store })
    }
}

struct Publishers {
    states: PublisherQueue<ModuleStates>,
    claims: PublisherQueue<SpotClaim>,
    heartbeats: PublisherQueue<Heartbeat>,
    /// Created when first needed, as few processes ever convene or evict, and reliable writers are expensive.
    roster: Option<PublisherQueue<Roster>>,
    evictions: Option<PublisherQueue<Eviction>>,
    drivers: Option<DriverPublishers>,
}

struct ModuleNode {
    /// The time since the machine started, when the node did.
    start: Duration,
    /// The time since 1970 at that moment.
    clock_zero: Duration,
    publishers: Publishers,
    host: Host,
    workers: Workers,
    /// The requests to report bodies as removed that wait until the modules have listened.
    removals: Requests,
    replays: Replays,
    /// Why the process cannot go on.
    failure: Option<String>,
    frame_id: String,
    module_size: ModuleSize,
}

impl Node for ModuleNode {
    type Input = Input;

    fn handle(&mut self, input: Input) {
        let now = self.now();
        match input {
            Input::Messages(Received {
                source,
                replayed_after: Some(after),
                topic,
                ..
            }) => self.replays.ignore(source, topic, after),
            Input::Messages(Received {
                source, messages, ..
            }) => {
                if !self.replays.is_one(source) {
                    for message in messages {
                        self.host.take_message(source, message);
                    }
                }
            }
            Input::Driver(module, message) => {
                if let (DriverMessage::Pose(measured), Some(drivers)) =
                    (&message, &mut self.publishers.drivers)
                {
                    drivers.keep_stamp(module, measured.stamp);
                }
                self.host.handle_driver(now, module, message);
            }
            Input::Membership(request) => {
                request.carry_out(&mut self.host, self.module_size, now);
            }
            Input::Removal(call) => self.removals.add(now, self.host.timing(), call),
            Input::Computed(computed) => self.host.handle_computed(now, &computed),
            Input::Written(number) => self.host.handle_written(now, number),
            Input::Failed(reason) => self.failure = Some(reason),
        }
    }

    fn advance(&mut self, ros: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        if let Some(reason) = self.failure.take() {
            return Err(RosContextError::Failed(reason));
        }
        // Others wait for the claims of a plan that has just come; what they sent can be handled afterwards.
        self.publish_all(ros)?;
        for request in self.removals.take_due(self.now()) {
            self.host.report_removal(request);
        }
        self.host.advance(self.now());
        for participant in ros.departed() {
            self.host
                .handle_departed(self.now(), source_id(participant));
        }
        if let Some(job) = self.host.next_job() {
            self.workers.plans.start_job(job);
        }
        if let Some(writer) = &self.workers.store
            && let Some(job) = self.host.next_write()
        {
            writer.start_job(job);
        }
        self.publish_all(ros)?;
        if let Some(time) = self.host.stood_still() {
            return Err(RosContextError::ClockStoodStill(time));
        }
        Ok(ControlFlow::Continue(()))
    }

    fn due(&self) -> Option<Instant> {
        let due = self.host.due().into_iter();
        let due = due.chain(self.removals.due()).min()?;
        // After a suspension this is late by at most the interval between two looks of the event loop.
        Some(Instant::now() + due.saturating_sub(self.now()))
    }

    fn set_parameters(&mut self, values: &Values) -> Result<(), ParameterError> {
        let (timing, motion) = (
            AgentTiming::default().read(values)?,
            Motion::default().read(values)?,
        );
        self.host.set_parameters(self.now(), timing.0, motion);
        Ok(())
    }

    fn reports(&self) -> Vec<Report> {
        self.host.reports(self.now())
    }
}

impl ModuleNode {
    /// The time of the agents.
    fn now(&self) -> Duration {
        since_boot().saturating_sub(self.start)
    }

    fn publish_all(&mut self, ros: &mut RosContext) -> Result<(), RosContextError> {
        for outgoing in self.host.take_outgoing() {
            self.publish(ros, outgoing)?;
        }
        Ok(())
    }

    fn publish(&mut self, ros: &mut RosContext, outgoing: Outgoing) -> Result<(), RosContextError> {
        let own = session_of(ros);
        let publishers = &mut self.publishers;
        match outgoing {
            Outgoing::ModuleStates(states) => {
                let header = stamp::header(&self.frame_id);
                let states = states.iter().map(AsRef::as_ref);
                let sample = ModuleStates::new(header, self.clock_zero, states, self.module_size);
                publishers.states.publish(sample.in_session(own));
            }
            Outgoing::Heartbeats(heartbeats) => {
                let sample = Heartbeat::new(&heartbeats, self.module_size);
                publishers.heartbeats.publish(sample.in_session(own));
            }
            Outgoing::Claim(claim) => {
                let sample = SpotClaim::from(claim.as_ref());
                publishers.claims.publish(sample.in_session(own));
            }
            Outgoing::Roster(roster) => {
                let queue = created(&mut publishers.roster, ros, &topics::ROSTER)?;
                queue.publish(Roster::new(&roster, self.module_size).in_session(own));
            }
            Outgoing::Eviction(notice) => {
                let queue = created(&mut publishers.evictions, ros, &topics::EVICTIONS)?;
                queue.publish(Eviction::from(&notice).in_session(own));
            }
            Outgoing::Path(module, path) => {
                if let Some(drivers) = &publishers.drivers {
                    drivers.publish_path(module, &path);
                }
            }
            Outgoing::Drive(module, command) => {
                if let Some(drivers) = &publishers.drivers {
                    drivers.publish(module, command);
                }
            }
        }
        Ok(())
    }
}

/// A queue that is created when it is first used.
fn created<'a, M: Serialize + 'static>(
    queue: &'a mut Option<PublisherQueue<M>>,
    ros: &mut RosContext,
    topic: &Topic<M>,
) -> Result<&'a PublisherQueue<M>, RosContextError> {
    Ok(match queue {
        Some(queue) => queue,
        none => none.insert(ros.publisher(topic)?),
    })
}

/// The name of the node of a process that hosts these modules, in ascending order.
fn node_name(modules: &[u32]) -> String {
    match modules {
        [] => "modules".to_owned(),
        [module] => format!("module_{module}"),
        [first, .., last] => {
            let count = u32::try_from(modules.len()).unwrap_or(u32::MAX);
            if last.checked_sub(*first) == Some(count - 1) {
                format!("modules_{first}_to_{last}")
            } else {
                format!("modules_{first}_and_{}_more", count - 1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::ffi::OsString;

    use formation_tests::parameter_section;
    use ros_runtime::arguments::RosArguments;

    use super::*;

    #[test]
    fn a_node_is_named_after_the_modules_that_it_hosts() {
        assert_eq!(node_name(&[4]), "module_4");
        assert_eq!(node_name(&[1, 2, 3]), "modules_1_to_3");
        assert_eq!(node_name(&[1, 2, 9]), "modules_1_and_2_more");
        assert_eq!(node_name(&[7, 3]), "modules_7_and_1_more");
    }

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let words = ["", "--ros-args", "--params-file", ""].map(OsString::from);
        let sections = parameter_section(&["Every node", "Agents", "Drives"]);
        let (_, ros) = RosArguments::extract(words, |_| Ok(sections.clone())).unwrap();
        let settings = Settings::default();
        let shipped = ros
            .parameters
            .of_node(&settings.identity("module_4"))
            .into_iter();
        let shipped = shipped.map(|(name, assignment)| (name, &assignment.value));
        let mut declarations = AgentTiming::default().declarations();
        declarations.extend(Motion::default().declarations());
        declarations.extend(StoreOptions::default().declarations());
        let parameters = settings.declare("module_4", declarations).unwrap();
        let declared = parameters
            .values()
            .iter()
            .map(|(name, value)| (*name, value));
        assert_eq!(shipped.collect::<BTreeMap<_, _>>(), declared.collect());
    }
}
