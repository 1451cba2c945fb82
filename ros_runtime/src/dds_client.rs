//! Calls of services over DDS.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use ros2_client::{Client, ServiceTypeName};

use crate::dds_graph::DdsGraph;
use crate::dds_service::SERVICE;
use crate::ros_context_error::{RosContextError, library_name};
use crate::service::{Carried, DeclaredService, ServiceData};

/// Between two looks for the answer.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// A request is sent again after this: what was sent before the server was matched is lost.
const REPEAT: Duration = Duration::from_millis(500);

impl DdsGraph {
    /// The fully qualified names of the discovered services whose last part is `name`.
    pub(crate) fn services_named(&self, name: &str) -> BTreeSet<String> {
        let ending = format!("/{name}Request");
        let topics = self.participant.discovered_topics();
        let topics = topics.iter().map(|topic| topic.topic_name());
        topics
            .filter(|topic| topic.ends_with(&ending))
            .filter_map(|topic| topic.strip_prefix("rq")?.strip_suffix("Request"))
            .map(str::to_owned)
            .collect()
    }

    /// Calls a service, whose request may arrive more than once; `None` if no answer comes within the limit.
    pub(crate) fn call<Q: ServiceData, A: ServiceData>(
        &mut self,
        service: &DeclaredService<Q, A>,
        name: &str,
        request: &Q,
        limit: Duration,
    ) -> Result<Option<A>, RosContextError> {
        let parsed = library_name(name)?;
        let (package, type_name) = service.type_name();
        let type_name = ServiceTypeName::new(package, type_name);
        let mapping = self.service_mapping.library();
        let what = format!("call `{name}`");
        let client: Client<Carried<Q>, Carried<A>> = self.create(&what, |node| {
            let quality = || SERVICE.publisher_qos();
            node.create_client(mapping, &parsed, &type_name, quality(), quality())
        })?;
        let failed = |error: String| RosContextError::Failed(format!("cannot {what}: {error}"));
        let (deadline, mut due) = (Instant::now() + limit, Instant::now());
        let mut sent = Vec::new();
        while Instant::now() < deadline {
            if Instant::now() >= due {
                let id = client.send_request(Carried(request.clone()));
                sent.push(id.map_err(|error| failed(error.to_string()))?);
                due = Instant::now() + REPEAT;
            }
            let received = client.receive_response();
            match received.map_err(|error| failed(error.to_string()))? {
                Some((id, Carried(answer))) if sent.contains(&id) => return Ok(Some(answer)),
                Some(_) => {}
                None => std::thread::sleep(POLL_INTERVAL),
            }
        }
        Ok(None)
    }
}
