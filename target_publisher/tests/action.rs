//! The action `FormConfiguration` by the mapping of Fast DDS and Connext. CycloneDDS for Python cannot send a request's
//! identity as inline QoS, so the other side here is the client of the library.

use std::net::Ipv4Addr;
use std::time::Duration;

use async_io::Timer;
use formation_msgs::{
    Edge, FormConfigurationFeedback, FormConfigurationGoal, FormConfigurationResult, Spot,
    TargetConfiguration,
};
use formation_tests::{Domain, Running};
use futures::future::Either;
use futures::{FutureExt, StreamExt};
use ros2_client::action::{ActionClientQosPolicies, GoalId, GoalStatusEnum, SendGoalResponse};
use ros2_client::builtin_interfaces::Time;
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{
    ActionClient, ActionTypeName, Context, Message, Name, Node, NodeName, NodeOptions,
};
use rustdds::DomainParticipantBuilder;
use serde::{Deserialize, Serialize};

/// For each step. A service that does not answer at all is what this looks for.
const PATIENCE: Duration = Duration::from_secs(20);

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(transparent)]
struct Carried<T>(T);

impl<T: Serialize + serde::de::DeserializeOwned> Message for Carried<T> {}

type FormConfiguration = ActionClient<
    Carried<FormConfigurationGoal>,
    Carried<FormConfigurationResult>,
    Carried<FormConfigurationFeedback>,
>;

fn client(domain: &Domain) -> (Node, FormConfiguration) {
    let participant = DomainParticipantBuilder::new(domain.number())
        .with_only_networks([Ipv4Addr::LOCALHOST])
        .build()
        .unwrap();
    let context = Context::from_domain_participant(participant).unwrap();
    let options = NodeOptions::new()
        .enable_rosout(false)
        .start_parameter_services(false);
    let mut node = context
        .new_node(NodeName::new("/", "client").unwrap(), options)
        .unwrap();
    let qos = QosProfile::publisher_default()
        .reliability(Reliability::Reliable {
            when_full: WhenFull::Fail,
        })
        .history(History::KeepLast { depth: 10 });
    let client = node
        .create_action_client(
            ros2_client::ServiceMapping::Enhanced,
            &Name::new("/formation", "form_configuration").unwrap(),
            &ActionTypeName::new("formation_msgs", "FormConfiguration"),
            ActionClientQosPolicies {
                goal_service: qos.clone(),
                result_service: qos.clone(),
                cancel_service: qos.clone(),
                feedback_subscription: qos.clone(),
                status_subscription: qos.durability(Durability::TransientLocal),
            },
        )
        .unwrap();
    (node, client)
}

fn pair() -> FormConfigurationGoal {
    let spot = |id, x| Spot {
        id,
        x,
        ..Spot::default()
    };
    FormConfigurationGoal {
        target: TargetConfiguration {
            name: "pair".to_owned(),
            spots: vec![spot(1, 0.0), spot(2, 1.0)],
            edges: vec![Edge {
                first: 1,
                second: 2,
            }],
            ..TargetConfiguration::default()
        },
        ..FormConfigurationGoal::default()
    }
}

/// Waits for one step of the action, and says which one does not come.
async fn within<T>(step: &str, publisher: &Running, answer: impl Future<Output = T>) -> T {
    let answer = std::pin::pin!(answer.fuse());
    let late = std::pin::pin!(FutureExt::fuse(Timer::after(PATIENCE)));
    match futures::future::select(answer, late).await {
        Either::Left((answer, _)) => answer,
        Either::Right(_) => panic!(
            "{step} does not come; the publisher logged: {:#?}",
            publisher.log_since(0)
        ),
    }
}

/// Sends the goal until it is answered: the publisher may have to restart itself before it serves, and what is sent to its
/// first endpoints is lost.
async fn send_goal(client: &FormConfiguration) -> (GoalId, SendGoalResponse) {
    loop {
        let answer = std::pin::pin!(client.async_send_goal(Carried(pair())).fuse());
        let late = std::pin::pin!(FutureExt::fuse(Timer::after(PATIENCE / 4)));
        if let Either::Left((answer, _)) = futures::future::select(answer, late).await {
            return answer.unwrap();
        }
    }
}

/// Asks anew now and then: the wait of the library looks at what is matched only when an endpoint is declared, and sleeps on
/// where the match itself comes after the last of these.
async fn wait_for_services(client: &FormConfiguration, node: &Node) {
    loop {
        let all = async {
            client.goal_client().wait_for_service(node).await;
            client.cancel_client().wait_for_service(node).await;
            client.result_client().wait_for_service(node).await;
        };
        let all = std::pin::pin!(all.fuse());
        let late = std::pin::pin!(FutureExt::fuse(Timer::after(PATIENCE / 40)));
        if let Either::Left(_) = futures::future::select(all, late).await {
            return;
        }
    }
}

async fn drive(client: &FormConfiguration, node: &Node, publisher: &Running) {
    within("a service", publisher, wait_for_services(client, node)).await;
    let (goal, response) = within("the answer to the goal", publisher, send_goal(client)).await;
    assert!(response.accepted);
    let mut feedback = Box::pin(client.feedback_stream(goal));
    let first = within("feedback", publisher, feedback.next()).await;
    let first = first.unwrap().unwrap();
    assert_eq!(first.0.progress.stage, 2, "modules are awaited");
    let result = client.async_request_result(goal);
    let cancel = async {
        let response = client.async_cancel_goal(goal, Time::ZERO).await.unwrap();
        assert_eq!(response.goals_canceling.len(), 1);
    };
    let ended = futures::future::join(result, cancel);
    let (result, ()) = within("the end of the goal", publisher, ended).await;
    let (status, Carried(result)) = result.unwrap();
    assert_eq!(status, GoalStatusEnum::Canceled);
    assert!(
        result.message.contains("0 live modules"),
        "{}",
        result.message
    );
}

#[test]
fn a_goal_is_sent_followed_and_cancelled_where_identities_are_inline_qos() {
    let domain = Domain::for_processes(4);
    let mapping = ["--service-mapping", "enhanced"];
    // First, as the library can lock itself up while it creates endpoints and discovers others.
    let (mut node, client) = client(&domain);
    let publisher = Running::start("target_publisher", &domain, &mapping);
    let spinner = node.spinner().unwrap();
    async_io::block_on(async {
        let spin = async {
            spinner.spin().await.unwrap();
            std::future::pending::<()>().await;
        };
        futures::select! {
            () = Box::pin(drive(&client, &node, &publisher).fuse()) => {}
            () = Box::pin(spin.fuse()) => panic!("the library stopped"),
        }
    });
    assert_eq!(publisher.stop().status, 0);
}
