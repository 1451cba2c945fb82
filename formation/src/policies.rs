//! `formation policies`, and a policy that is chosen on the command line.

use std::sync::Arc;

use formation_model::{PlanningProblem, Policy, PolicyEntry, Scenario};
use ros_runtime::exit::Failure;

use crate::console;

/// Prints each policy with what it does and its source.
///
/// # Errors
/// The output is closed.
pub fn list(json: bool) -> Result<(), Failure> {
    let entries: Vec<PolicyEntry> = Policy::all().map(|(_, entry)| entry).collect();
    if json {
        return console::result_json(&entries);
    }
    let lines = entries.iter().map(|entry| {
        let PolicyEntry {
            name,
            sentence,
            source,
        } = entry;
        format!("{name}: {sentence} ({source})")
    });
    console::result_text(&lines.collect::<Vec<_>>().join("\n"))
}

/// The policy of a name, for the command line.
///
/// # Errors
/// Lists the names that there are.
pub fn named(name: &str) -> Result<Policy, String> {
    Policy::named(name)
        .ok_or_else(|| format!("there is no such policy; there are {}", Policy::NAMES))
}

/// The problem of a scenario, under another policy if one is named.
///
/// # Errors
/// The scenario gives no allocation, and the policy is `given`; or its target is in parts, and the policy is another.
pub fn problem_under(
    scenario: &Scenario,
    policy: Option<Policy>,
) -> Result<Arc<PlanningProblem>, String> {
    let problem = scenario.problem();
    let Some(policy) = policy else {
        return Ok(Arc::new(problem.clone()));
    };
    if policy == Policy::Given && problem.target().given().is_none() {
        return Err("target.allocation: is missing, and the policy `given` needs it".to_owned());
    }
    if policy != Policy::Given {
        let formable = scenario.check_formable();
        formable.map_err(|_| {
            format!(
                "target.in_parts: belongs to `policy: given`; the policy is {}",
                policy.name()
            )
        })?;
    }
    let parameters = problem.parameters().under(policy);
    Ok(Arc::new(problem.with_parameters(parameters)))
}
