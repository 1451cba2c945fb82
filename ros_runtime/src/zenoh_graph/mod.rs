//! A process in the ROS 2 graph over Zenoh, as `rmw_zenoh_cpp` of ROS 2 Jazzy speaks it.
//!
//! A process is a Zenoh session and one node. Each endpoint has a liveliness token, by which tools list it. Topics that
//! are transient local use the advanced publishers and subscribers of `zenoh-ext`; a service is a queryable. Samples carry the identifier of
//! the session in Zenoh's own source field, because ROS 2's identifier in the attachment is one of the publisher: by the
//! session a receiver knows that two topics come from one process.

mod action;
mod configuration;
mod endpoints;
mod names;
pub mod protection;
mod refusals;
pub mod router;

use std::rc::Weak;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ros2_client::ParameterValue;
use ros2_client::builtin_interfaces::Time;
use ros2_client::parameters::raw;
use zenoh::config::WhatAmI;
use zenoh::liveliness::LivelinessToken;
use zenoh::sample::SampleKind;
use zenoh::session::TransportEventsListener;
use zenoh::{Config, Session, Wait};

use crate::arguments::NodeIdentity;
use crate::publisher_queue::Sink;
use crate::ros_context_error::RosContextError;
use crate::settings::Settings;
use crate::subscription::ParticipantId;
use crate::topic::{Quality, Topic};
use crate::type_hash::Interfaces;
use endpoints::{CachedTopic, Writer};
use names::{Gid, Kind, NodeKeys, Place, gid_of};

/// How long a process waits for its router when it starts.
const ROUTER_WAIT: Duration = Duration::from_secs(10);
/// Between two attempts.
const ROUTER_INTERVAL: Duration = Duration::from_millis(250);

/// The changes of parameters.
const PARAMETER_EVENTS: Topic<raw::ParameterEvent> = Topic::new(
    "/parameter_events",
    "rcl_interfaces",
    "ParameterEvent",
    Quality::ReliableVolatile { depth: 1_000 },
);

/// A process's place in the ROS 2 graph over Zenoh.
pub(crate) struct ZenohGraph {
    // Fields are dropped in the order in which they are declared.
    parameter_events: Option<Sink<raw::ParameterEvent>>,
    _node: LivelinessToken,
    keys: NodeKeys,
    interfaces: Interfaces,
    /// The number of the endpoint that was created last; the node is number 0.
    endpoints: u64,
    writers: Vec<Weak<Writer>>,
    cached_topics: Vec<CachedTopic>,
    reconnections: Reconnections,
    session: Session,
}

/// Whether the session has connected to a router since this was asked last.
struct Reconnections {
    happened: Arc<AtomicBool>,
    _listener: TransportEventsListener<()>,
}

impl Reconnections {
    fn of(session: &Session) -> Result<Self, RosContextError> {
        let happened = Arc::new(AtomicBool::new(false));
        let noticed = Arc::clone(&happened);
        let listener = session
            .info()
            .transport_events_listener()
            .callback(move |event| {
                if event.transport().whatami() != WhatAmI::Router {
                    return;
                }
                match event.kind() {
                    SampleKind::Put => noticed.store(true, Ordering::Relaxed),
                    SampleKind::Delete => tracing::warn!(
                        "lost the connection to the router; it is tried again until it is there"
                    ),
                }
            })
            .wait()
            .map_err(|error| failed("observe the connection to routers", &error))?;
        Ok(Self {
            happened,
            _listener: listener,
        })
    }
}

/// An endpoint that the graph shows until this is dropped.
struct Announced {
    key: String,
    gid: Gid,
    token: LivelinessToken,
}

impl ZenohGraph {
    /// Joins the graph of a domain.
    ///
    /// # Errors
    /// Says what is wrong with the configuration, or that there is no router.
    pub(crate) fn join(
        settings: &Settings,
        identity: &NodeIdentity,
    ) -> Result<Self, RosContextError> {
        let variable = |name: &str| std::env::var(name).ok();
        let config = configuration::of_session(variable).map_err(RosContextError::BadInput)?;
        protection::check_session(settings.security, &config)?;
        let interfaces = Interfaces::with(settings.interfaces).map_err(RosContextError::Failed)?;
        let session = opened(&config)?;
        let domain = settings.environment.domain.number();
        let keys = NodeKeys {
            domain,
            session: session.zid().to_string(),
            namespace: identity.namespace.to_string(),
            name: identity.name.clone(),
        };
        let token = declared(&session, &keys.token())?;
        tracing::info!(
            node = identity.fully_qualified(),
            domain,
            middleware = "zenoh",
            participant = keys.session,
            "joined the ROS 2 graph"
        );
        let reconnections = Reconnections::of(&session)?;
        Ok(Self {
            parameter_events: None,
            _node: token,
            keys,
            interfaces,
            endpoints: 0,
            writers: Vec::new(),
            cached_topics: Vec::new(),
            reconnections,
            session,
        })
    }

    /// The session of this process, as receivers see it in the samples that it sends.
    pub(crate) fn participant(&self) -> ParticipantId {
        ParticipantId(u128::from_le_bytes(self.session.zid().to_le_bytes()))
    }

    /// After a reconnection, sends the last samples of latched topics again, and queries those of others: either may have been
    /// sent while there was no connection.
    pub(crate) fn attend(&mut self) {
        if self.reconnections.happened.swap(false, Ordering::Relaxed) {
            tracing::info!("connected to a router again");
            self.writers.retain(|writer| writer.strong_count() > 0);
            for writer in self.writers.iter().filter_map(Weak::upgrade) {
                writer.repeat();
            }
            let session = &self.session;
            self.cached_topics.retain(|topic| topic.query(session));
        }
    }

    /// Shows an endpoint in the graph.
    fn announce(
        &mut self,
        kind: Kind,
        name: &str,
        type_name: &str,
        quality: Quality,
    ) -> Result<Announced, RosContextError> {
        let hash = self.interfaces.hash(type_name);
        let hash = hash.map_err(|reason| failed(&format!("use `{type_name}`"), &reason))?;
        let place = Place {
            name,
            type_name,
            hash: &hash,
        };
        self.endpoints += 1;
        let token = self
            .keys
            .endpoint_token(self.endpoints, kind, &place, quality);
        Ok(Announced {
            key: place.key(self.keys.domain),
            gid: gid_of(&token),
            token: declared(&self.session, &token)?,
        })
    }

    /// Publishes a changed parameter of the node on `/parameter_events`.
    pub(crate) fn announce_parameter(&mut self, name: &str, value: ParameterValue) {
        if self.parameter_events.is_none() {
            match self.publisher(&PARAMETER_EVENTS, "/parameter_events") {
                Ok(publisher) => self.parameter_events = Some(publisher),
                Err(error) => tracing::warn!("{error}"),
            }
        }
        let Some(publisher) = &self.parameter_events else {
            return;
        };
        let event = raw::ParameterEvent {
            stamp: Time::now(),
            node: self.keys.node(),
            new_parameters: Vec::new(),
            changed_parameters: vec![raw::Parameter {
                name: name.to_owned(),
                value: value.into(),
            }],
            deleted_parameters: Vec::new(),
        };
        if let Err(reason) = publisher(event) {
            tracing::warn!("could not announce the change of parameter {name}: {reason}");
        }
    }
}

/// A session that is connected to its router.
fn opened(config: &Config) -> Result<Session, RosContextError> {
    let deadline = Instant::now() + ROUTER_WAIT;
    let routers = config.get_json("connect/endpoints").unwrap_or_default();
    let mut is_waiting = false;
    loop {
        match zenoh::open(config.clone()).wait() {
            Ok(session) => return Ok(session),
            Err(error) if Instant::now() >= deadline => {
                return Err(RosContextError::Failed(format!(
                    "cannot reach a Zenoh router at {routers}: {error}; start one with `formation router` or `zenohd`, or \
                     name another in ZENOH_CONFIG_OVERRIDE"
                )));
            }
            Err(error) => {
                if !is_waiting {
                    tracing::info!("waiting for a Zenoh router at {routers}: {error}");
                }
                is_waiting = true;
                std::thread::sleep(ROUTER_INTERVAL);
            }
        }
    }
}

fn declared(session: &Session, token: &str) -> Result<LivelinessToken, RosContextError> {
    let declaration = session.liveliness().declare_token(token.to_owned()).wait();
    declaration.map_err(|error| failed(&format!("declare `{token}`"), &error))
}

fn failed(what: &str, reason: &dyn ToString) -> RosContextError {
    let reason = reason.to_string();
    RosContextError::Failed(format!("cannot {what} over Zenoh: {reason}"))
}
