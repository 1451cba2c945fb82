//! Uses every topic, service and the action of the suite over Zenoh, by an implementation of others: hiroz.
//!
//! It does what `tests/python/zenoh_lab.py` does by another one: it drives all modules but the last, forms the scenario by the
//! action, stops and resumes, calls every service, and prints one JSON object for each thing done. Besides, it prints what
//! hiroz's graph shows of the other nodes.
//!
//! Usage: `hiroz_peer PORT DOMAIN NAMESPACE SCENARIO AGENT`
//!
//! The router listens on PORT of loopback. SCENARIO is the file of a scenario whose modules have external drivers, but the last,
//! which the node AGENT hosts.

mod driver;
mod graph;
mod messages;
mod peer;
mod size_estimation;

use std::env;
use std::path::Path;
use std::process::ExitCode;

use hiroz::action::client::{GoalHandle, ZActionClient, goal_state};
use hiroz::parameter::{ParameterClient, ParameterTarget};
use hiroz::prelude::{
    ActionTypeInfo, Builder, GoalStatus, Parameter, ParameterType, ParameterValue, ZAction,
};
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::time::timeout;

use messages::ros::action_msgs::GoalStatusArray;
use messages::ros::diagnostic_msgs::DiagnosticArray;
use messages::ros::formation_msgs::action::FormConfiguration;
use messages::ros::formation_msgs::srv::{
    AddModule, QueryStatus, RemoveModule, RetireModule, StopFormation, WithdrawTarget,
};
use messages::ros::formation_msgs::{
    AddModuleRequest, Eviction, FormConfigurationGoal, Heartbeat, ModuleStates, OperatorCommand,
    QueryStatusRequest, RemoveModuleRequest, RetireModuleRequest, Roster, SpotClaim,
    StopFormationRequest, TargetConfiguration, Verdict, WithdrawTargetRequest,
};
use messages::ros::rcl_interfaces::{Log, ParameterEvent};
use messages::ros::tf2_msgs::TFMessage;
use messages::ros::visualization_msgs::MarkerArray;
use messages::{CORRECTED_HASHES, best_effort, latched, volatile};
use peer::{LIMIT, Peer, Result, did};

/// The action of the formation.
const ACTION: &str = "form_configuration";
/// The version of the protocol of the formation.
const PROTOCOL_VERSION: u32 = 8;

#[tokio::main]
async fn main() -> ExitCode {
    match run().await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

async fn run() -> Result<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [port, domain, namespace, scenario, agent] = &arguments[..] else {
        return Err("usage: hiroz_peer PORT DOMAIN NAMESPACE SCENARIO AGENT".into());
    };
    let peer = Peer::connect(port, domain.parse()?, namespace)?;
    subscribe_to_all(&peer)?;
    let poses = driver::start_poses(scenario)?;
    let [driven @ .., (last, _)] = &poses[..] else {
        return Err(format!("{scenario} has no modules").into());
    };
    let driving = driver::start(&peer, driven)?;
    let action = peer.node.create_action_client::<FormConfiguration>(ACTION);
    let action = action.build()?;
    note_types_of_action(&peer);
    did("connected", json!({}));

    let modules = u32::try_from(poses.len())?;
    let name = Path::new(scenario).file_stem().unwrap_or_default();
    form(&peer, &action, &name.to_string_lossy(), modules).await?;
    use_parameters(&peer, &format!("{namespace}/{agent}")).await?;
    call_services(&peer, agent, u32::try_from(*last)?).await?;
    announce(&peer).await?;
    cancel(&action, modules).await?;
    command(&peer).await?;
    late(&peer).await?;
    did("graph", graph::shown(peer.context()));
    did(
        "types",
        json!({"hashes": peer.types(), "corrected": CORRECTED_HASHES}),
    );
    did("received", json!({"topics": peer.summary()}));
    driving.abort();
    // It ends as aborted, which is no error here.
    let _ = driving.await;
    Ok(())
}

fn subscribe_to_all(peer: &Peer) -> Result<()> {
    peer.subscribe::<TargetConfiguration>("target", latched())?;
    peer.subscribe::<ModuleStates>("module_states", latched())?;
    peer.subscribe::<Roster>("roster", latched())?;
    peer.subscribe::<SpotClaim>("claims", latched())?;
    peer.subscribe::<Eviction>("evictions", latched())?;
    peer.subscribe::<OperatorCommand>("commands", latched())?;
    peer.subscribe::<Verdict>("verdict", latched())?;
    peer.subscribe::<Heartbeat>("heartbeats", best_effort())?;
    peer.subscribe::<MarkerArray>("markers", latched())?;
    peer.subscribe::<TFMessage>("/tf", volatile())?;
    peer.subscribe::<TFMessage>("/tf_static", latched())?;
    peer.subscribe::<Log>("/rosout", latched())?;
    peer.subscribe::<DiagnosticArray>("/diagnostics", volatile())?;
    peer.subscribe::<ParameterEvent>("/parameter_events", volatile())?;
    // The feedback reaches the client of the action.
    peer.subscribe::<GoalStatusArray>(&format!("{ACTION}/_action/status"), latched())
}

fn note_types_of_action(peer: &Peer) {
    for info in [
        FormConfiguration::send_goal_type_info(),
        FormConfiguration::get_result_type_info(),
        FormConfiguration::cancel_goal_type_info(),
        FormConfiguration::feedback_type_info(),
        FormConfiguration::status_type_info(),
        FormConfiguration::action_type_info(),
    ] {
        peer.note_type(&info);
    }
}

type Action = ZActionClient<FormConfiguration>;
type Goal = GoalHandle<FormConfiguration, goal_state::Active>;

async fn send(action: &Action, scenario: &str, modules: u32) -> Result<Goal> {
    if !action.wait_for_server(LIMIT).await {
        return Err("the graph shows no server of the action".into());
    }
    let goal = FormConfigurationGoal {
        scenario: scenario.to_owned(),
        expected_modules: modules,
        ..FormConfigurationGoal::default()
    };
    timeout(LIMIT, action.send_goal(goal)).await?
}

/// The last status of a goal, which follows its result on a topic.
async fn last_status(statuses: &mut watch::Receiver<GoalStatus>) -> Result<i8> {
    let ended = statuses.wait_for(GoalStatus::is_terminal);
    Ok(i8::from(*timeout(LIMIT, ended).await??))
}

/// Forms the scenario, with a stop and its end on the way.
async fn form(peer: &Peer, action: &Action, scenario: &str, modules: u32) -> Result<()> {
    let mut goal = send(action, scenario, modules).await?;
    did("goal", json!({"accepted": true}));
    let mut statuses = goal.status_watch().ok_or("no statuses")?;
    let mut feedback = goal.feedback().ok_or("no feedback")?;
    peer.wait("a module moves", "module_1/goal_pose", |_| true)
        .await?;
    for resume in [false, true] {
        let request = StopFormationRequest { resume };
        let answer = peer
            .call::<StopFormation>("stop_formation", request)
            .await?;
        let name = if resume { "resume" } else { "stop" };
        did(name, json!({"success": answer.success}));
        peer.wait("all heartbeats show the command", "heartbeats", |sample| {
            stops(sample).all(|(revision, stopped)| revision > 0 && stopped != resume)
        })
        .await?;
    }
    let result = goal.result_with_timeout(LIMIT).await?;
    let mut stages = Vec::new();
    while let Ok(progress) = feedback.try_recv() {
        stages.push(progress.progress.stage);
    }
    did(
        "result",
        json!({
            "status": last_status(&mut statuses).await?,
            "outcome": result.verdict.outcome,
            "message": result.message,
            "stages": stages,
        }),
    );
    Ok(())
}

/// The revision and the content of the stop that each module of a heartbeat knows.
fn stops(heartbeat: &Value) -> impl Iterator<Item = (u64, bool)> {
    let modules = heartbeat["modules"].as_array().into_iter().flatten();
    modules.map(|module| {
        let stop = &module["stop"];
        let revision = stop["revision"].as_u64().unwrap_or(0);
        (revision, stop["stopped"].as_bool().unwrap_or(false))
    })
}

/// Calls each service of parameters of a node, by hiroz's own client for them.
async fn use_parameters(peer: &Peer, node: &str) -> Result<()> {
    let target = ParameterTarget::from_fqn(node).ok_or("no name of a node")?;
    peer.await_server(&format!("{node}/set_parameters")).await?;
    let client = ParameterClient::new(peer.node.clone(), target)?;
    let everything: [&str; 0] = [];
    let listed = timeout(LIMIT, client.list(&everything, None)).await??;
    did("list_parameters", json!({"names": listed.names}));
    let names = ["heartbeat_s", "stuck_s"];
    let kept = timeout(LIMIT, client.get(&names)).await??;
    let kept: Vec<Option<f64>> = kept.iter().map(double_of).collect();
    did("get_parameters", json!({"values": kept}));
    let types = timeout(LIMIT, client.get_types(&names)).await??;
    let types: Vec<u8> = types.into_iter().map(ParameterType::into).collect();
    did("get_parameter_types", json!({"types": types}));
    let described = timeout(LIMIT, client.describe(&names)).await??;
    let names: Vec<&str> = described.iter().map(|one| one.name.as_str()).collect();
    let texts: Vec<&str> = described
        .iter()
        .map(|one| one.description.as_str())
        .collect();
    did(
        "describe_parameters",
        json!({"names": names, "texts": texts}),
    );
    for (name, value) in [
        ("set_parameters", 11.0),
        ("set_parameters_atomically", 12.0),
    ] {
        let parameter = [Parameter::new("stuck_s", ParameterValue::Double(value))];
        let results = if name == "set_parameters" {
            timeout(LIMIT, client.set(&parameter)).await??
        } else {
            vec![timeout(LIMIT, client.set_atomically(&parameter)).await??]
        };
        let successful: Vec<bool> = results.iter().map(|one| one.successful).collect();
        did(name, json!({"successful": successful}));
        peer.wait("the change is an event", "/parameter_events", |sample| {
            let changed = sample["changed_parameters"].as_array();
            let mut changed = changed.into_iter().flatten();
            changed.any(|one| one["value"]["double_value"].as_f64() == Some(value))
        })
        .await?;
    }
    Ok(())
}

fn double_of(value: &ParameterValue) -> Option<f64> {
    match value {
        ParameterValue::Double(value) => Some(*value),
        _ => None,
    }
}

async fn call_services(peer: &Peer, agent: &str, last: u32) -> Result<()> {
    let request = QueryStatusRequest {
        include_waiting: true,
    };
    let status = peer.call::<QueryStatus>("query_status", request).await?;
    let settled = status.progress.settled;
    did(
        "query_status",
        json!({"target": status.target, "settled": settled}),
    );
    let spare = AddModuleRequest {
        module_id: last + 1,
        x: 40.0,
        y: 40.0,
        theta: 0.0,
    };
    let name = format!("{agent}/add_module");
    let answer = peer.call::<AddModule>(&name, spare).await?;
    did("add_module", json!({"success": answer.success}));
    let spare = RetireModuleRequest {
        module_id: last + 1,
        rejoin: false,
    };
    let name = format!("{agent}/retire_module");
    let answer = peer.call::<RetireModule>(&name, spare).await?;
    did("retire_module", json!({"success": answer.success}));
    let gone = RemoveModuleRequest {
        module_id: last + 2,
        incarnation: 1,
    };
    let answer = peer.call::<RemoveModule>("remove_module", gone).await?;
    did("remove_module", json!({"success": answer.success}));
    Ok(())
}

/// Withdraws the target, and announces it once more, moved by three units: a target of the client's own.
async fn announce(peer: &Peer) -> Result<()> {
    let targets = peer.publisher::<TargetConfiguration>("target", latched())?;
    let is_withdrawn = |sample: &Value| sample["withdrawn"] == true;
    let first = peer
        .wait("the target", "target", |sample| !is_withdrawn(sample))
        .await?;
    let request = WithdrawTargetRequest { revision: 0 };
    let answer = peer
        .call::<WithdrawTarget>("withdraw_target", request)
        .await?;
    did("withdraw_target", json!({"success": answer.success}));
    let withdrawn = peer.wait("the withdrawal", "target", is_withdrawn).await?;
    let withdrawn: TargetConfiguration = serde_json::from_value(withdrawn)?;
    let mut target: TargetConfiguration = serde_json::from_value(first)?;
    target.revision = withdrawn.revision + 1;
    "moved".clone_into(&mut target.name);
    for spot in &mut target.spots {
        spot.x += 3.0;
    }
    targets.publish(&target)?;
    let moved = peer
        .wait("a roster for it", "roster", |sample| {
            sample["target"]["name"] == "moved"
        })
        .await?;
    did("target", json!({"name": moved["target"]["name"]}));
    let epoch = |sample: &Value| sample["epoch"]["number"].as_u64();
    let verdict = peer
        .wait("a verdict on it", "verdict", |sample| {
            epoch(sample) >= epoch(&moved)
        })
        .await?;
    did("verdict", json!({"outcome": verdict["outcome"]}));
    Ok(())
}

/// Sends a goal that cannot be completed, and cancels it.
async fn cancel(action: &Action, modules: u32) -> Result<()> {
    let mut goal = send(action, "undersupply", modules).await?;
    let mut statuses = goal.status_watch().ok_or("no statuses")?;
    let mut feedback = goal.feedback().ok_or("no feedback")?;
    let progress = timeout(LIMIT, feedback.recv()).await?;
    let stage = progress.map(|progress| progress.progress.stage);
    let answer = timeout(LIMIT, goal.cancel()).await??;
    let id = goal.id();
    let goals = answer.goals_canceling.iter();
    let of_it = goals.filter(|other| other.goal_id == id).count();
    goal.result_with_timeout(LIMIT).await?;
    let status = last_status(&mut statuses).await?;
    did(
        "cancel",
        json!({"goals": of_it, "status": status, "stage": stage}),
    );
    Ok(())
}

/// Stops all modules by a message instead of the service.
async fn command(peer: &Peer) -> Result<()> {
    let commands = peer.publisher::<OperatorCommand>("commands", latched())?;
    let known = peer.samples("heartbeats", |sample| {
        stops(sample).map(|(revision, _)| revision).max()
    });
    let known = known.into_iter().flatten().max().unwrap_or(0);
    let mut command = OperatorCommand {
        protocol_version: PROTOCOL_VERSION,
        ..OperatorCommand::default()
    };
    command.stop.revision = known + 1;
    command.stop.stopped = true;
    commands.publish(&command)?;
    peer.wait("all heartbeats show it", "heartbeats", |sample| {
        stops(sample).all(|(revision, stopped)| stopped && revision > known)
    })
    .await?;
    did("command", json!({}));
    Ok(())
}

/// Subscribes late: what was published before comes from the caches of the publishers.
async fn late(peer: &Peer) -> Result<()> {
    peer.subscribe_as::<Verdict>("verdict", "late", latched(), |_| ())?;
    let verdict = peer
        .wait("a verdict that was published before", "late", |_| true)
        .await?;
    did("late", json!({"outcome": verdict["outcome"]}));
    Ok(())
}
