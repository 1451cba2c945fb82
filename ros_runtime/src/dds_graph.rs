//! A process in the ROS 2 graph over DDS: a participant and the node on it.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::future::Future;
use std::net::Ipv4Addr;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use futures::stream::{LocalBoxStream, poll_fn};
use futures::{Stream, StreamExt};
use ros2_client::qos::QosProfile;
use ros2_client::{
    Context, MessageInfo, MessageTypeName, Node, NodeName, NodeOptions, ParameterValue, ROSTime,
};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, RTPSEntity, TopicDescription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::addresses::AddressWatchdog;
use crate::arguments::NodeIdentity;
use crate::dds_deadlock::DeadlockWatchdog;
use crate::dds_liveness::LivenessWatchdog;
use crate::dds_state_writer::StateWriter;
use crate::environment::{DiscoveryRange, Environment};
use crate::fast_dds;
use crate::interfaces::{discovery_obstacle, interfaces};
use crate::parameters::Parameters;
use crate::participant_events::ParticipantEvents;
use crate::publisher_queue::Sink;
use crate::raw_sample::{RawSample, Undecoded};
use crate::ros_context_error::{RosContextError, bad_name, library_name};
use crate::service_mapping::ServiceMapping;
use crate::stamp::nanoseconds_since_epoch;
use crate::subscription::{ParticipantId, SampleOrigin, Taken};
use crate::topic::Topic;
use crate::wall_clock::WallClockWatchdog;

/// A process's place in the ROS 2 graph over DDS.
///
/// The library's spinner does not run. It would subscribe `/clock` with a type that no other node uses, and all of
/// `ros_discovery_info`, whose discovery traffic grows with the square of the number of processes.
pub(crate) struct DdsGraph {
    // Fields are dropped in the order in which they are declared.
    node: Rc<RefCell<Node>>,
    #[expect(
        dead_code,
        reason = "dropped after the node and before the participant"
    )]
    context: Context,
    pub(crate) participant: DomainParticipant,
    pub(crate) events: ParticipantEvents,
    /// The topics that are subscribed, as the library names them.
    subscribed: BTreeSet<String>,
    liveness: LivenessWatchdog,
    addresses: AddressWatchdog,
    wall_clock: WallClockWatchdog,
    deadlock: Rc<DeadlockWatchdog>,
    pub(crate) service_mapping: ServiceMapping,
}

impl DdsGraph {
    /// Joins the graph of a domain.
    ///
    /// # Errors
    /// Refuses names that are not ROS 2 names, and a machine on which the processes cannot discover each other; passes
    /// on what the DDS library refuses, such as a domain that is full.
    pub(crate) fn join(
        environment: Environment,
        identity: &NodeIdentity,
        parameters: &Parameters,
        service_mapping: ServiceMapping,
    ) -> Result<Self, RosContextError> {
        let node_name = NodeName::new(identity.namespace.as_str(), &identity.name)
            .map_err(|error| bad_name(&identity.fully_qualified(), &error))?;
        let domain = environment.domain.number();
        let failed = |what: &str, reason: &dyn ToString| library_error(what, domain, reason);
        for sentence in environment.without_effect_over_dds() {
            tracing::warn!("{sentence}");
        }
        let addresses = AddressWatchdog::before_participant(environment.range);
        let wall_clock = WallClockWatchdog::before_participant();
        let liveness = LivenessWatchdog::before_participant();
        let deadlock = DeadlockWatchdog::start(Arc::clone(&liveness.threads))
            .map_err(|error| failed("watch the DDS library", &error))?;
        let participant = deadlock
            .watch(|| participant_builder(domain, environment.range).build())
            .map_err(|error| failed("create a DDS participant", &error))?;
        let participants = participant.participant_id().saturating_add(1);
        if let Some(obstacle) = discovery_obstacle(environment.range, &interfaces(), participants) {
            return Err(RosContextError::BadInput(obstacle));
        }
        fast_dds::meet(&participant);
        let context = deadlock
            .watch(|| Context::from_domain_participant(participant.clone()))
            .map_err(|error| failed("create a ROS 2 context", &error))?;
        let node = deadlock
            .watch(|| context.new_node(node_name, node_options(parameters)))
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
            node: Rc::new(RefCell::new(node)),
            context,
            events: ParticipantEvents::of(&participant),
            subscribed: BTreeSet::new(),
            participant,
            liveness,
            addresses,
            wall_clock,
            deadlock: Rc::new(deadlock),
            service_mapping,
        })
    }

    /// The participant of this process, as receivers see it in the samples that it sends.
    pub(crate) fn participant(&self) -> ParticipantId {
        ParticipantId::of_prefix(self.participant.guid().prefix.as_ref())
    }

    /// Takes in the library's events, and fails once it has stopped receiving, does not receive at an address of this machine or from a
    /// publisher that is back, or gives out no heartbeats as the clock was set back; only a new participant receives them.
    pub(crate) fn check_reception(&self) -> Result<(), RosContextError> {
        if !self.liveness.is_alive() {
            return Err(RosContextError::NotReceiving);
        }
        if let Some(step) = self.wall_clock.set_back_by() {
            return Err(RosContextError::ClockSetBack(step));
        }
        if let Some(addresses) = self.addresses.unreached() {
            return Err(RosContextError::NewAddresses(addresses));
        }
        match self.topic_of_returned() {
            Some(topic) => Err(RosContextError::PublisherIsBack(topic)),
            None => Ok(()),
        }
    }

    /// A subscribed topic that a participant publishes which was lost and is back. Who publishes nothing to this process may be lost for it.
    fn topic_of_returned(&self) -> Option<String> {
        let returned = self.events.take_returned();
        if returned.is_empty() {
            return None;
        }
        let mut writers = self.participant.discovered_writers().into_iter();
        let publishes = |topic: &str, writer: GUID| {
            self.subscribed.contains(topic)
                && returned.contains(&ParticipantId::of_prefix(writer.prefix.as_ref()))
        };
        let topic = writers.find_map(|writer| {
            let data = writer.publication_topic_data;
            publishes(&data.topic_name, data.key).then_some(data.topic_name)
        })?;
        Some(topic.strip_prefix("rt").unwrap_or(&topic).to_owned())
    }

    /// Publishes a topic under its fully qualified name.
    pub(crate) fn publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<Sink<M>, RosContextError> {
        let quality = topic.quality().publisher_qos();
        let dds_topic = self.dds_topic(topic, name, &quality)?;
        let publisher = self.create(&format!("publish `{name}`"), |node| {
            node.create_publisher(&dds_topic, Some(quality))
        })?;
        Ok(Box::new(move |sample| publisher.publish(sample)))
    }

    /// Publishes a latched topic under its fully qualified name, without what was replaced.
    pub(crate) fn state_publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<Sink<M>, RosContextError> {
        let quality = topic.quality().publisher_qos();
        let dds_topic = self.dds_topic(topic, name, &quality)?;
        let what = format!("publish `{name}`");
        let first = self.create(&what, |node| {
            node.create_publisher(&dds_topic, Some(quality.clone()))
        })?;
        // The queue may outlive the graph, and then writes with what it has.
        let (node, deadlock) = (Rc::downgrade(&self.node), Rc::downgrade(&self.deadlock));
        let create = move || {
            let (node, deadlock) = (node.upgrade()?, deadlock.upgrade()?);
            let mut node = node.borrow_mut();
            let created =
                deadlock.watch(|| node.create_publisher::<M>(&dds_topic, Some(quality.clone())));
            created
                .inspect_err(|error| tracing::warn!("cannot {what} anew: {error}"))
                .ok()
        };
        let writer = StateWriter::new(first, create);
        Ok(Box::new(move |sample| {
            writer.write(Instant::now(), sample, |publisher, sample| {
                publisher.publish(sample)
            })
        }))
    }

    /// Subscribes a topic under its fully qualified name.
    pub(crate) fn subscription<M: DeserializeOwned + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<M>>, RosContextError> {
        let quality = topic.quality().subscription_qos();
        let dds_topic = self.dds_topic(topic, name, &quality)?;
        self.subscribed.insert(TopicDescription::name(&dds_topic));
        let subscription = self.create(&format!("subscribe `{name}`"), |node| {
            node.create_subscription::<M>(&dds_topic, Some(quality))
        })?;
        let samples =
            poll_fn(move |context| pin!(subscription.async_take()).poll(context).map(Some));
        let taken = samples.map(|taken| match taken {
            Ok((sample, info)) => Taken::Sample(origin_of(&info), sample),
            Err(error) => Taken::Malformed(error.to_string()),
        });
        Ok(taken.boxed_local())
    }

    /// Subscribes a topic under its fully qualified name, without decoding its samples.
    pub(crate) fn raw_subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<RawSample>>, RosContextError> {
        let quality = topic.quality().subscription_qos();
        let dds_topic = self.dds_topic(topic, name, &quality)?;
        self.subscribed.insert(TopicDescription::name(&dds_topic));
        let participant = self.participant.clone();
        let quality = QosPolicies::from(quality);
        let reader = self.create(&format!("subscribe `{name}`"), |_| {
            let subscriber = participant.create_subscriber(&quality)?;
            subscriber.create_simple_datareader_no_key::<_, Undecoded>(&dds_topic, Some(quality))
        })?;
        let samples = poll_fn(move |context| pin!(reader.as_async_stream()).poll_next(context));
        let taken = samples.map(|taken| match taken {
            Ok(change) => {
                let info = MessageInfo::from(&change);
                Taken::Sample(origin_of(&info), raw_sample(&info, change.into_value()))
            }
            Err(error) => Taken::Malformed(error.to_string()),
        });
        Ok(taken.boxed_local())
    }

    fn dds_topic<M>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
        quality: &QosProfile,
    ) -> Result<rustdds::Topic, RosContextError> {
        let library_name = library_name(name)?;
        let (package, type_name) = topic.type_name();
        let type_name = MessageTypeName::new(package, type_name);
        self.create(&format!("create topic `{name}`"), |node| {
            node.create_topic(&library_name, type_name, quality)
        })
    }

    /// Creates an endpoint, observed by both watchdogs.
    pub(crate) fn create<T, E: ToString>(
        &mut self,
        what: &str,
        create: impl FnOnce(&mut Node) -> Result<T, E>,
    ) -> Result<T, RosContextError> {
        let node = &mut *self.node.borrow_mut();
        let created = self.deadlock.watch(|| create(node));
        created.map_err(|error| {
            // Without its threads the library refuses everything.
            if self.liveness.threads.has_one_ended() {
                RosContextError::NotReceiving
            } else {
                library_error(what, node.domain_id(), &error)
            }
        })
    }

    /// Publishes a changed parameter on `/parameter_events`.
    pub(crate) fn announce_parameter(&mut self, name: &str, value: ParameterValue) {
        if let Err(reason) = self.node.borrow_mut().set_parameter(name, value) {
            tracing::warn!("could not announce the change of parameter {name}: {reason}");
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

fn library_error(what: &str, domain: u16, reason: &dyn ToString) -> RosContextError {
    let reason = reason.to_string();
    RosContextError::Failed(format!("cannot {what} in domain {domain}: {reason}"))
}

fn raw_sample(info: &MessageInfo, bytes: Vec<u8>) -> RawSample {
    let received = info.received_timestamp().and_then(nanoseconds);
    RawSample {
        publisher: u128::from_be_bytes(info.publisher_gid().to_bytes16()),
        sequence: u64::try_from(info.sequence_number()).unwrap_or_default(),
        sent_ns: origin_of(info).sent_ns,
        received_ns: received.unwrap_or_else(nanoseconds_since_epoch),
        bytes,
    }
}

fn origin_of(info: &MessageInfo) -> SampleOrigin {
    SampleOrigin {
        // The first twelve bytes of an endpoint's identifier are its participant's.
        participant: ParticipantId::of_prefix(&info.publisher_gid().to_bytes16()[..12]),
        sent_ns: info.source_timestamp().and_then(nanoseconds),
    }
}

fn nanoseconds(time: ROSTime) -> Option<u64> {
    u64::try_from(time.to_nanos()).ok()
}
