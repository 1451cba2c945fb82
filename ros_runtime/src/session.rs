//! One process in the ROS 2 graph: a DDS participant and the node on it.

use std::cell::RefCell;
use std::net::Ipv4Addr;
use std::rc::{Rc, Weak};
use std::sync::Arc;

use ros2_client::qos::QosProfile;
use ros2_client::{
    Context, MessageInfo, MessageTypeName, Name, Node, NodeName, NodeOptions, ParameterValue,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity};
use serde::Serialize;
use thiserror::Error;

use crate::arguments::{NodeIdentity, RemapRules, Resource};
use crate::dds_deadlock::DeadlockWatchdog;
use crate::dds_liveness::LivenessWatchdog;
use crate::environment::DiscoveryRange;
use crate::exit::Failure;
use crate::interfaces::{discovery_obstacle, interfaces};
use crate::logging;
use crate::matched_readers::MatchedReaders;
use crate::parameters::{NodeParameters, ParameterError, Parameters, Tunables};
use crate::publisher_queue::{Flush, PublisherQueue, Sink};
use crate::rosout::LogLines;
use crate::service_mapping::ServiceMapping;
use crate::settings::Settings;
use crate::topic::{Quality, Topic};
use crate::topic_statistics::SharedStatistics;

/// A process's place in the ROS 2 graph.
///
/// Drop every queue before the session: endpoints, node, context and participant then leave the graph in this order,
/// and at once. The node of a process that ends otherwise stays listed until its lease runs out.
///
/// The library's spinner does not run. It would subscribe `/clock` with a type that no other node uses, and all of
/// `ros_discovery_info`, whose discovery traffic grows with the square of the number of processes.
pub struct Session {
    // Fields are dropped in the order in which they are declared.
    pub(crate) node: Node,
    #[expect(
        dead_code,
        reason = "dropped after the node and before the participant"
    )]
    context: Context,
    pub(crate) participant: DomainParticipant,
    pub(crate) matched_readers: MatchedReaders,
    liveness: LivenessWatchdog,
    deadlock: DeadlockWatchdog,
    identity: NodeIdentity,
    remaps: RemapRules,
    pub(crate) service_mapping: ServiceMapping,
    pub(crate) parameters: Parameters,
    pub(crate) log: Option<LogLines>,
    statistics: SharedStatistics,
    queues: Vec<Weak<RefCell<dyn Flush>>>,
}

/// A DDS participant, known by the prefix of its endpoints' identifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParticipantId(pub u128);

/// Why a process could not join the ROS 2 graph, or had to leave it.
#[derive(Debug, Error)]
pub enum SessionError {
    /// A name, a parameter or the network of the machine cannot be used.
    #[error("{0}")]
    BadInput(String),
    /// The DDS library refused, or the node cannot do its work.
    #[error("{0}")]
    Failed(String),
    /// The DDS library has ended its threads, as it does when the process was stopped and continues.
    #[error(
        "the DDS library no longer receives, as happens when a process is stopped and continues"
    )]
    NotReceiving,
}

impl From<ParameterError> for SessionError {
    fn from(error: ParameterError) -> Self {
        Self::BadInput(error.to_string())
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::BadInput(_) => Self::BadInput(error.into()),
            SessionError::Failed(_) | SessionError::NotReceiving => Self::Failed(error.into()),
        }
    }
}

impl Session {
    /// Joins the graph as the node `name` in the namespace of the settings, unless remapping rules change either.
    ///
    /// # Errors
    /// Refuses names that are not ROS 2 names, and a machine on which the processes cannot discover each other; passes
    /// on what the DDS library refuses, such as a domain that is full.
    pub fn join(
        settings: &Settings,
        name: &str,
        parameters: Parameters,
    ) -> Result<Self, SessionError> {
        let environment = &settings.environment;
        let identity = settings.identity(name);
        logging::follow(&identity.logger(), &settings.ros.log);
        let of_every_node = NodeParameters::default().read(parameters.values())?;
        let service_mapping = of_every_node
            .service_mapping
            .unwrap_or(settings.service_mapping);
        let node_name = NodeName::new(identity.namespace.as_str(), &identity.name)
            .map_err(|error| bad_name(&identity.fully_qualified(), &error))?;
        let domain = environment.domain.number();
        let failed = |what: &str, reason: &dyn ToString| library_error(what, domain, reason);
        let liveness = LivenessWatchdog::before_participant();
        let deadlock = DeadlockWatchdog::start(Arc::clone(&liveness.threads));
        let participant = deadlock
            .watch(|| participant_builder(domain, environment.range).build())
            .map_err(|error| failed("create a DDS participant", &error))?;
        let participants = participant.participant_id().saturating_add(1);
        if let Some(obstacle) = discovery_obstacle(environment.range, &interfaces(), participants) {
            return Err(SessionError::BadInput(obstacle));
        }
        let context = deadlock
            .watch(|| Context::from_domain_participant(participant.clone()))
            .map_err(|error| failed("create a ROS 2 context", &error))?;
        let node = deadlock
            .watch(|| context.new_node(node_name, node_options(&parameters)))
            .map_err(|error| failed("create a ROS 2 node", &error))?;
        liveness.participant_created();
        tracing::info!(
            node = node.fully_qualified_name(),
            domain,
            range = %environment.range,
            services = %service_mapping,
            participant = participant.participant_id(),
            "joined the ROS 2 graph"
        );
        Ok(Self {
            node,
            context,
            matched_readers: MatchedReaders::of(&participant),
            participant,
            liveness,
            deadlock,
            identity,
            remaps: settings.ros.remaps.clone(),
            service_mapping,
            parameters,
            log: settings.log.clone(),
            statistics: SharedStatistics::default(),
            queues: Vec::new(),
        })
    }

    /// Fails once the DDS library has stopped receiving; only a new session receives again.
    pub(crate) fn check_liveness(&self) -> Result<(), SessionError> {
        if self.liveness.is_alive() {
            Ok(())
        } else {
            Err(SessionError::NotReceiving)
        }
    }

    /// The parameters that every node has.
    #[must_use]
    pub fn node_parameters(&self) -> NodeParameters {
        // Values that were accepted have passed their ranges, so they can be read.
        let parameters = NodeParameters::default().read(self.parameters.values());
        parameters.unwrap_or_default()
    }

    /// The node's name and namespace.
    #[must_use]
    pub fn identity(&self) -> &NodeIdentity {
        &self.identity
    }

    /// The participant of this process, as receivers see it in the samples that it sends.
    #[must_use]
    pub fn participant(&self) -> ParticipantId {
        participant_of(self.participant.guid().prefix.as_ref())
    }

    /// The counts of samples, which the queues of this session write.
    #[must_use]
    pub fn statistics(&self) -> SharedStatistics {
        Rc::clone(&self.statistics)
    }

    /// Publishes a topic.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<PublisherQueue<M>, SessionError> {
        let quality = topic.quality().publisher_qos();
        let dds_topic = self.dds_topic(topic, &quality)?;
        let what = format!("publish `{}`", topic.path());
        let publisher = self.create(&what, |node| {
            node.create_publisher(&dds_topic, Some(quality))
        })?;
        let sink: Sink<M> = Box::new(move |sample| publisher.publish(sample));
        Ok(self.queue(topic.name(), topic.quality(), sink))
    }

    /// A queue in front of `sink`, which the event loop offers its waiting samples again.
    pub(crate) fn queue<M: 'static>(
        &mut self,
        topic: &'static str,
        quality: Quality,
        sink: Sink<M>,
    ) -> PublisherQueue<M> {
        let queue = PublisherQueue::new(topic, quality, sink, self.statistics());
        self.queues.push(Rc::downgrade(&queue.shared()));
        queue
    }

    /// Offers the waiting samples of all queues again; returns whether any still wait.
    pub(crate) fn flush(&mut self) -> bool {
        self.queues.retain(|queue| queue.strong_count() > 0);
        let mut is_waiting = false;
        for queue in self.queues.iter().filter_map(Weak::upgrade) {
            is_waiting |= queue.borrow_mut().flush();
        }
        is_waiting
    }

    pub(crate) fn dds_topic<M>(
        &mut self,
        topic: &Topic<M>,
        quality: &QosProfile,
    ) -> Result<rustdds::Topic, SessionError> {
        let name = library_name(&self.resolve(Resource::Topic, &topic.path())?)?;
        let (package, type_name) = topic.type_name();
        let type_name = MessageTypeName::new(package, type_name);
        let what = format!("create topic `{}`", topic.path());
        self.create(&what, |node| node.create_topic(&name, type_name, quality))
    }

    /// Creates an endpoint, observed by both watchdogs.
    pub(crate) fn create<T, E: ToString>(
        &mut self,
        what: &str,
        create: impl FnOnce(&mut Node) -> Result<T, E>,
    ) -> Result<T, SessionError> {
        let node = &mut self.node;
        self.deadlock.watch(|| create(node)).map_err(|error| {
            // Without its threads the library refuses everything.
            if self.liveness.threads.all_run() {
                library_error(what, self.node.domain_id(), &error)
            } else {
                SessionError::NotReceiving
            }
        })
    }

    /// The fully qualified name of the topic or service that this node calls `name`.
    ///
    /// # Errors
    /// The name, or its remapping, cannot be used.
    pub fn resolve(&self, resource: Resource, name: &str) -> Result<String, SessionError> {
        let resolved = self.remaps.resolve(resource, name, &self.identity);
        resolved.map_err(|reason| bad_name(name, &reason))
    }

    /// Publishes a changed parameter on `/parameter_events`.
    pub(crate) fn announce_parameter(&mut self, name: &str, value: ParameterValue) {
        if let Err(reason) = self.node.set_parameter(name, value) {
            tracing::warn!("could not announce the change of parameter {name}: {reason}");
        }
    }
}

/// Takes part in the graph, and again with a new session whenever the DDS library no longer receives.
///
/// # Errors
/// The graph could not be joined, or the node could not go on.
pub fn rejoining<T>(
    mut take_part: impl FnMut() -> Result<T, SessionError>,
) -> Result<T, SessionError> {
    loop {
        match take_part() {
            Err(error @ SessionError::NotReceiving) => tracing::warn!("{error}; rejoining"),
            end => return end,
        }
    }
}

fn participant_builder(domain: u16, range: DiscoveryRange) -> DomainParticipantBuilder {
    let builder = DomainParticipantBuilder::new(domain);
    match range {
        DiscoveryRange::Off => builder
            .with_only_networks(Vec::<Ipv4Addr>::new())
            .same_host_loopback(false),
        DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
        DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => builder,
    }
}

/// The library's own parameter services know one service mapping only, and its log is unbounded, so both are off. Its
/// store of parameters publishes `/parameter_events`, by an endpoint that it creates in any case.
fn node_options(parameters: &Parameters) -> NodeOptions {
    let options = NodeOptions::new()
        .enable_rosout(false)
        .start_parameter_services(false);
    let values = parameters.values().iter();
    values.fold(options, |options, (name, value)| {
        options.declare_parameter(name, value.clone())
    })
}

/// A fully qualified name, for the library.
pub(crate) fn library_name(name: &str) -> Result<Name, SessionError> {
    Name::parse(name).map_err(|error| bad_name(name, &error))
}

fn library_error(what: &str, domain: u16, reason: &dyn ToString) -> SessionError {
    let reason = reason.to_string();
    SessionError::Failed(format!("cannot {what} in domain {domain}: {reason}"))
}

fn bad_name(name: &str, reason: &dyn ToString) -> SessionError {
    let reason = reason.to_string();
    SessionError::BadInput(format!("`{name}` cannot be used in a ROS 2 name: {reason}"))
}

/// The participant that sent a sample.
pub(crate) fn sender_of(info: &MessageInfo) -> ParticipantId {
    // The first twelve bytes of an endpoint's identifier are its participant's.
    participant_of(&info.publisher_gid().to_bytes16()[..12])
}

fn participant_of(prefix: &[u8]) -> ParticipantId {
    let number = prefix
        .iter()
        .fold(0, |number, &byte| (number << 8) | u128::from(byte));
    ParticipantId(number)
}
