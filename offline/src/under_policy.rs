//! A scenario under another policy than its own.

use std::sync::Arc;

use formation_model::{PlanningProblem, Policy, Scenario};

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
