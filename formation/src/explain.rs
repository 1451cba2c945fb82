//! `formation explain`.

use std::path::Path;

use formation_model::ModuleId;
use formation_model::text::joined;
use formation_offline::{CheckedPlan, ExplanationReport, explanation_text};
use formation_planner::Explanation;
use ros_runtime::exit::Failure;

use crate::plan_output::PlanOutput;
use crate::{check, console, scenario_file};

/// Plans a scenario and says why a module gets its spot, or none.
///
/// # Errors
/// Names what is wrong with the file or with the plan, or says that the scenario does not have the module.
pub fn run(path: &Path, module: u32, json: bool) -> Result<(), Failure> {
    let scenario = scenario_file::load(path)?;
    check::warn(path, &scenario);
    let plan = CheckedPlan::of(&scenario)?;
    let module = ModuleId(module);
    let explanation = Explanation::of(&plan.problem, &plan.outcome, module);
    let Some(explanation) = explanation else {
        let known = plan.problem.modules().iter().map(|module| module.id.0);
        return Err(Failure::bad_input(format!(
            "{}: there is no {module}; the modules are {}",
            scenario_file::named(path),
            joined(known, ", ")
        )));
    };
    if json {
        console::result_json(&ExplanationReport::of(&plan, &explanation))?;
    } else {
        console::result_text(&explanation_text(&explanation))?;
    }
    plan.refuse_hole(path)
}
