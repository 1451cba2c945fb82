//! Services over DDS: requests wait until their client can receive the answer.

use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use async_io::Timer;
use futures::stream::{LocalBoxStream, poll_fn};
use futures::{Stream, StreamExt};
use ros2_client::{ReadResult, Server, ServiceTypeName, WriteResult};
use rustdds::{DomainParticipant, RTPSEntity};

use crate::dds_graph::DdsGraph;
use crate::participant_events::ParticipantEvents;
use crate::ros_context_error::{RosContextError, library_name};
use crate::service::{Call, Carried, DeclaredService, Reply, RequestId, ServiceData, WAITING_MAX};
use crate::topic::Quality;

/// A client whose subscription to replies is not discovered within this is answered all the same.
const CLIENT_WAIT: Duration = Duration::from_secs(1);
/// A subscription that was discovered this long ago is not waited for either: the library may have dropped its event.
const MATCH_WAIT: Duration = Duration::from_millis(250);
/// Between two looks for it.
const CLIENT_INTERVAL: Duration = Duration::from_millis(10);

/// A client's request and reply endpoints belong to one participant, whose identifier begins theirs. CycloneDDS leaves
/// only this many bytes of it in a request, and fills the rest with a number of its own.
const CLIENT_BYTES: usize = 8;

impl DdsGraph {
    /// Serves a service under its fully qualified name.
    pub(crate) fn serve<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Call<Q, A>>, RosContextError> {
        let parsed = library_name(name)?;
        let (package, type_name) = service.type_name();
        let type_name = ServiceTypeName::new(package, type_name);
        let mapping = self.service_mapping.library();
        let server: Server<Carried<Q>, Carried<A>> =
            self.create(&format!("serve `{name}`"), |node| {
                let quality = || SERVICE.publisher_qos();
                node.create_server(mapping, &parsed, &type_name, quality(), quality())
            })?;
        let server = Rc::new(server);
        let clients = Clients::of(self, name);
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
    matched: ParticipantEvents,
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
    pub(crate) fn of(graph: &DdsGraph, name: &str) -> Rc<Self> {
        Rc::new(Self {
            participant: graph.participant.clone(),
            matched: graph.events.clone(),
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

/// The quality that ROS 2 gives to services.
pub(crate) const SERVICE: Quality = Quality::ReliableVolatile { depth: 10 };
