//! The answers.

use std::sync::Arc;
use std::time::Duration;

use formation_event_log::{Entry, Recorder};
use formation_model::{Policy, PolicyEntry, RawScenario, Scenario};
use formation_offline::{CheckedPlan, as_in_a_file, campaign_parameters, oddities, whole_yaml};
use formation_planner::PlanSize;
use formation_report::{figure, film};
use formation_sim::{Ending, FaultKind, run_seed};
use serde_json::{Value, json};

use crate::Refusal;
use crate::findings::{Finding, Named};
use crate::request::{Drawn, EngineRequest, SCENARIO_BYTES_MAX};
use crate::scenarios::SHIPPED;

/// The moments of a figure.
const FIGURE_PERCENTS: [u32; 4] = [0, 25, 50, 100];

/// Between two poses of a module in the film of a simulated run.
const POSE_INTERVAL: Duration = Duration::from_millis(100);

/// The most modules of a simulated run: it takes some seconds with faults.
const SIMULATED_HERE_MAX: usize = 60;

/// Answers a request.
///
/// # Errors
/// Says why there is no answer.
pub fn of(request: &EngineRequest) -> Result<Value, Refusal> {
    match request {
        EngineRequest::Scenarios => Ok(json!({ "scenarios": SHIPPED })),
        EngineRequest::Choices => {
            let entries: Vec<PolicyEntry> = Policy::all().map(|(_, entry)| entry).collect();
            let faults: Vec<&str> = FaultKind::NAMED.iter().map(|(name, _)| *name).collect();
            Ok(json!({ "policies": entries, "faults": faults }))
        }
        EngineRequest::Read(drawn) => {
            let scenario = as_in_a_file(&raw(drawn)?);
            Ok(json!({ "scenario": scenario.map_err(|error| Refusal::of(&error))? }))
        }
        EngineRequest::Write(drawn) => {
            let text = whole_yaml(&raw(drawn)?);
            Ok(json!({ "text": text.map_err(|error| Refusal::of(&error))? }))
        }
        EngineRequest::Plan(drawn) => {
            let scenario = scenario(drawn)?;
            Ok(shown(&scenario, &planned(&scenario)?))
        }
        EngineRequest::Figure(drawn) => {
            let scenario = scenario(drawn)?;
            let plan = planned(&scenario)?;
            let course = plan.course();
            let subject = plan.subject(scenario.name(), &course);
            Ok(json!({ "svg": figure(&subject, &course, &FIGURE_PERCENTS) }))
        }
        EngineRequest::Simulate {
            drawn,
            seed,
            faults,
        } => simulated(drawn, *seed, faults),
    }
}

impl Refusal {
    fn of(text: &impl ToString) -> Self {
        let text = text.to_string();
        let place = Named::named_in(&text);
        Self { text, place }
    }
}

/// A scenario that is drawn, under the policy that is chosen.
fn raw(drawn: &Drawn) -> Result<RawScenario, Refusal> {
    let Drawn { text, policy } = drawn;
    if text.len() > SCENARIO_BYTES_MAX {
        return Err(Refusal::of(&format!(
            "the scenario has {} bytes; at most {SCENARIO_BYTES_MAX} are read",
            text.len()
        )));
    }
    let mut raw = RawScenario::from_yaml(text).map_err(|error| Refusal::of(&error))?;
    if let Some(name) = policy {
        let policy = Policy::named(name).ok_or_else(|| {
            let names = Policy::NAMES;
            Refusal::of(&format!("there is no policy `{name}`; there are {names}"))
        })?;
        raw.planner = raw.planner.under(policy);
        // No other policy has an allocation that the target gives.
        raw.given = raw.given.filter(|_| policy == Policy::Given);
    }
    Ok(raw)
}

fn scenario(drawn: &Drawn) -> Result<Scenario, Refusal> {
    Scenario::try_from(raw(drawn)?).map_err(|error| Refusal::of(&error))
}

/// The plan of a scenario that may be planned while somebody waits for it.
fn planned(scenario: &Scenario) -> Result<CheckedPlan, Refusal> {
    let problem = Arc::new(scenario.problem().clone());
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
    let errors = plan.unmovable_text().into_iter().chain(plan.hole_text());
    let errors = errors.map(|text| Finding::error(&text));
    let warnings = oddities(&plan.problem).into_iter().chain(plan.warnings());
    let findings = errors.chain(warnings.map(|text| Finding::warning(&text)));
    let facts = plan.facts();
    let numbers: Vec<Value> = facts
        .iter()
        .map(|fact| json!({ "name": fact.name, "value": fact.value }))
        .collect();
    json!({
        "outcome": summary.outcome,
        "policy": plan.problem.parameters().policy.name(),
        "numbers": numbers,
        "findings": findings.collect::<Vec<Finding>>(),
        "film": film(&subject, &course, &summary.outcome),
        "plan": plan.whole_report(None),
    })
}

/// A run of a scenario under virtual time, with the faults that a seed draws.
fn simulated(drawn: &Drawn, seed: u64, faults: &str) -> Result<Value, Refusal> {
    let faults: FaultKind = faults
        .parse()
        .map_err(|error: String| Refusal::of(&format!("faults: {error}")))?;
    let scenario = scenario(drawn)?;
    let modules = scenario.problem().modules().len();
    if modules > SIMULATED_HERE_MAX {
        return Err(Refusal::of(&format!(
            "{modules} modules are too many to simulate on a page, which takes {SIMULATED_HERE_MAX}; `formation simulate` takes more"
        )));
    }
    scenario
        .check_formable()
        .map_err(|error| Refusal::of(&error))?;
    let plan = planned(&scenario)?;
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
    let mut recorder = Recorder::new(POSE_INTERVAL);
    let messages = report.published.iter();
    let course: Vec<Entry> = messages
        .flat_map(|(at, message)| recorder.record(*at, message))
        .collect();
    let subject = plan.subject(scenario.name(), &course);
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
        "film": film(&subject, &course, ending),
    }))
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
        let shown = ok(&json!({ "call": "plan", "text": text }));
        assert_eq!(shown["findings"][0]["modules"], json!([4, 5]), "{shown}");
        let twice = text.replace("id: 5", "id: 4");
        let refused = error(&json!({ "call": "plan", "text": twice }));
        assert_eq!(refused["modules"], json!([4]), "{refused}");
    }

    #[test]
    fn the_policy_that_is_chosen_is_in_the_plan_and_in_the_file() {
        for shipped in SHIPPED {
            for policy in ["exact", "paper", "auction"] {
                let asked = |call: &str| {
                    ok(&json!({ "call": call, "text": shipped.text, "policy": policy }))
                };
                assert_eq!(asked("plan")["policy"], policy, "{}", shipped.name);
                let written = asked("write");
                let again = ok(&json!({ "call": "plan", "text": written["text"] }));
                assert_eq!(again["policy"], policy, "{}", shipped.name);
            }
        }
    }

    #[test]
    fn a_seed_repeats_its_run_and_its_faults() {
        let run = |seed: u64, faults: &str| {
            let text = SHIPPED[1].text;
            ok(&json!({ "call": "simulate", "text": text, "seed": seed, "faults": faults }))
        };
        let calm = run(1, "none");
        assert_eq!(calm["ending"], "formed", "{calm}");
        let modules = calm["film"]["modules"].as_array().unwrap();
        let ends = |module: &Value| module["phases"].as_array().unwrap().last().unwrap()[1].clone();
        let settled = modules.iter().filter(|module| ends(module) == "SETTLED");
        assert_eq!(settled.count(), modules.len(), "{calm}");
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
