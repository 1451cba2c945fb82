//! The middleware under a [`RosContext`](crate::ros_context::RosContext): what each must do for it.

use std::collections::BTreeSet;
use std::time::Duration;

use futures::stream::LocalBoxStream;
use ros2_client::ParameterValue;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::action::{Action, OpenedAction};
use crate::arguments::NodeIdentity;
use crate::dds_graph::DdsGraph;
use crate::middleware::Middleware;
use crate::parameters::Parameters;
use crate::publisher_queue::Sink;
use crate::raw_sample::RawSample;
use crate::ros_context_error::RosContextError;
use crate::security::DDS_SHORTFALL;
use crate::service::{Call, DeclaredService, ServiceData};
use crate::service_mapping::ServiceMapping;
use crate::settings::Settings;
use crate::subscription::{ParticipantId, Taken};
use crate::topic::Topic;
#[cfg(feature = "zenoh")]
use crate::zenoh_graph::ZenohGraph;

/// A process's place in the ROS 2 graph, over one middleware. Names are fully qualified, and remapped already.
pub(crate) enum Graph {
    Dds(Box<DdsGraph>),
    #[cfg(feature = "zenoh")]
    Zenoh(Box<ZenohGraph>),
}

/// Calls the same function of either middleware.
macro_rules! of_either {
    ($graph:expr, $either:ident => $call:expr) => {
        match $graph {
            Graph::Dds($either) => $call,
            #[cfg(feature = "zenoh")]
            Graph::Zenoh($either) => $call,
        }
    };
}

impl Graph {
    /// Joins the graph, unless messages must be protected and would not be.
    pub(crate) fn join(
        settings: &Settings,
        identity: &NodeIdentity,
        parameters: &Parameters,
        service_mapping: ServiceMapping,
    ) -> Result<Self, RosContextError> {
        match settings.middleware {
            Middleware::Dds => {
                let allowed = settings.security.without(DDS_SHORTFALL);
                allowed.map_err(RosContextError::BadInput)?;
                let environment = settings.environment;
                let graph = DdsGraph::join(environment, identity, parameters, service_mapping)?;
                Ok(Self::Dds(Box::new(graph)))
            }
            #[cfg(feature = "zenoh")]
            Middleware::Zenoh => Ok(Self::Zenoh(Box::new(ZenohGraph::join(settings, identity)?))),
            #[cfg(not(feature = "zenoh"))]
            Middleware::Zenoh => Err(RosContextError::BadInput(
                crate::middleware::NOT_BUILT.to_owned(),
            )),
        }
    }

    /// This process, as receivers see it in the samples that it sends.
    pub(crate) fn participant(&self) -> ParticipantId {
        of_either!(self, graph => graph.participant())
    }

    /// Takes in what happened in the graph; to be called between the inputs of the event loop.
    ///
    /// # Errors
    /// The middleware no longer receives, or not at all addresses of this machine.
    pub(crate) fn attend(&mut self) -> Result<(), RosContextError> {
        match self {
            Self::Dds(graph) => graph.check_reception(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(graph) => {
                graph.attend();
                Ok(())
            }
        }
    }

    /// The participants that have left the graph by themselves since the last call.
    pub(crate) fn departed(&mut self) -> Vec<ParticipantId> {
        match self {
            Self::Dds(graph) => graph.events.take_departed(),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(_) => Vec::new(),
        }
    }

    /// Whether a process is known that subscribes what this one publishes; `None` over Zenoh, where publishers do not see
    /// subscribers.
    pub(crate) fn has_subscribers(&self) -> Option<bool> {
        match self {
            Self::Dds(graph) => Some(graph.events.is_any()),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(_) => None,
        }
    }

    /// Publishes a topic.
    pub(crate) fn publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<Sink<M>, RosContextError> {
        of_either!(self, graph => graph.publisher(topic, name))
    }

    /// Publishes a latched topic, without what was replaced.
    pub(crate) fn state_publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<Sink<M>, RosContextError> {
        match self {
            Self::Dds(graph) => graph.state_publisher(topic, name),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(graph) => graph.publisher(topic, name),
        }
    }

    /// Subscribes a topic.
    pub(crate) fn subscription<M: DeserializeOwned + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<M>>, RosContextError> {
        of_either!(self, graph => graph.subscription(topic, name))
    }

    /// Subscribes a topic without decoding its samples.
    pub(crate) fn raw_subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<RawSample>>, RosContextError> {
        of_either!(self, graph => graph.raw_subscription(topic, name))
    }

    /// The names of the discovered services whose last part is `name`.
    pub(crate) fn services_named(&self, name: &str) -> Result<BTreeSet<String>, RosContextError> {
        match self {
            Self::Dds(graph) => Ok(graph.services_named(name)),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(_) => Err(calls_no_services()),
        }
    }

    /// Calls a service, and waits for the answer.
    pub(crate) fn call<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
        request: &Q,
        limit: Duration,
    ) -> Result<Option<A>, RosContextError> {
        match self {
            Self::Dds(graph) => graph.call(service, name, request, limit),
            #[cfg(feature = "zenoh")]
            Self::Zenoh(_) => Err(calls_no_services()),
        }
    }

    /// Serves a service.
    pub(crate) fn serve<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Call<Q, A>>, RosContextError> {
        of_either!(self, graph => graph.serve(service, name))
    }

    /// Serves an action.
    pub(crate) fn serve_action<G: ServiceData, R: ServiceData, F: ServiceData>(
        &mut self,
        action: &Action<G, R, F>,
        name: &str,
    ) -> Result<OpenedAction<G, R, F>, RosContextError> {
        of_either!(self, graph => graph.serve_action(action, name))
    }

    /// Publishes a changed parameter of the node on `/parameter_events`.
    pub(crate) fn announce_parameter(&mut self, name: &str, value: ParameterValue) {
        of_either!(self, graph => graph.announce_parameter(name, value));
    }
}

#[cfg(feature = "zenoh")]
fn calls_no_services() -> RosContextError {
    RosContextError::BadInput(
        "services are not called over Zenoh: use `ros2 service call`, with the command in docs/ros2.md".to_owned(),
    )
}
