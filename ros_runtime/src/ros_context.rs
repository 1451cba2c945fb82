//! One process in the ROS 2 graph, over whichever middleware it uses.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::{Rc, Weak};
use std::time::Duration;

use futures::stream::LocalBoxStream;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::action::{Action, ActionServer, FEEDBACK, STATUS, ServedAction};
use crate::arguments::{NodeIdentity, RemapRules, Resource};
use crate::graph::Graph;
use crate::logging;
use crate::parameters::{NodeParameters, Parameters, Tunables};
use crate::publisher_queue::{Flush, PublisherQueue, Sink};
use crate::raw_sample::RawSample;
use crate::ros_context_error::bad_name;
use crate::rosout::LogLines;
use crate::service::{Call, DeclaredService, ServiceData};
use crate::settings::Settings;
use crate::subscription::accepted;
use crate::topic::{Quality, Topic};
use crate::topic_statistics::SharedStatistics;

pub use crate::ros_context_error::RosContextError;
pub use crate::subscription::{ParticipantId, SampleOrigin};

/// A process's place in the ROS 2 graph.
///
/// Drop every queue before the context: endpoints, node and participant then leave the graph in this order, and at once.
/// The node of a process that ends otherwise stays listed until its lease runs out.
pub struct RosContext {
    pub(crate) graph: Graph,
    identity: NodeIdentity,
    remaps: RemapRules,
    pub(crate) parameters: Parameters,
    pub(crate) log: Option<LogLines>,
    statistics: SharedStatistics,
    queues: Vec<Weak<RefCell<dyn Flush>>>,
}

impl RosContext {
    /// Joins the graph as the node `name` in the namespace of the settings, unless remapping rules change either.
    ///
    /// # Errors
    /// Refuses names that are not ROS 2 names, a machine on which the processes cannot discover each other, and a middleware
    /// that the program was built without; passes on what the middleware refuses, such as a domain that is full.
    pub fn join(
        settings: &Settings,
        name: &str,
        parameters: Parameters,
    ) -> Result<Self, RosContextError> {
        let identity = settings.identity(name);
        logging::follow(&identity.logger(), &settings.ros.log);
        let of_every_node = NodeParameters::default().read(parameters.values())?;
        let service_mapping = of_every_node
            .service_mapping
            .unwrap_or(settings.service_mapping);
        Ok(Self {
            graph: Graph::join(settings, &identity, &parameters, service_mapping)?,
            identity,
            remaps: settings.ros.remaps.clone(),
            parameters,
            log: settings.log.clone(),
            statistics: SharedStatistics::default(),
            queues: Vec::new(),
        })
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
        self.graph.participant()
    }

    /// Whether a process is known that subscribes what this one publishes, which every ROS 2 node does over DDS; `None`
    /// over Zenoh, which does not say.
    #[must_use]
    pub fn has_subscribers(&self) -> Option<bool> {
        self.graph.has_subscribers()
    }

    /// The participants that have left the graph by themselves since the last call; none over Zenoh, which does not say.
    pub fn departed(&mut self) -> Vec<ParticipantId> {
        self.graph.departed()
    }

    /// The counts of samples, which the queues of this context write.
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
    ) -> Result<PublisherQueue<M>, RosContextError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let sink = self.graph.publisher(topic, &name)?;
        Ok(self.queue(topic.name(), topic.quality(), sink))
    }

    /// Publishes a latched topic whose late subscribers get the present sample, and none that it replaced, unless changes followed each
    /// other within half a second. Over DDS tools show one more publisher, which writes the next change.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn state_publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<PublisherQueue<M>, RosContextError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let sink = self.graph.state_publisher(topic, &name)?;
        Ok(self.queue(topic.name(), topic.quality(), sink))
    }

    /// Subscribes a topic: every sample of other participants that decodes and that `convert` accepts. Samples
    /// that are refused are counted and logged.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn subscription<M: DeserializeOwned + 'static, T: 'static>(
        &mut self,
        topic: &Topic<M>,
        convert: impl FnMut(SampleOrigin, M) -> Result<T, String> + 'static,
    ) -> Result<LocalBoxStream<'static, T>, RosContextError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let samples = self.graph.subscription(topic, &name)?;
        let (own, statistics) = (self.participant(), self.statistics());
        Ok(accepted(samples, own, topic.name(), statistics, convert))
    }

    /// Subscribes a topic without decoding its samples, those that do not decode included.
    ///
    /// Over DDS, tools list the subscription without its node: the library registers with a node only the subscriptions
    /// that decode.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn raw_subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<LocalBoxStream<'static, RawSample>, RosContextError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let samples = self.graph.raw_subscription(topic, &name)?;
        let (own, statistics) = (self.participant(), self.statistics());
        let convert = |_, sample| Ok(sample);
        Ok(accepted(samples, own, topic.name(), statistics, convert))
    }

    /// Serves a service: the stream of the requests that decode.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn serve<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
    ) -> Result<LocalBoxStream<'static, Call<Q, A>>, RosContextError> {
        let name = self.resolve(Resource::Service, service.name)?;
        self.graph.serve(service, &name)
    }

    /// The fully qualified names of the services whose last part is `name`, as far as they are discovered.
    ///
    /// # Errors
    /// Over Zenoh, where this program calls no services.
    pub fn services_named(&self, name: &str) -> Result<BTreeSet<String>, RosContextError> {
        self.graph.services_named(name)
    }

    /// Calls the service with this fully qualified name, and waits for the answer; `None` if none comes within the limit. The request
    /// may arrive more than once.
    ///
    /// # Errors
    /// Over Zenoh, where this program calls no services; or the library refuses.
    pub fn call<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
        request: &Q,
        limit: Duration,
    ) -> Result<Option<A>, RosContextError> {
        self.graph.call(service, name, request, limit)
    }

    /// Serves an action.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn serve_action<G: ServiceData, R: ServiceData, F: ServiceData>(
        &mut self,
        action: &Action<G, R, F>,
    ) -> Result<ServedAction<G, R, F>, RosContextError> {
        let name = self.resolve(Resource::Service, action.name)?;
        let (endpoints, requests) = self.graph.serve_action(action, &name)?;
        let server = ActionServer {
            goal: endpoints.goal,
            cancellation: endpoints.cancellation,
            result: endpoints.result,
            feedback: self.queue("feedback", FEEDBACK, endpoints.feedback),
            status: self.queue("status", STATUS, endpoints.status),
        };
        Ok((server, requests))
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

    /// The fully qualified name of the topic or service that this node calls `name`.
    ///
    /// # Errors
    /// The name, or its remapping, cannot be used.
    pub fn resolve(&self, resource: Resource, name: &str) -> Result<String, RosContextError> {
        let resolved = self.remaps.resolve(resource, name, &self.identity);
        resolved.map_err(|reason| bad_name(name, &reason))
    }
}

/// Takes part in the graph, and again with a new context whenever the DDS library no longer receives all that it is
/// to.
///
/// # Errors
/// The graph could not be joined, or the node could not go on.
pub fn rejoining<T>(
    mut take_part: impl FnMut() -> Result<T, RosContextError>,
) -> Result<T, RosContextError> {
    loop {
        match take_part() {
            Err(error) if error.ends_with_rejoining() => {
                tracing::warn!("{error}; joining the ROS 2 graph again");
            }
            end => return end,
        }
    }
}
