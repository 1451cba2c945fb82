//! Which formations are in a domain and namespace, by their messages.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::ModuleSize;
use formation_msgs::{Heartbeat, InSession, SessionId, TargetConfiguration};
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::settings::Settings;

use crate::topics;

const NODE_NAME: &str = "session_finder";

/// After the first session, others are awaited for this long: twice the default period of heartbeats.
const OTHERS: Duration = Duration::from_secs(1);

/// More sessions than these are left out.
const SESSIONS_MAX: usize = 16;

/// The sessions whose modules send heartbeats, or whose target is announced, in the domain and namespace of `settings`, each
/// with the size of its modules. Returns one second after the first of them was found, when `limit` has passed, or when `stop` yields.
///
/// # Errors
/// The graph cannot be joined.
pub fn find_sessions(
    settings: &Settings,
    limit: Duration,
    stop: &Receiver<()>,
) -> Result<BTreeMap<u64, ModuleSize>, RosContextError> {
    let mut finder = Finder {
        found: BTreeMap::new(),
        until: Instant::now() + limit,
    };
    rejoining(|| {
        let parameters = settings.declare(NODE_NAME, Vec::new())?;
        let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
        let mut inputs = Inputs::default();
        let heartbeats = ros.subscription(&topics::HEARTBEATS, |_, sample: Heartbeat| {
            Ok(Some((sample.session(), sample.module_size())))
        })?;
        inputs.add(heartbeats, |found| found);
        let targets = ros.subscription(&topics::TARGET, |_, sample: TargetConfiguration| {
            Ok((!sample.withdrawn).then(|| (sample.session(), sample.module_size())))
        })?;
        inputs.add(targets, |found| found);
        ros.run(&mut finder, inputs, stop)
    })?;
    Ok(finder.found)
}

struct Finder {
    found: BTreeMap<u64, ModuleSize>,
    until: Instant,
}

impl Node for Finder {
    type Input = Option<(SessionId, ModuleSize)>;

    fn handle(&mut self, found: Option<(SessionId, ModuleSize)>) {
        let Some((SessionId(number), size)) = found else {
            return;
        };
        if self.found.is_empty() {
            self.until = self.until.min(Instant::now() + OTHERS);
        }
        if self.found.len() < SESSIONS_MAX {
            self.found.insert(number, size);
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        Ok(match Instant::now() < self.until {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        })
    }

    fn due(&self) -> Option<Instant> {
        Some(self.until)
    }
}
