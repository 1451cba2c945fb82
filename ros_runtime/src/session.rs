//! One process in the ROS 2 graph: a DDS participant and the node on it.

use std::net::Ipv4Addr;

use ros2_client::{
    ActionTypeName, Context, MessageInfo, MessageTypeName, Name, Node, NodeName, NodeOptions,
    Publisher, ServiceTypeName, Subscription,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity};
use serde::Serialize;
use thiserror::Error;

use crate::action::{ActionType, LibraryAction, action_qos};
use crate::arguments::{NodeIdentity, RemapRules, Resource};
use crate::environment::DiscoveryRange;
use crate::interfaces::{discovery_obstacle, interfaces};
use crate::logging;
use crate::parameters::{
    NodeWide, ParameterError, ParameterRequest, ParameterServices, Parameters, Values, shown,
};
use crate::pulse::Pulse;
use crate::service::{LibraryServer, ServiceType, service_qos};
use crate::service_mapping::ServiceMapping;
use crate::settings::Settings;
use crate::standstill::Watch;
use crate::topic::Topic;

/// A process's place in the ROS 2 graph.
///
/// Drop every publisher and subscription before the session: endpoints, node, context and participant then leave
/// the graph in this order, and at once. A process that ends otherwise stays listed until its lease runs out.
///
/// The library's spinner is not run. It would subscribe `/clock` with a type that no other node uses, and all of
/// `ros_discovery_info`, which costs discovery traffic in the square of the processes; others see this node all the same.
pub struct Session {
    // Fields are dropped in the order in which they stand here.
    node: Node,
    #[expect(dead_code, reason = "held for what its end does")]
    context: Context,
    participant: DomainParticipant,
    pulse: Pulse,
    watch: Watch,
    identity: NodeIdentity,
    remaps: RemapRules,
    service_mapping: ServiceMapping,
    parameters: Parameters,
}

/// A DDS participant, known by the prefix of its endpoints' identifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParticipantId(pub u128);

/// Why a process could not join the ROS 2 graph.
#[derive(Debug, Error)]
pub enum SessionError {
    /// A name, or what a remapping rule makes of it, is no ROS 2 name.
    #[error("`{name}` cannot be used in a ROS 2 name: {reason}")]
    Name {
        /// What was given.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A parameter cannot be used.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Processes on this machine would not find each other.
    #[error("{0}")]
    Discovery(String),
    /// No driver told where its module stands.
    #[error("{0}")]
    Drivers(String),
    /// The DDS library has ended its threads, as it does when the process was stopped for a while.
    #[error(
        "the DDS library has stopped listening, as it does when a process is stopped and goes on"
    )]
    Deaf,
    /// The DDS library refused.
    #[error("cannot {what} in domain {domain}: {reason}")]
    Library {
        /// What was to be done.
        what: String,
        /// In which domain.
        domain: u16,
        /// What the library says.
        reason: String,
    },
}

impl Session {
    /// Joins the graph as `name` in the namespace of the settings, unless remapping rules change either.
    ///
    /// # Errors
    /// Refuses names that ROS 2 does not take, and a machine on which the processes cannot find each other; passes
    /// on what the DDS library refuses, such as a domain that is full.
    pub fn open(
        settings: &Settings,
        name: &str,
        parameters: Parameters,
    ) -> Result<Self, SessionError> {
        let environment = &settings.environment;
        let identity = settings.identity(name);
        logging::follow(&identity.logger(), &settings.ros.log);
        let service_mapping = NodeWide::of(parameters.values())?
            .service_mapping
            .unwrap_or(settings.service_mapping);
        let node_name = NodeName::new(identity.namespace.as_str(), &identity.name)
            .map_err(|error| bad_name(&identity.fully_qualified(), &error))?;
        let domain = environment.domain.number();
        let library = |what: &str, reason: &dyn ToString| SessionError::Library {
            what: what.to_owned(),
            domain,
            reason: reason.to_string(),
        };
        let builder = DomainParticipantBuilder::new(domain);
        let builder = match environment.range {
            DiscoveryRange::Off => builder
                .with_only_networks(Vec::<Ipv4Addr>::new())
                .same_host_loopback(false),
            DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => builder,
        };
        let pulse = Pulse::before_start();
        let watch = Watch::start();
        let participant = watch
            .over(|| builder.build())
            .map_err(|error| library("create a DDS participant", &error))?;
        let participants = participant.participant_id().saturating_add(1);
        if let Some(obstacle) = discovery_obstacle(environment.range, &interfaces(), participants) {
            return Err(SessionError::Discovery(obstacle));
        }
        let context = watch
            .over(|| Context::from_domain_participant(participant.clone()))
            .map_err(|error| library("create a ROS 2 context", &error))?;
        // The library's own parameter services know one mapping only, and its log no bounds.
        let mut options = NodeOptions::new()
            .enable_rosout(false)
            .start_parameter_services(false);
        // Its store of parameters is what publishes `/parameter_events`, by an endpoint that it makes anyway.
        for (name, value) in parameters.values().iter() {
            options = options.declare_parameter(name, value.clone());
        }
        let node = watch
            .over(|| context.new_node(node_name, options))
            .map_err(|error| library("create a ROS 2 node", &error))?;
        pulse.started();
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
            participant,
            pulse,
            watch,
            identity,
            remaps: settings.ros.remaps.clone(),
            service_mapping,
            parameters,
        })
    }

    /// Fails once the DDS library has stopped listening; only a new session will hear anything then.
    ///
    /// # Errors
    /// [`SessionError::Deaf`].
    pub fn check_hearing(&self) -> Result<(), SessionError> {
        if self.pulse.is_there() {
            Ok(())
        } else {
            Err(SessionError::Deaf)
        }
    }

    /// The node's parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Answers a request to a parameter service and tells `/parameter_events` what it changed.
    pub fn answer(
        &mut self,
        services: &ParameterServices,
        request: ParameterRequest,
        apply: &mut dyn FnMut(&Values) -> Result<(), String>,
    ) {
        for (name, value) in services.answer(request, &mut self.parameters, apply) {
            tracing::info!("parameter {name} is now {}", shown(&value));
            if let Err(reason) = self.node.set_parameter(name, value) {
                tracing::warn!("could not tell of the change of parameter {name}: {reason}");
            }
        }
    }

    /// What the node is called, and where.
    #[must_use]
    pub fn identity(&self) -> &NodeIdentity {
        &self.identity
    }

    /// The participant that all endpoints belong to.
    pub fn participant(&self) -> DomainParticipant {
        self.participant.clone()
    }

    /// The participant of this process, as receivers see it in the samples that it sends.
    #[must_use]
    pub fn source(&self) -> ParticipantId {
        source_of_prefix(self.participant.guid().prefix.as_ref())
    }

    /// A publisher of a topic.
    ///
    /// # Errors
    /// Refuses a name that ROS 2 does not take; passes on what the DDS library refuses.
    pub fn publisher<M: Serialize>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<Publisher<M>, SessionError> {
        let dds_topic = self.dds_topic(topic, &topic.publisher_qos())?;
        let quality = Some(topic.publisher_qos());
        self.watch
            .over(|| self.node.create_publisher(&dds_topic, quality))
            .map_err(|error| self.library(format!("publish `{}`", topic.path()), &error))
    }

    /// A subscription of a topic.
    ///
    /// # Errors
    /// Refuses a name that ROS 2 does not take; passes on what the DDS library refuses.
    pub fn subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<Subscription<M>, SessionError> {
        let dds_topic = self.dds_topic(topic, &topic.subscription_qos())?;
        let quality = Some(topic.subscription_qos());
        self.watch
            .over(|| self.node.create_subscription(&dds_topic, quality))
            .map_err(|error| self.library(format!("subscribe `{}`", topic.path()), &error))
    }

    fn dds_topic<M>(
        &self,
        topic: &Topic<M>,
        qos: &ros2_client::qos::QosProfile,
    ) -> Result<rustdds::Topic, SessionError> {
        let resolved = self.resolve(Resource::Topic, &topic.path())?;
        let name = Name::parse(&resolved).map_err(|error| bad_name(&resolved, &error))?;
        let (package, type_name) = topic.type_name();
        let type_name = MessageTypeName::new(package, type_name);
        self.watch
            .over(|| self.node.create_topic(&name, type_name, qos))
            .map_err(|error| self.library(format!("create topic `{}`", topic.path()), &error))
    }

    /// The fully qualified name of a topic.
    pub fn topic_name(&self, name: &str) -> Result<String, SessionError> {
        self.resolve(Resource::Topic, name)
    }

    /// The serving end of a service with this fully qualified name.
    pub fn server<S: ServiceType>(&mut self, name: &str) -> Result<LibraryServer<S>, SessionError> {
        let parsed = Name::parse(name).map_err(|error| bad_name(name, &error))?;
        let type_name = ServiceTypeName::new(S::PACKAGE, S::NAME);
        let mapping = self.service_mapping.library();
        let make = || {
            let (request, response) = (service_qos(), service_qos());
            self.node
                .create_server(mapping, &parsed, &type_name, request, response)
        };
        self.watch
            .over(make)
            .map_err(|error| self.library(format!("serve `{name}`"), &error))
    }

    /// The serving end of an action with this fully qualified name.
    pub fn action_server<A: ActionType>(
        &mut self,
        name: &str,
    ) -> Result<LibraryAction<A>, SessionError> {
        let parsed = Name::parse(name).map_err(|error| bad_name(name, &error))?;
        let type_name = ActionTypeName::new(A::PACKAGE, A::NAME);
        let mapping = self.service_mapping.library();
        let make = || {
            self.node
                .create_action_server(mapping, &parsed, &type_name, action_qos())
        };
        self.watch
            .over(make)
            .map_err(|error| self.library(format!("serve the action `{name}`"), &error))
    }

    /// The fully qualified name of what this node knows as `name`.
    pub fn resolve(&self, resource: Resource, name: &str) -> Result<String, SessionError> {
        self.remaps
            .resolve(resource, name, &self.identity)
            .map_err(|error| bad_name(name, &error))
    }

    fn library(&self, what: String, reason: &dyn ToString) -> SessionError {
        SessionError::Library {
            what,
            domain: self.node.domain_id(),
            reason: reason.to_string(),
        }
    }
}

fn bad_name(name: &str, reason: &dyn ToString) -> SessionError {
    SessionError::Name {
        name: name.to_owned(),
        reason: reason.to_string(),
    }
}

/// The participant that sent a sample.
pub fn source_of(info: &MessageInfo) -> ParticipantId {
    // The first twelve bytes of an endpoint's identifier are its participant's.
    source_of_prefix(&info.publisher_gid().to_bytes16()[..12])
}

fn source_of_prefix(prefix: &[u8]) -> ParticipantId {
    ParticipantId(
        prefix
            .iter()
            .fold(0, |number, &byte| (number << 8) | u128::from(byte)),
    )
}
