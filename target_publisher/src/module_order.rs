//! Taking a module out of service, or back, and pushing a simulated one, by the services of the process that hosts it.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::ModuleId;
use formation_msgs::{
    PushModuleRequest, PushModuleResponse, RetireModuleRequest, RetireModuleResponse,
};
use formation_node_support::stamp;
use ros_runtime::ros_context::{RosContext, RosContextError};
use ros_runtime::service::DeclaredService;
use ros_runtime::settings::Settings;

const NODE_NAME: &str = "operator";
const RETIRE_MODULE: DeclaredService<RetireModuleRequest, RetireModuleResponse> =
    DeclaredService::new("retire_module", "formation_msgs", "RetireModule");
const PUSH_MODULE: DeclaredService<PushModuleRequest, PushModuleResponse> =
    DeclaredService::new("push_module", "formation_msgs", "PushModule");

/// How long a process has to answer that may not host the module.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);
/// How long processes have to appear, and the one that hosts the module to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The time between two looks for processes.
const INTERVAL: Duration = Duration::from_millis(100);

/// What one module is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModuleOrder {
    pub module: ModuleId,
    pub deed: Deed,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Deed {
    /// To leave the formation.
    Retire,
    /// To take part again.
    Rejoin,
    /// To be pushed so far along each axis, in metres.
    Push(f64, f64),
}

/// Reads `MODULE,X,Y`, with metres.
pub(crate) fn push_of(text: &str) -> Result<ModuleOrder, String> {
    let parts: Vec<&str> = text.split(',').collect();
    let [module, x, y] = parts[..] else {
        return Err("must be a module, and metres along both axes, such as 4,0.5,-0.2".to_owned());
    };
    let module = module
        .parse()
        .map(ModuleId)
        .map_err(|_| format!("`{module}` is no module"))?;
    let metres = |text: &str| {
        let read = text.parse::<f64>().ok().filter(|way| way.is_finite());
        read.ok_or_else(|| format!("`{text}` is no distance in metres"))
    };
    Ok(ModuleOrder {
        module,
        deed: Deed::Push(metres(x)?, metres(y)?),
    })
}

impl ModuleOrder {
    const fn service(self) -> &'static str {
        match self.deed {
            Deed::Retire | Deed::Rejoin => "retire_module",
            Deed::Push(..) => "push_module",
        }
    }

    /// Asks one process, which carries out a push of one `order` once. Returns what it answers: what it did, or why it did nothing.
    fn call(
        self,
        ros: &mut RosContext,
        name: &str,
        order: u64,
        limit: Duration,
    ) -> Result<Option<Result<String, String>>, RosContextError> {
        let module_id = self.module.0;
        let (success, message) = match self.deed {
            Deed::Retire | Deed::Rejoin => {
                let rejoin = self.deed == Deed::Rejoin;
                let request = RetireModuleRequest { module_id, rejoin };
                match ros.call(&RETIRE_MODULE, name, &request, limit)? {
                    Some(answer) => (answer.success, answer.message),
                    None => return Ok(None),
                }
            }
            Deed::Push(x, y) => {
                let request = PushModuleRequest {
                    module_id,
                    x,
                    y,
                    order,
                };
                match ros.call(&PUSH_MODULE, name, &request, limit)? {
                    Some(answer) => (answer.success, answer.message),
                    None => return Ok(None),
                }
            }
        };
        Ok(Some(if success { Ok(message) } else { Err(message) }))
    }
}

/// Asks the processes in the namespace, that of the node `module_N` first, until one hosts the module. Says what came of it.
///
/// # Errors
/// The graph could not be joined, or no process within reach did it.
pub(crate) fn ask(
    settings: &Settings,
    order: ModuleOrder,
    stop: &Receiver<()>,
) -> Result<String, RosContextError> {
    let (module, service) = (order.module, order.service());
    let parameters = settings.declare(NODE_NAME, Vec::new())?;
    let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
    let namespace = ros.identity().namespace.to_string();
    let own_node = format!("/module_{}/{service}", module.0);
    let deadline = Instant::now() + PATIENCE;
    let mut refusals: BTreeMap<String, String> = BTreeMap::new();
    // The same in each repetition, and another one in the next call.
    let number = stamp::incarnation().0;
    while stop.is_empty() && Instant::now() < deadline {
        let mut services: Vec<String> = ros.services_named(service)?.into_iter().collect();
        services.retain(|name| is_below(name, &namespace) && !refusals.contains_key(name));
        services.sort_by_key(|name| !name.ends_with(&own_node));
        let Some(name) = services.into_iter().next() else {
            std::thread::sleep(INTERVAL);
            continue;
        };
        // The node of that name hosts it, so no other does.
        let hosts_it = name.ends_with(&own_node);
        let limit = if hosts_it { PATIENCE } else { ANSWER_LIMIT };
        let refusal = match order.call(&mut ros, &name, number, limit)? {
            Some(Ok(done)) => return Ok(done),
            Some(Err(refusal)) => refusal,
            None => format!("no answer within {} s", limit.as_secs()),
        };
        if hosts_it {
            return Err(RosContextError::Failed(format!("`{name}`: {refusal}")));
        }
        refusals.insert(name, refusal);
    }
    if !stop.is_empty() {
        return Err(RosContextError::Failed("interrupted".to_owned()));
    }
    let asked = refusals.iter();
    let asked: Vec<String> = asked
        .map(|(name, reason)| format!("`{name}`: {reason}"))
        .collect();
    Err(RosContextError::Failed(match asked.is_empty() {
        true => format!(
            "no process of modules that serves {service} was found in domain {}, namespace {namespace}, within {} s{}",
            settings.environment.domain,
            PATIENCE.as_secs(),
            match order.deed {
                Deed::Push(..) =>
                    "; modules are pushed if their agents are started with --pushable",
                Deed::Retire | Deed::Rejoin => "",
            }
        ),
        false => format!(
            "no process took the command for {module}: {}",
            asked.join("; ")
        ),
    }))
}

/// Whether a service belongs to a namespace, and not to another one whose name begins alike.
fn is_below(service: &str, namespace: &str) -> bool {
    let rest = service.strip_prefix(namespace.trim_end_matches('/'));
    rest.is_some_and(|rest| rest.starts_with('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_push_names_a_module_and_how_far_it_goes() {
        let push = ModuleOrder {
            module: ModuleId(4),
            deed: Deed::Push(0.5, -0.2),
        };
        assert_eq!(push_of("4,0.5,-0.2"), Ok(push));
        for (text, reason) in [
            ("4,0.5", "metres along both axes"),
            ("four,1,2", "`four` is no module"),
            ("4,inf,0", "`inf` is no distance in metres"),
        ] {
            assert!(push_of(text).unwrap_err().contains(reason), "{text}");
        }
    }

    #[test]
    fn modules_of_another_formation_are_not_asked() {
        let service = "/formation/module_4/retire_module";
        assert!(is_below(service, "/formation"));
        assert!(is_below(service, "/"));
        assert!(!is_below(
            "/formation_2/module_4/retire_module",
            "/formation"
        ));
        assert!(!is_below(service, "/formation/other"));
    }
}
