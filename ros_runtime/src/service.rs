//! Services as values, and serving them in the way that the client's middleware expects.

use std::future::Future;
use std::marker::PhantomData;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use async_io::Timer;
use futures::stream::{LocalBoxStream, poll_fn};
use futures::{Stream, StreamExt};
use ros2_client::qos::{History, QosProfile, Reliability, WhenFull};
use ros2_client::{ReadResult, RmwRequestId, Server, ServiceTypeName, WriteResult};
use rustdds::{DomainParticipant, RTPSEntity};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::arguments::Resource;
use crate::matched_readers::MatchedReaders;
use crate::session::{Session, SessionError, library_name};

/// A service that takes `Q` and answers `A`.
#[derive(Debug)]
pub struct Service<Q, A> {
    name: &'static str,
    package: &'static str,
    type_name: &'static str,
    types: PhantomData<fn(Q) -> A>,
}

impl<Q, A> Service<Q, A> {
    /// A service of type `package/srv/type_name`, whose name is expanded and remapped like every name.
    #[must_use]
    pub const fn new(name: &'static str, package: &'static str, type_name: &'static str) -> Self {
        Self {
            name,
            package,
            type_name,
            types: PhantomData,
        }
    }
}

/// Sends the answer to one request.
pub type Reply<A> = Box<dyn FnOnce(A)>;

/// A request and the means to answer it.
pub struct Call<Q, A> {
    /// What the client asks.
    pub request: Q,
    /// Sends the answer.
    pub reply: Reply<A>,
}

/// Which request a reply answers.
pub type RequestId = RmwRequestId;

/// Data on the wire, with the library's own trait, which types of other crates cannot have.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct Carried<T>(pub T);

impl<T: Serialize + DeserializeOwned> ros2_client::Message for Carried<T> {}

/// How many requests of one service can wait to be answered.
const WAITING_MAX: usize = 16;
/// A client whose subscription to replies is not discovered within this is answered all the same.
const CLIENT_WAIT: Duration = Duration::from_secs(1);
/// A subscription that was discovered this long ago is not waited for either: the library may have dropped its event.
const MATCH_WAIT: Duration = Duration::from_millis(250);
/// Between two looks for it.
const CLIENT_INTERVAL: Duration = Duration::from_millis(10);

/// A client's request and reply endpoints belong to one participant, whose identifier begins theirs. CycloneDDS leaves
/// only this many bytes of it in a request, and fills the rest with a number of its own.
const CLIENT_BYTES: usize = 8;

impl Session {
    /// Serves a service: the stream of the requests that decode.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn serve<Q, A>(
        &mut self,
        service: &Service<Q, A>,
    ) -> Result<LocalBoxStream<'static, Call<Q, A>>, SessionError>
    where
        Q: Serialize + DeserializeOwned + Clone + 'static,
        A: Serialize + DeserializeOwned + 'static,
    {
        let name = self.resolve(Resource::Service, service.name)?;
        let parsed = library_name(&name)?;
        let type_name = ServiceTypeName::new(service.package, service.type_name);
        let mapping = self.service_mapping.library();
        let server: Server<Carried<Q>, Carried<A>> = self
            .create(&format!("serve `{name}`"), |node| {
                node.create_server(mapping, &parsed, &type_name, service_qos(), service_qos())
            })?;
        let server = Rc::new(server);
        let clients = Clients::of(self, &name);
        let requests = {
            let server = Rc::clone(&server);
            poll_fn(move |context| poll_request(&server, context))
        };
        let calls = answerable(requests, &clients).map(move |(id, Carried(request))| {
            let (server, clients) = (Rc::clone(&server), Rc::clone(&clients));
            let reply =
                move |answer| clients.log_failure(&server.send_response(id, Carried(answer)));
            Call {
                request,
                reply: Box::new(reply) as Reply<A>,
            }
        });
        Ok(calls.boxed_local())
    }
}

/// Takes a request if one has arrived, and has the task woken when one does.
pub(crate) fn poll_request<Q, P>(
    server: &Server<Q, P>,
    context: &mut Context<'_>,
) -> Poll<Option<ReadResult<(RequestId, Q)>>>
where
    Q: ros2_client::Message + 'static,
    P: ros2_client::Message + 'static,
{
    pin!(server.async_receive_request()).poll(context).map(Some)
}

/// The clients of a service, as discovery shows them.
///
/// A client may ask before this process has matched its subscription to the replies, and would never receive an answer
/// that is sent at once. A request is therefore passed on when that subscription is matched.
pub(crate) struct Clients {
    service: String,
    participant: DomainParticipant,
    matched: MatchedReaders,
    reply_topic: String,
}

/// How far this process knows a client's subscription to the replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Subscription {
    Unknown,
    Discovered,
    Matched,
}

impl Clients {
    /// The clients of the service with this fully qualified name.
    pub(crate) fn of(session: &Session, name: &str) -> Rc<Self> {
        Rc::new(Self {
            participant: session.participant.clone(),
            matched: session.matched_readers.clone(),
            reply_topic: format!("rr{name}Reply"),
            service: name.to_owned(),
        })
    }

    /// Logs why an answer could not be sent, if it could not.
    pub(crate) fn log_failure(&self, sent: &WriteResult<(), ()>) {
        if let Err(error) = sent {
            tracing::warn!(service = self.service, "could not answer: {error}");
        }
    }

    /// Waits until a client's subscription to the replies is matched: for at most [`CLIENT_WAIT`] until it is
    /// discovered, and then for at most [`MATCH_WAIT`].
    async fn wait_for(&self, id: RequestId) {
        let mut deadline = Instant::now() + CLIENT_WAIT;
        let mut known = Subscription::Unknown;
        loop {
            let before = known;
            known = self.subscription(id);
            match known {
                Subscription::Matched => return,
                Subscription::Discovered if before == Subscription::Unknown => {
                    deadline = Instant::now() + MATCH_WAIT;
                }
                Subscription::Discovered | Subscription::Unknown => {}
            }
            if Instant::now() >= deadline {
                tracing::debug!(service = self.service, "a client's replies are {known:?}");
                return;
            }
            Timer::after(CLIENT_INTERVAL).await;
        }
    }

    fn subscription(&self, id: RequestId) -> Subscription {
        let client = &id.writer_gid.to_bytes16()[..CLIENT_BYTES];
        if self.participant.guid().to_bytes()[..CLIENT_BYTES] == *client {
            return Subscription::Matched;
        }
        let discovered = self.participant.discovered_readers();
        let mut readers = discovered
            .iter()
            .filter(|reader| *reader.subscription_topic_data.topic_name() == self.reply_topic)
            .map(|reader| reader.reader_proxy.remote_reader_guid)
            .filter(|reader| reader.to_bytes()[..CLIENT_BYTES] == *client)
            .peekable();
        if readers.peek().is_none() {
            Subscription::Unknown
        } else if readers.all(|reader| self.matched.contains(reader)) {
            Subscription::Matched
        } else {
            Subscription::Discovered
        }
    }
}

/// Every request of a stream, once its client can receive the answer. One that does not decode is logged and dropped.
pub(crate) fn answerable<Q: 'static>(
    requests: impl Stream<Item = ReadResult<(RequestId, Q)>> + 'static,
    clients: &Rc<Clients>,
) -> LocalBoxStream<'static, (RequestId, Q)> {
    let (refusing, waiting) = (Rc::clone(clients), Rc::clone(clients));
    requests
        .filter_map(move |taken| {
            let taken = taken.inspect_err(|error| {
                tracing::warn!(service = refusing.service, "refused a request: {error}");
            });
            std::future::ready(taken.ok())
        })
        .map(move |(id, request)| {
            let clients = Rc::clone(&waiting);
            async move {
                clients.wait_for(id).await;
                (id, request)
            }
        })
        .buffered(WAITING_MAX)
        .boxed_local()
}

/// The quality of service that ROS 2 gives to services.
pub(crate) fn service_qos() -> QosProfile {
    QosProfile::publisher_default()
        // The event loop must never wait inside the library.
        .reliability(Reliability::Reliable {
            when_full: WhenFull::Fail,
        })
        .history(History::KeepLast { depth: 10 })
}
