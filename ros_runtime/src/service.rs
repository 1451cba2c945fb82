//! Serving requests, in the way that the other side's middleware expects.

use std::time::{Duration, Instant};

use async_io::Timer;
use futures::stream::LocalBoxStream;
use futures::{Stream, StreamExt};
use ros2_client::qos::{History, QosProfile, Reliability, WhenFull};
use ros2_client::{ReadResult, RmwRequestId, Server, WriteResult};
use rustdds::{DomainParticipant, GUID, RTPSEntity};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::arguments::Resource;
use crate::session::{Session, SessionError};

/// A service as ROS 2 names it: `PACKAGE/srv/NAME`.
pub trait ServiceType {
    /// The package that defines it.
    const PACKAGE: &'static str;
    /// The service within the package.
    const NAME: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned + Clone + 'static;
    /// What is answered.
    type Response: Serialize + DeserializeOwned + 'static;
}

/// Declares the services that a part of a node serves: their types, a struct of their serving ends, and an enum of what one
/// of them was asked. Each line gives the type, its end's field, its name, and what is asked and answered.
#[macro_export]
macro_rules! services {
    (
        $(#[$about_ends:meta])*
        $ends:ident,
        $(#[$about_asked:meta])*
        $asked:ident in $package:literal:
        $($service:ident $field:ident $name:literal: $request:ty => $response:ty;)+
    ) => {
        $(
            pub struct $service;

            impl $crate::service::ServiceType for $service {
                const PACKAGE: &'static str = $package;
                const NAME: &'static str = stringify!($service);
                type Request = $request;
                type Response = $response;
            }
        )+

        $(#[$about_ends])*
        pub struct $ends {
            $(
                /// The server of this service.
                pub $field: $crate::service::ServiceServer<$service>,
            )+
        }

        $(#[$about_asked])*
        pub enum $asked {
            $(
                /// A request to this service.
                $service($crate::service::RequestId, $request),
            )+
        }

        impl $ends {
            /// Begins to serve.
            pub fn open(
                session: &mut $crate::session::Session,
            ) -> Result<Self, $crate::session::SessionError> {
                Ok(Self {
                    $($field: $crate::service::ServiceServer::open(session, $name)?,)+
                })
            }

            /// Every request that comes in, for ever.
            pub fn requests(&self) -> Vec<futures::stream::LocalBoxStream<'_, $asked>> {
                use futures::StreamExt;
                vec![$(
                    self.$field
                        .requests()
                        .map(|(id, request)| $asked::$service(id, request))
                        .boxed_local(),
                )+]
            }
        }
    };
}

/// What travels, with the library's own trait, which types of other crates cannot have.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Carried<T>(pub T);

impl<T: Serialize + DeserializeOwned> ros2_client::Message for Carried<T> {}

/// As many requests of one service wait to be answered.
const WAITING_MAX: usize = 16;
/// A client whose subscription to replies does not show by then is answered all the same.
const CLIENT_WAIT: Duration = Duration::from_secs(1);
/// Between two looks for it.
const CLIENT_INTERVAL: Duration = Duration::from_millis(10);

/// A client's request and reply ends belong to one participant. Its number begins an endpoint's identifier, but of that
/// CycloneDDS leaves us only so many bytes, and puts a number of its own into the rest.
const CLIENT_BYTES: usize = 8;

/// Which request a reply answers.
pub type RequestId = RmwRequestId;

/// The library's serving end of a service.
pub type LibraryServer<S> =
    Server<Carried<<S as ServiceType>::Request>, Carried<<S as ServiceType>::Response>>;

/// The serving end of a service.
pub struct ServiceServer<S: ServiceType> {
    server: LibraryServer<S>,
    clients: Clients,
}

impl<S: ServiceType> ServiceServer<S> {
    /// Serves `name`, which is expanded and remapped like every name.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn open(session: &mut Session, name: &str) -> Result<Self, SessionError> {
        let name = session.resolve(Resource::Service, name)?;
        Ok(Self {
            server: session.server::<S>(&name)?,
            clients: Clients::of(session, &name),
        })
    }

    /// The fully qualified name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.clients.service
    }

    /// Every request that comes in, for ever. One that does not decode is logged and dropped.
    pub fn requests(&self) -> LocalBoxStream<'_, (RequestId, S::Request)> {
        passed_on(self.server.receive_request_stream(), &self.clients)
            .map(|(id, Carried(request))| (id, request))
            .boxed_local()
    }

    /// Answers a request.
    pub fn answer(&self, id: RequestId, response: S::Response) {
        self.clients
            .note(&self.server.send_response(id, Carried(response)));
    }
}

/// The clients of a service, as discovery shows them.
///
/// A client may ask before this process has found its subscription to the replies, and would wait in vain for an answer
/// that is given at once. So a request is passed on when that subscription is known.
pub struct Clients {
    service: String,
    participant: DomainParticipant,
    reply_topic: String,
}

impl Clients {
    /// The clients of the service with this fully qualified name.
    pub fn of(session: &Session, name: &str) -> Self {
        Self {
            participant: session.participant(),
            reply_topic: format!("rr{name}Reply"),
            service: name.to_owned(),
        }
    }

    /// Logs what went wrong with an answer.
    pub fn note(&self, sent: &WriteResult<(), ()>) {
        if let Err(error) = sent {
            tracing::warn!(service = self.service, "could not answer: {error:?}");
        }
    }

    /// Waits until a client is seen to subscribe to the replies, but not for ever.
    async fn wait_for(&self, id: RequestId) {
        let deadline = Instant::now() + CLIENT_WAIT;
        let mut waited = false;
        while !self.knows(id) {
            if Instant::now() >= deadline {
                tracing::debug!(
                    service = self.service,
                    "a client shows no subscription to replies"
                );
                return;
            }
            waited = true;
            Timer::after(CLIENT_INTERVAL).await;
        }
        if waited {
            // What discovery knows reaches the sending end of the reply a moment later.
            Timer::after(CLIENT_INTERVAL).await;
        }
    }

    fn knows(&self, id: RequestId) -> bool {
        let client = &id.writer_gid.to_bytes16()[..CLIENT_BYTES];
        let is_own = self.participant.guid().to_bytes()[..CLIENT_BYTES] == *client;
        is_own
            || self.participant.discovered_readers().iter().any(|reader| {
                let guid: GUID = reader.reader_proxy.remote_reader_guid;
                guid.to_bytes()[..CLIENT_BYTES] == *client
                    && *reader.subscription_topic_data.topic_name() == self.reply_topic
            })
    }
}

/// Every request of a stream, as soon as its client can hear the answer. One that does not decode is logged and dropped.
pub fn passed_on<'a, Q: 'a>(
    requests: impl Stream<Item = ReadResult<(RequestId, Q)>> + 'a,
    clients: &'a Clients,
) -> LocalBoxStream<'a, (RequestId, Q)> {
    requests
        .filter_map(move |taken| async move {
            taken
                .inspect_err(|error| {
                    tracing::warn!(service = clients.service, "refused a request: {error}");
                })
                .ok()
        })
        .map(move |(id, request)| async move {
            clients.wait_for(id).await;
            (id, request)
        })
        .buffered(WAITING_MAX)
        .boxed_local()
}

/// What ROS 2 uses for services.
pub fn service_qos() -> QosProfile {
    QosProfile::publisher_default()
        // The loop must never wait inside the library.
        .reliability(Reliability::Reliable {
            when_full: WhenFull::Fail,
        })
        .history(History::KeepLast { depth: 10 })
}
