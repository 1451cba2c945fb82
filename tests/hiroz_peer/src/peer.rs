//! A node of hiroz that keeps what it receives.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use hiroz::attachment::{Attachment, GidArray};
use hiroz::dynamic::ros_type_name_from_dds;
use hiroz::entity::EndpointKind;
use hiroz::msg::{ZDeserializer, ZMessage, ZService};
use hiroz::prelude::{
    Builder, QosProfile, ServiceTypeInfo, TypeInfo, WithTypeInfo, ZContext, ZContextBuilder, ZNode,
    ZPub,
};
use serde::Serialize;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::time::{Instant, sleep, timeout_at};

pub type Result<T> = hiroz::Result<T>;

/// The longest time for anything that the peer waits for.
pub const LIMIT: Duration = Duration::from_secs(60);
/// Between two attempts to call a service.
const INTERVAL: Duration = Duration::from_millis(50);
/// The name of the node.
pub const NAME: &str = "hiroz_peer";

/// Prints what was done, as a line of JSON.
pub fn did(what: &str, mut more: Value) {
    more["did"] = what.into();
    println!("{more}");
}

/// What was received on a topic.
#[derive(Default)]
struct Received {
    samples: Vec<Value>,
    /// The last sequence number of each publisher.
    publishers: BTreeMap<GidArray, i64>,
    /// Samples whose number does not follow that of the sample before from the same publisher.
    out_of_order: usize,
    /// Why samples could not be decoded, or had no attachment that hiroz understands.
    refused: Vec<String>,
}

impl Received {
    fn add(&mut self, sample: std::result::Result<Value, String>, attachment: Option<Attachment>) {
        match sample {
            Ok(sample) => self.samples.push(sample),
            Err(error) => self.refused.push(error),
        }
        let Some(attachment) = attachment else {
            self.refused.push("no attachment".to_owned());
            return;
        };
        let number = attachment.sequence_number;
        let before = self.publishers.insert(attachment.source_gid, number);
        self.out_of_order += usize::from(before.is_some_and(|before| number <= before));
    }
}

/// The message in these bytes, after `handle` had it.
fn decoded<T>(bytes: &[u8], handle: impl FnOnce(&T)) -> std::result::Result<Value, String>
where
    T: ZMessage + Serialize,
    T::Serdes: for<'a> ZDeserializer<Input<'a> = &'a [u8], Output = T>,
{
    let message = T::deserialize(bytes).map_err(|error| error.to_string())?;
    handle(&message);
    // Decoding ignores bytes that follow the message.
    if ZMessage::serialize(&message) != bytes {
        return Err("hiroz encodes it to other bytes".to_owned());
    }
    serde_json::to_value(message).map_err(|error| error.to_string())
}

pub struct Peer {
    context: ZContext,
    pub node: Arc<ZNode>,
    namespace: String,
    received: Arc<Mutex<BTreeMap<String, Received>>>,
    changed: watch::Sender<()>,
    types: Mutex<BTreeMap<String, String>>,
}

impl Peer {
    pub fn connect(port: &str, domain: usize, namespace: &str) -> Result<Self> {
        let context = ZContextBuilder::default()
            .with_domain_id(domain)
            .with_namespace(namespace)
            .disable_multicast_scouting()
            .with_connect_endpoints([format!("tcp/127.0.0.1:{port}")])
            .with_listen_endpoints(["tcp/127.0.0.1:0"])
            .build()?;
        let node = Arc::new(context.create_node(NAME).build()?);
        Ok(Self {
            context,
            node,
            namespace: namespace.to_owned(),
            received: Arc::default(),
            changed: watch::Sender::new(()),
            types: Mutex::default(),
        })
    }

    pub fn context(&self) -> &ZContext {
        &self.context
    }

    /// A name within the namespace of the formation, unless it is absolute.
    pub fn path(&self, name: &str) -> String {
        if name.starts_with('/') {
            name.to_owned()
        } else {
            format!("{}/{name}", self.namespace)
        }
    }

    /// Records the hash with which hiroz looks for a type.
    pub fn note_type(&self, info: &TypeInfo) {
        let mut types = self.types.lock().unwrap_or_else(PoisonError::into_inner);
        types.insert(
            ros_type_name_from_dds(&info.name),
            info.hash.to_rihs_string(),
        );
    }

    /// Decodes each sample of a topic into its type, hands it to `handle` and keeps it as `keep_as`.
    pub fn subscribe_as<T>(
        &self,
        topic: &str,
        keep_as: &str,
        quality: QosProfile,
        mut handle: impl FnMut(&T) + Send + 'static,
    ) -> Result<()>
    where
        T: ZMessage + WithTypeInfo + Serialize,
        T::Serdes: for<'a> ZDeserializer<Input<'a> = &'a [u8], Output = T> + Send + Sync + 'static,
    {
        self.note_type(&T::type_info());
        let path = self.path(topic);
        let subscription = self.node.create_sub::<T>(&path).with_qos(quality).build()?;
        let received = self.received.clone();
        let changed = self.changed.clone();
        let name = keep_as.to_owned();
        tokio::spawn(async move {
            while let Ok(sample) = subscription.async_recv_serialized().await {
                let attachment = sample
                    .attachment()
                    .and_then(|bytes| Attachment::try_from(bytes).ok());
                let value = decoded(&sample.payload().to_bytes(), &mut handle);
                let mut received = received.lock().unwrap_or_else(PoisonError::into_inner);
                received
                    .entry(name.clone())
                    .or_default()
                    .add(value, attachment);
                drop(received);
                changed.send_replace(());
            }
        });
        Ok(())
    }

    pub fn subscribe<T>(&self, topic: &str, quality: QosProfile) -> Result<()>
    where
        T: ZMessage + WithTypeInfo + Serialize,
        T::Serdes: for<'a> ZDeserializer<Input<'a> = &'a [u8], Output = T> + Send + Sync + 'static,
    {
        self.subscribe_as::<T>(topic, topic, quality, |_| ())
    }

    pub fn publisher<T>(&self, topic: &str, quality: QosProfile) -> Result<ZPub<T, T::Serdes>>
    where
        T: ZMessage + WithTypeInfo,
        T::Serdes: 'static,
    {
        self.note_type(&T::type_info());
        let path = self.path(topic);
        self.node.create_pub::<T>(&path).with_qos(quality).build()
    }

    /// The first sample of a topic that is wanted, be it one that was received before.
    pub async fn wait(
        &self,
        what: &str,
        name: &str,
        is_wanted: impl Fn(&Value) -> bool,
    ) -> Result<Value> {
        let deadline = Instant::now() + LIMIT;
        let mut changed = self.changed.subscribe();
        let mut seen = 0;
        loop {
            {
                let received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
                let samples = received.get(name).map_or(&[][..], |topic| &topic.samples);
                if let Some(found) = samples[seen..].iter().find(|sample| is_wanted(sample)) {
                    return Ok(found.clone());
                }
                seen = samples.len();
            }
            if timeout_at(deadline, changed.changed()).await.is_err() {
                let seconds = LIMIT.as_secs();
                return Err(format!("{what}: nothing on {name} within {seconds} s").into());
            }
        }
    }

    /// What `of` yields for the samples of a topic so far.
    pub fn samples<V>(&self, name: &str, of: impl Fn(&Value) -> V) -> Vec<V> {
        let received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
        let samples = received.get(name).map_or(&[][..], |topic| &topic.samples);
        samples.iter().map(of).collect()
    }

    /// Waits until hiroz's graph shows a server of this service.
    pub async fn await_server(&self, path: &str) -> Result<()> {
        let deadline = Instant::now() + LIMIT;
        while self.context.graph().count(EndpointKind::Service, path) == 0 {
            if Instant::now() > deadline {
                return Err(format!("the graph shows no server of {path}").into());
            }
            sleep(INTERVAL).await;
        }
        Ok(())
    }

    /// The answer of a service, which may not be there yet.
    pub async fn call<S>(&self, name: &str, request: S::Request) -> Result<S::Response>
    where
        S: ZService + ServiceTypeInfo,
        for<'a> <S::Response as ZMessage>::Serdes:
            ZDeserializer<Input<'a> = &'a [u8], Output = S::Response>,
    {
        self.note_type(&S::service_type_info());
        let path = self.path(name);
        self.await_server(&path).await?;
        let client = self.node.create_client::<S>(&path).build()?;
        let answer = client.call_with_timeout(&request, LIMIT).await;
        answer.map_err(|error| format!("{path}: {error}").into())
    }

    /// How many samples of each topic were received, and what was wrong with them.
    pub fn summary(&self) -> Value {
        let received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
        let topics = received.iter().map(|(name, topic)| {
            let seen = json!({
                "samples": topic.samples.len(),
                "publishers": topic.publishers.len(),
                "out_of_order": topic.out_of_order,
                "refused": topic.refused,
            });
            (name.clone(), seen)
        });
        Value::Object(topics.collect())
    }

    /// The hash of each type that was used.
    pub fn types(&self) -> Value {
        let types = self.types.lock().unwrap_or_else(PoisonError::into_inner);
        json!(*types)
    }
}
