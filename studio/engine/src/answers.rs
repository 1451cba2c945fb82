//! The answers.

use formation_model::{Policy, PolicyEntry, RawScenario, Scenario};
use formation_offline::{CheckedPlan, campaign_parameters, oddities, problem_under, to_yaml};
use formation_planner::PlanSize;
use formation_report::film;
use formation_sim::{Ending, FaultKind, run_seed};
use serde_json::{Map, Value, json};

use crate::Refusal;
use crate::findings::{Finding, Named};
use crate::request::{EngineRequest, SCENARIO_BYTES_MAX};
use crate::scenarios::SHIPPED;

/// The sections that `to_yaml` writes.
const LISTS: [&str; 6] = [
    "name",
    "target",
    "configurations",
    "singletons",
    "given",
    "in_parts",
];

/// The moments of a figure.
const FIGURE_PERCENTS: [u32; 4] = [0, 25, 50, 100];

/// The most modules of a simulated run: it takes some seconds with faults.
const SIMULATED_HERE_MAX: usize = 60;

/// Answers a request.
///
/// # Errors
/// Says why there is no answer.
pub fn of(request: &EngineRequest) -> Result<Value, Refusal> {
    match request {
        EngineRequest::Scenarios => Ok(json!({ "scenarios": SHIPPED })),
        EngineRequest::Policies => {
            let entries: Vec<PolicyEntry> = Policy::all().map(|(_, entry)| entry).collect();
            let faults: Vec<&str> = FaultKind::NAMED.iter().map(|(name, _)| *name).collect();
            Ok(json!({ "policies": entries, "faults": faults }))
        }
        EngineRequest::Read { text } => {
            let raw = raw(text)?;
            let findings = match Scenario::try_from(raw.clone()) {
                Ok(_) => Vec::new(),
                Err(error) => vec![Finding::from(&error)],
            };
            Ok(json!({ "scenario": as_value(&raw)?, "findings": findings }))
        }
        EngineRequest::Write { text } => Ok(json!({ "text": written(&raw(text)?)? })),
        EngineRequest::Check { text } => Ok(json!({ "findings": findings(text) })),
        EngineRequest::Plan { text, policy } => {
            let scenario = scenario(text)?;
            let plan = planned(&scenario, policy.as_deref())?;
            Ok(shown(&scenario, &plan))
        }
        EngineRequest::Simulate { text, seed, faults } => simulated(text, *seed, faults),
        EngineRequest::Pictures { text, policy } => {
            let scenario = scenario(text)?;
            let plan = planned(&scenario, policy.as_deref())?;
            let course = plan.course();
            let subject = plan.subject(scenario.name(), &course);
            Ok(json!({
                "before": formation_report::before(&subject),
                "after": formation_report::after(&subject),
                "figure": formation_report::figure(&subject, &course, &FIGURE_PERCENTS),
            }))
        }
    }
}

impl Refusal {
    fn of(text: &impl ToString) -> Self {
        let text = text.to_string();
        let place = Named::named_in(&text);
        Self { text, place }
    }
}

fn raw(text: &str) -> Result<RawScenario, Refusal> {
    if text.len() > SCENARIO_BYTES_MAX {
        return Err(Refusal::of(&format!(
            "the scenario has {} bytes; at most {SCENARIO_BYTES_MAX} are read",
            text.len()
        )));
    }
    RawScenario::from_yaml(text).map_err(|error| Refusal::of(&error))
}

fn scenario(text: &str) -> Result<Scenario, Refusal> {
    Scenario::try_from(raw(text)?).map_err(|error| Refusal::of(&error))
}

/// The plan of a scenario that may be planned while somebody waits for it.
fn planned(scenario: &Scenario, policy: Option<&str>) -> Result<CheckedPlan, Refusal> {
    let policy = policy
        .map(|name| {
            Policy::named(name).ok_or_else(|| {
                Refusal::of(&format!(
                    "there is no policy `{name}`; there are {}",
                    Policy::NAMES
                ))
            })
        })
        .transpose()?;
    let problem = problem_under(scenario, policy).map_err(|reason| Refusal::of(&reason))?;
    PlanSize::of(&problem)
        .check()
        .map_err(|reason| Refusal::of(&reason))?;
    CheckedPlan::of_problem(problem).map_err(|reason| Refusal::of(&reason))
}

/// What the page shows of a plan.
fn shown(scenario: &Scenario, plan: &CheckedPlan) -> Value {
    let course = plan.course();
    let subject = plan.subject(scenario.name(), &course);
    let summary = plan.summary();
    let mut findings: Vec<Finding> = oddities(&plan.problem)
        .iter()
        .chain(&plan.warnings())
        .map(|text| Finding::warning(text))
        .collect();
    let unmovable = plan.unmovable_text();
    findings.extend(unmovable.iter().map(|text| Finding::error(text)));
    findings.extend(plan.hole_text().map(|text| Finding::error(&text)));
    let facts = plan.facts();
    let numbers: Vec<Value> = facts
        .iter()
        .map(|fact| json!({ "name": fact.name, "value": fact.value }))
        .collect();
    json!({
        "outcome": summary.outcome,
        "policy": plan.problem.parameters().policy.name(),
        "numbers": numbers,
        "findings": findings,
        "film": film(&subject, &course, &summary.outcome),
        "plan": plan.whole_report(None),
    })
}

/// A run of a scenario under virtual time, with the faults that a seed draws.
fn simulated(text: &str, seed: u64, faults: &str) -> Result<Value, Refusal> {
    let faults: FaultKind = faults
        .parse()
        .map_err(|error: String| Refusal::of(&format!("faults: {error}")))?;
    let scenario = scenario(text)?;
    let modules = scenario.problem().modules().len();
    if modules > SIMULATED_HERE_MAX {
        return Err(Refusal::of(&format!(
            "{modules} modules are too many to simulate on a page, which takes {SIMULATED_HERE_MAX}; `formation simulate` takes more"
        )));
    }
    scenario
        .check_formable()
        .map_err(|error| Refusal::of(&error))?;
    let plan = planned(&scenario, None)?;
    if let Some(reason) = plan.unmovable_text() {
        return Err(Refusal::of(&reason));
    }
    let parameters = campaign_parameters(faults, (modules, modules), Some(&plan), true);
    let report = run_seed(&parameters, seed).map_err(|error| Refusal::of(&error))?;
    let ending = match report.ending {
        Ending::Formed => "formed",
        Ending::WaitingForQuorum => "waiting for a quorum",
        Ending::Neither => "neither formed nor waiting for a quorum",
    };
    let lines = report.transcript.lines().iter().map(ToString::to_string);
    let violations = report.violations.iter();
    let violations = violations.map(|one| format!("{}: {}", one.kind, one.detail));
    Ok(json!({
        "ending": ending,
        "running": report.running,
        "recovery_s": report.recovery.as_secs_f64(),
        "epochs": report.epochs,
        "violations": violations.collect::<Vec<String>>(),
        "events": lines.collect::<Vec<String>>(),
    }))
}

/// What `formation check` says, errors first.
fn findings(text: &str) -> Vec<Finding> {
    let checked: Result<CheckedPlan, Refusal> =
        scenario(text).and_then(|scenario| planned(&scenario, None));
    match checked {
        Err(refusal) => vec![Finding::error(&refusal.text)],
        Ok(plan) => {
            let errors = plan.unmovable_text().into_iter().chain(plan.hole_text());
            let errors = errors.map(|text| Finding::error(&text));
            let warnings = oddities(&plan.problem);
            let warnings = warnings.into_iter().chain(plan.warnings());
            errors
                .chain(warnings.map(|text| Finding::warning(&text)))
                .collect()
        }
    }
}

/// A scenario as the lists of a file.
fn as_value(raw: &RawScenario) -> Result<Value, Refusal> {
    let mut whole = serde_json::to_value(raw).map_err(|reason| Refusal::of(&reason))?;
    if let Some(fields) = whole.as_object_mut() {
        let mut in_target = Map::new();
        if let Some(Value::Object(given)) = fields.remove("given") {
            in_target.extend(given);
        }
        if let Some(in_parts) = fields.remove("in_parts") {
            in_target.insert("in_parts".to_owned(), in_parts);
        }
        if let Some(target) = fields.get_mut("target").and_then(Value::as_object_mut) {
            target.extend(in_target);
        }
    }
    Ok(whole)
}

/// A scenario file as people write it; sections other than the lists are written as JSON, which is YAML.
fn written(raw: &RawScenario) -> Result<String, Refusal> {
    let mut text = to_yaml(raw);
    let whole = serde_json::to_value(raw).map_err(|reason| Refusal::of(&reason))?;
    for (section, value) in whole.as_object().into_iter().flatten() {
        if !LISTS.contains(&section.as_str()) {
            text.push_str(&format!("{section}: {value}\n"));
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer;

    fn ok(request: &Value) -> Value {
        let mut answered: Value = serde_json::from_str(&answer(&request.to_string())).unwrap();
        assert!(answered.get("error").is_none(), "{answered}");
        answered["ok"].take()
    }

    fn error(request: &Value) -> Value {
        let mut answered: Value = serde_json::from_str(&answer(&request.to_string())).unwrap();
        answered["error"].take()
    }

    #[test]
    fn shipped_scenarios_survive_reading_and_writing_with_their_plans() {
        for shipped in SHIPPED {
            let plan = |text: &str| {
                let mut shown = ok(&json!({ "call": "plan", "text": text }));
                shown["plan"]["planning_us"] = json!(0);
                shown["plan"].take()
            };
            let read = ok(&json!({ "call": "read", "text": shipped.text }));
            assert_eq!(read["findings"], json!([]), "{}", shipped.name);
            let drawn = read["scenario"].to_string();
            let written = ok(&json!({ "call": "write", "text": drawn }));
            let written = written["text"].as_str().unwrap();
            assert_eq!(plan(shipped.text), plan(&drawn), "{}", shipped.name);
            assert_eq!(plan(shipped.text), plan(written), "{}", shipped.name);
        }
    }

    #[test]
    fn what_is_wrong_is_named_and_placed() {
        let text = "
target: {spots: [{id: 1, x: 0.0, y: 0.0}, {id: 2, x: 1.0, y: 0.0}], edges: [[1, 2]]}
singletons: [{id: 4, x: 3.0, y: 3.0}, {id: 5, x: 3.2, y: 3.0}]
";
        let checked = ok(&json!({ "call": "check", "text": text }));
        assert_eq!(
            checked["findings"][0]["modules"],
            json!([4, 5]),
            "{checked}"
        );
        let twice = text.replace("id: 5", "id: 4");
        let checked = ok(&json!({ "call": "check", "text": twice }));
        assert_eq!(checked["findings"][0]["severity"], "error", "{checked}");
        assert_eq!(checked["findings"][0]["modules"], json!([4]), "{checked}");
    }

    #[test]
    fn a_seed_repeats_its_run_and_its_faults() {
        let run = |seed: u64, faults: &str| {
            let text = SHIPPED[1].text;
            ok(&json!({ "call": "simulate", "text": text, "seed": seed, "faults": faults }))
        };
        let calm = run(1, "none");
        assert_eq!(calm["ending"], "formed", "{calm}");
        let rough = run(3, "mixed");
        assert_eq!(rough["violations"], json!([]), "{rough}");
        assert_eq!(rough, run(3, "mixed"));
        assert_ne!(rough["events"], run(4, "mixed")["events"]);
        let refused = error(&json!({ "call": "simulate", "text": "", "seed": 1, "faults": "<b>" }));
        assert!(
            refused["text"].as_str().unwrap().starts_with("faults: "),
            "{refused}"
        );
    }

    #[test]
    fn hostile_requests_are_refused_in_words() {
        let many: String = (0..1_000_000)
            .map(|id| format!("{{id: {id}, x: 0, y: {id}}},"))
            .collect();
        for (request, reason) in [
            (json!({ "call": "launch" }), "no request"),
            (json!({ "call": "plan" }), "no request"),
            (json!({ "call": "plan", "text": "[[[[" }), "line"),
            (
                json!({ "call": "plan", "text": "name: <script>" }),
                "target",
            ),
            (
                json!({ "call": "plan", "text": format!("singletons: [{many}]") }),
                "bytes",
            ),
            (
                json!({ "call": "plan", "text": SHIPPED[0].text, "policy": "<b>" }),
                "there is no policy",
            ),
        ] {
            let refused = error(&request);
            let text = refused["text"].as_str().unwrap_or_default();
            assert!(text.contains(reason), "{reason}: {refused}");
        }
        assert!(error_of("{").contains("no request"));
    }

    fn error_of(request: &str) -> String {
        answer(request)
    }
}
