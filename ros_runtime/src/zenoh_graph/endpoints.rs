//! Publishers, subscriptions and services over Zenoh.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::time::Duration;

use async_channel::{Receiver, Sender, bounded};
use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros2_client::WriteError;
use ros2_client::qos::History;
use serde::Serialize;
use serde::de::DeserializeOwned;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Reliability};
use zenoh::query::{ConsolidationMode, Query, ReplyKeyExpr};
use zenoh::sample::{Locality, Sample, SourceInfo};
use zenoh::{Session, Wait};
use zenoh_ext::{
    AdvancedPublisher, AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig,
    HistoryConfig, MissDetectionConfig, RecoveryConfig,
};

use super::names::{Attachment, Gid, Kind};
use super::{Announced, ZenohGraph, failed};
use crate::cdr;
use crate::publisher_queue::Sink;
use crate::raw_sample::RawSample;
use crate::ros_context_error::RosContextError;
use crate::service::{Call, DeclaredService, Reply, RequestId, WAITING_MAX};
use crate::stamp::{nanoseconds_since_epoch, since_epoch};
use crate::subscription::{ParticipantId, SampleOrigin, Taken};
use crate::topic::{Quality, Topic};

/// A publisher of a latched topic reports at most this often how many samples it has sent, so that a subscription notices
/// the loss of the last one. `rmw_zenoh_cpp` uses the same period.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// How long a query for earlier samples may take.
const QUERY_LIMIT: Duration = Duration::from_secs(60);

/// The quality that ROS 2 gives to services.
const SERVICE: Quality = Quality::ReliableVolatile { depth: 10 };

/// A request with the means to answer it.
pub(super) type Asked<Q, A> = (RequestId, Q, Reply<A>);

/// A publisher, with a cache if its topic is latched.
pub(super) enum Writer {
    Plain(Publisher<'static>),
    Cached {
        publisher: AdvancedPublisher<'static>,
        /// The sample that was sent last.
        last: RefCell<Option<(Vec<u8>, Attachment)>>,
    },
}

impl Writer {
    fn put(&self, payload: Vec<u8>, attachment: Attachment) -> zenoh::Result<()> {
        match self {
            Self::Plain(publisher) => {
                // The number wraps; receivers only need the publisher.
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let number = attachment.sequence as u32;
                let put = publisher.put(payload).attachment(attachment.to_bytes());
                put.source_info(SourceInfo::new(publisher.id(), number))
                    .wait()
            }
            Self::Cached { publisher, last } => {
                last.replace(Some((payload.clone(), attachment)));
                // It sets the source itself.
                let put = publisher.put(payload);
                put.attachment(attachment.to_bytes()).wait()
            }
        }
    }

    /// Sends the last sample again. By its number, subscriptions notice which samples did not reach them, and query these.
    pub(super) fn repeat(&self) {
        let Self::Cached { publisher, last } = self else {
            return;
        };
        if let Some((payload, attachment)) = last.borrow().clone() {
            let put = publisher.put(payload).attachment(attachment.to_bytes());
            if let Err(error) = put.wait() {
                tracing::warn!("could not send a sample again: {error}");
            }
        }
    }
}

/// What takes samples from the library's threads.
type Take = dyn Fn(Sample) + Send + Sync;

/// A subscription whose publishers have caches.
pub(super) struct CachedTopic {
    key: String,
    depth: usize,
    /// Gone with the subscription.
    take: Weak<Take>,
}

impl CachedTopic {
    /// Takes the samples in the caches again, unless the subscription has ended; returns whether it has not.
    pub(super) fn query(&self, session: &Session) -> bool {
        let Some(take) = self.take.upgrade() else {
            return false;
        };
        let selector = format!("{}/@adv/pub/**?_max={}", self.key, self.depth);
        let query = session
            .get(selector)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .timeout(QUERY_LIMIT)
            .callback(move |reply| {
                if let Ok(sample) = reply.into_result() {
                    take(sample);
                }
            });
        if let Err(error) = query.wait() {
            tracing::warn!(topic = self.key, "could not query caches: {error}");
        }
        true
    }
}

impl ZenohGraph {
    /// Publishes a topic under its fully qualified name.
    pub(crate) fn publisher<M: Serialize + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<Sink<M>, RosContextError> {
        self.typed_publisher(name, &message_type(topic), topic.quality())
    }

    /// Publishes a topic of any type.
    pub(super) fn typed_publisher<M: Serialize + 'static>(
        &mut self,
        name: &str,
        type_name: &str,
        quality: Quality,
    ) -> Result<Sink<M>, RosContextError> {
        let Announced { key, gid, token } =
            self.announce(Kind::Publisher, name, type_name, quality)?;
        let reliability = match quality {
            Quality::BestEffort => Reliability::BestEffort,
            Quality::TransientLocal { .. } | Quality::ReliableVolatile { .. } => {
                Reliability::Reliable
            }
        };
        let publisher = self
            .session
            .declare_publisher(key)
            .reliability(reliability)
            .congestion_control(CongestionControl::Drop);
        let writer = match quality {
            Quality::TransientLocal { depth } => publisher
                .cache(CacheConfig::default().max_samples(depth.max(1)))
                .sample_miss_detection(MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT))
                .publisher_detection()
                .wait()
                .map(|publisher| Writer::Cached {
                    publisher,
                    last: RefCell::default(),
                }),
            Quality::ReliableVolatile { .. } | Quality::BestEffort => {
                publisher.wait().map(Writer::Plain)
            }
        };
        let writer = writer.map_err(|error| failed(&format!("publish `{name}`"), &error))?;
        let writer = Rc::new(writer);
        self.writers.push(Rc::downgrade(&writer));
        let sequence = Cell::new(0);
        Ok(Box::new(move |sample| {
            // The graph shows the publisher as long as it can be used.
            let _shown = &token;
            let payload = match cdr::encoded(&sample) {
                Ok(payload) => payload,
                Err(reason) => {
                    return Err(WriteError::Serialization {
                        reason,
                        data: sample,
                    });
                }
            };
            sequence.set(sequence.get() + 1);
            let sent = writer.put(payload, attachment(sequence.get(), gid));
            sent.map_err(|error| WriteError::Middleware {
                reason: error.to_string(),
                data: sample,
            })
        }))
    }

    /// Subscribes a topic under its fully qualified name. Samples of this session are left out.
    pub(crate) fn subscription<M: DeserializeOwned + 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<M>>, RosContextError> {
        let samples = self.raw_subscription(topic, name)?;
        let decoded = samples.map(|taken| match taken {
            Taken::Sample(origin, raw) => match cdr::decoded(&raw.bytes) {
                Ok(sample) => Taken::Sample(origin, sample),
                Err(reason) => Taken::Malformed(reason),
            },
            Taken::Malformed(reason) => Taken::Malformed(reason),
            Taken::Lost(count) => Taken::Lost(count),
        });
        Ok(decoded.boxed_local())
    }

    /// Subscribes without decoding the samples.
    pub(crate) fn raw_subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Taken<RawSample>>, RosContextError> {
        let quality = topic.quality();
        let Announced { key, token, .. } =
            self.announce(Kind::Subscription, name, &message_type(topic), quality)?;
        let (take, samples, lost) = queue(quality);
        let taken = Arc::clone(&take);
        let subscriber = self
            .session
            .declare_subscriber(key.clone())
            .allowed_origin(Locality::Remote)
            .callback(move |sample| taken(sample));
        let wrong = |error: zenoh::Error| failed(&format!("subscribe `{name}`"), &error);
        let taken = samples.map(|arrived| match arrived {
            Ok((participant, sample)) => {
                let sent_ns = sample.sent_ns;
                Taken::Sample(
                    SampleOrigin {
                        participant,
                        sent_ns,
                    },
                    sample,
                )
            }
            Err(reason) => Taken::Malformed(reason.to_owned()),
        });
        let with_losses = move |taken| match lost.swap(0, Ordering::Relaxed) {
            0 => vec![taken],
            lost => vec![Taken::Lost(lost), taken],
        };
        let taken = taken.flat_map(move |taken| futures::stream::iter(with_losses(taken)));
        // The subscriber and its token live as long as the stream.
        Ok(match quality {
            Quality::TransientLocal { depth } => {
                let depth = depth.max(1);
                // Publishers that appear later are not queried: their samples arrive as they are sent. A query for each
                // publisher by each subscription would be the most of the work with a hundred processes.
                let history = HistoryConfig::default().max_samples(depth);
                self.cached_topics.push(CachedTopic {
                    key,
                    depth,
                    take: Arc::downgrade(&take),
                });
                let held = subscriber
                    .history(history)
                    .recovery(RecoveryConfig::default().heartbeat())
                    .query_timeout(QUERY_LIMIT)
                    .wait()
                    .map_err(wrong)?;
                holding((held, token), taken)
            }
            Quality::ReliableVolatile { .. } | Quality::BestEffort => {
                let held = subscriber.wait().map_err(wrong)?;
                holding((held, token), taken)
            }
        })
    }

    /// Serves a service under its fully qualified name.
    pub(crate) fn serve<Q, A>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
    ) -> Result<LocalBoxStream<'static, Call<Q, A>>, RosContextError>
    where
        Q: DeserializeOwned + 'static,
        A: Serialize + 'static,
    {
        let (package, type_name) = service.type_name();
        let asked = self.typed_server(name, &format!("{package}/srv/{type_name}"))?;
        Ok(asked
            .map(|(_, request, reply)| Call { request, reply })
            .boxed_local())
    }

    /// Serves a service of any type.
    pub(super) fn typed_server<Q, A>(
        &mut self,
        name: &str,
        type_name: &str,
    ) -> Result<LocalBoxStream<'static, Asked<Q, A>>, RosContextError>
    where
        Q: DeserializeOwned + 'static,
        A: Serialize + 'static,
    {
        let Announced { key, token, .. } = self.announce(Kind::Server, name, type_name, SERVICE)?;
        let (sender, queries) = bounded::<Query>(WAITING_MAX);
        let full = name.to_owned();
        let queryable = self
            .session
            .declare_queryable(key)
            .complete(true)
            .callback(move |query| {
                if sender.try_send(query).is_err() {
                    tracing::warn!(
                        service = full,
                        "refused a request: {WAITING_MAX} wait already"
                    );
                }
            })
            .wait()
            .map_err(|error| failed(&format!("serve `{name}`"), &error))?;
        let service = name.to_owned();
        let asked = queries.filter_map(move |query| {
            let asked = asked(query, &service);
            let asked = asked.inspect_err(|reason| {
                tracing::warn!(service, "refused a request: {reason}");
            });
            std::future::ready(asked.ok())
        });
        Ok(holding((queryable, token), asked))
    }
}

/// The name of the type of a topic.
fn message_type<M>(topic: &Topic<M>) -> String {
    let (package, type_name) = topic.type_name();
    format!("{package}/msg/{type_name}")
}

/// Ties the lifetime of `held` to a stream.
fn holding<T: 'static>(
    held: impl Sized + 'static,
    stream: impl futures::Stream<Item = T> + 'static,
) -> LocalBoxStream<'static, T> {
    let stream = stream.map(move |item| {
        let _held = &held;
        item
    });
    stream.boxed_local()
}

/// What is sent with a sample.
fn attachment(sequence: i64, source: Gid) -> Attachment {
    Attachment {
        sequence,
        stamp_ns: since_epoch().as_nanos().try_into().unwrap_or(i64::MAX),
        source,
    }
}

/// A sample with the process that sent it, or why it is none of a ROS 2 publisher.
type Arrived = Result<(ParticipantId, RawSample), &'static str>;

/// The queue of a subscription: what takes samples from the library's threads, where they come out, and how many found no
/// room. A full queue drops its oldest sample, as a subscription over DDS does.
fn queue(quality: Quality) -> (Arc<Take>, Receiver<Arrived>, Arc<AtomicU64>) {
    let capacity = match quality.subscription_qos().history {
        History::KeepLast { depth } => depth.max(1),
        History::KeepAll => usize::from(u16::MAX),
    };
    let (sender, samples): (Sender<Arrived>, _) = bounded(capacity);
    let lost = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&lost);
    let take = move |sample: Sample| {
        if let Ok(Some(_)) = sender.force_send(arrived(&sample)) {
            counted.fetch_add(1, Ordering::Relaxed);
        }
    };
    (Arc::new(take), samples, lost)
}

fn arrived(sample: &Sample) -> Arrived {
    let sent = attachment_of(sample).ok_or("it has no attachment with its number and publisher")?;
    let number = |number: i64| u64::try_from(number).ok();
    let raw = RawSample {
        publisher: u128::from_le_bytes(sent.source),
        sequence: number(sent.sequence).ok_or("its number is negative")?,
        sent_ns: number(sent.stamp_ns),
        received_ns: nanoseconds_since_epoch(),
        bytes: sample.payload().to_bytes().into_owned(),
    };
    Ok((sender_of(sample, &sent), raw))
}

fn attachment_of(sample: &Sample) -> Option<Attachment> {
    let bytes = sample.attachment().map(|bytes| bytes.to_bytes());
    bytes.and_then(|bytes| Attachment::from_bytes(&bytes))
}

/// The session that sent a sample; where it does not name one, as samples of `rmw_zenoh_cpp` on topics that are not latched,
/// the publisher.
fn sender_of(sample: &Sample, sent: &Attachment) -> ParticipantId {
    let source = sample.source_info();
    let bytes = source.map_or(sent.source, |source| source.source_id().zid().to_le_bytes());
    ParticipantId(u128::from_le_bytes(bytes))
}

/// The request in a query.
fn asked<Q, A>(query: Query, service: &str) -> Result<Asked<Q, A>, String>
where
    Q: DeserializeOwned,
    A: Serialize,
{
    let sent = query.attachment().map(|bytes| bytes.to_bytes());
    let from = sent.and_then(|bytes| Attachment::from_bytes(&bytes));
    let from = from.ok_or("it has no attachment with its number and its client")?;
    let payload = query.payload().map(|payload| payload.to_bytes());
    let request = cdr::decoded(&payload.ok_or("it is empty")?)?;
    let id = RequestId {
        writer_gid: from.source.into(),
        sequence_number: from.sequence,
    };
    let service = service.to_owned();
    let reply = move |answer: A| {
        let sent = cdr::encoded(&answer).and_then(|payload| {
            query
                .reply(query.key_expr().clone(), payload)
                .attachment(attachment(from.sequence, from.source).to_bytes())
                .wait()
                .map_err(|error| error.to_string())
        });
        if let Err(reason) = sent {
            tracing::warn!(service, "could not answer: {reason}");
        }
    };
    Ok((id, request, Box::new(reply)))
}
