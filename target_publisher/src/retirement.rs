//! Taking a module out of service, or back, by the service of the process that hosts it.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::ModuleId;
use formation_msgs::{RetireModuleRequest, RetireModuleResponse};
use ros_runtime::ros_context::{RosContext, RosContextError};
use ros_runtime::service::DeclaredService;
use ros_runtime::settings::Settings;

const NODE_NAME: &str = "operator";
const SERVICE: &str = "retire_module";
const RETIRE_MODULE: DeclaredService<RetireModuleRequest, RetireModuleResponse> =
    DeclaredService::new(SERVICE, "formation_msgs", "RetireModule");

/// How long a process has to answer.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);
/// How long processes have to appear.
const PATIENCE: Duration = Duration::from_secs(10);
/// The time between two looks for processes.
const INTERVAL: Duration = Duration::from_millis(100);

/// A module that is to leave the formation, or to take part again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Retirement {
    pub module: ModuleId,
    pub rejoins: bool,
}

/// Asks the processes in the namespace, that of the node `module_N` first, until one hosts the module. Says what came of it.
///
/// # Errors
/// The graph could not be joined, or no process within reach hosts the module.
pub(crate) fn ask(
    settings: &Settings,
    retirement: Retirement,
    stop: &Receiver<()>,
) -> Result<String, RosContextError> {
    let Retirement { module, rejoins } = retirement;
    let parameters = settings.declare(NODE_NAME, Vec::new())?;
    let mut ros = RosContext::join(settings, NODE_NAME, parameters)?;
    let request = RetireModuleRequest {
        module_id: module.0,
        rejoin: rejoins,
    };
    let namespace = ros.identity().namespace.to_string();
    let own_node = format!("/module_{}/{SERVICE}", module.0);
    let deadline = Instant::now() + PATIENCE;
    let mut refusals: BTreeMap<String, String> = BTreeMap::new();
    while stop.is_empty() && Instant::now() < deadline {
        let mut services: Vec<String> = ros.services_named(SERVICE)?.into_iter().collect();
        services.retain(|name| is_below(name, &namespace) && !refusals.contains_key(name));
        services.sort_by_key(|name| !name.ends_with(&own_node));
        let Some(name) = services.into_iter().next() else {
            std::thread::sleep(INTERVAL);
            continue;
        };
        let answer = ros.call(&RETIRE_MODULE, &name, &request, ANSWER_LIMIT)?;
        let refusal = match answer {
            Some(answer) if answer.success => return Ok(answer.message),
            Some(answer) => answer.message,
            None => format!("no answer within {} s", ANSWER_LIMIT.as_secs()),
        };
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
            "no process of modules was found in domain {}, namespace {namespace}, within {} s",
            settings.environment.domain,
            PATIENCE.as_secs()
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
