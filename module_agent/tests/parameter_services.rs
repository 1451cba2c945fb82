//! The parameter services by the mapping of Fast DDS and Connext. CycloneDDS for Python cannot send a request's identity
//! as inline QoS, so the other side here is the client of the library, which supports both mappings.

use std::net::Ipv4Addr;
use std::time::Duration;

use async_io::Timer;
use formation_tests::{Domain, Running};
use futures::FutureExt;
use ros2_client::parameters::raw;
use ros2_client::qos::{History, QosProfile};
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};
use ros2_client::{
    Client, Context, Message, Name, Node, NodeName, NodeOptions, ParameterValue, ServiceTypeName,
};
use rustdds::DomainParticipantBuilder;

/// A service that does not answer at all is what this looks for.
const PATIENCE: Duration = Duration::from_secs(10);

/// How many callers ask in turn: on busy processors, two in 360 of the library's participants did not discover the service, or were
/// not discovered by it, within 20 s.
const CALLERS: usize = 3;

/// The time after which a request is sent again.
const ASK_AGAIN_AFTER: Duration = Duration::from_secs(3);

struct Caller {
    node: Node,
    mapping: ros2_client::ServiceMapping,
}

impl Caller {
    fn new(domain: u16, mapping: ros2_client::ServiceMapping) -> Self {
        let participant = DomainParticipantBuilder::new(domain)
            .with_only_networks([Ipv4Addr::LOCALHOST])
            .build()
            .unwrap();
        let context = Context::from_domain_participant(participant).unwrap();
        let name = NodeName::new("/", "caller").unwrap();
        let options = NodeOptions::new()
            .enable_rosout(false)
            .start_parameter_services(false);
        let node = context.new_node(name, options).unwrap();
        Self { node, mapping }
    }

    /// Asks as soon as the service is there, and again while there is no answer; `None` if there is none.
    fn call<Q: Message + Clone + 'static, A: Message + 'static>(
        &mut self,
        service: &str,
        name: &str,
        request: &Q,
    ) -> Option<A> {
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let client: Client<Q, A> = self
            .node
            .create_client(
                self.mapping,
                &Name::new("/formation/module_4", service).unwrap(),
                &ServiceTypeName::new("rcl_interfaces", name),
                qos.clone(),
                qos,
            )
            .unwrap();
        let spinner = self.node.spinner();
        async_io::block_on(async {
            let call = async {
                client.wait_for_service(&self.node).await;
                // A reply is lost where the server answers before it has discovered the client's reader, so ask again.
                loop {
                    let id = client.async_send_request(Q::clone(request)).await.unwrap();
                    let mut answer = Box::pin(client.async_receive_response(id).fuse());
                    futures::select! {
                        answer = answer => break answer.unwrap(),
                        _ = FutureExt::fuse(Timer::after(ASK_AGAIN_AFTER)) => {}
                    }
                }
            };
            let spin = async {
                match spinner {
                    Ok(spinner) => spinner.spin().await.map(drop).unwrap(),
                    Err(error) => panic!("{error:?}"),
                }
                std::future::pending::<()>().await;
            };
            futures::select! {
                answer = Box::pin(call.fuse()) => Some(answer),
                () = Box::pin(spin.fuse()) => panic!("the library stopped"),
                _ = FutureExt::fuse(Timer::after(PATIENCE)) => None,
            }
        })
    }
}

/// The answer of a service to a new caller. The library serves one spinner a node, so every call is by a caller of its own, which
/// also makes each the first.
fn answer<Q: Message + Clone + 'static, A: Message + 'static>(
    (domain, mapping): (u16, ros2_client::ServiceMapping),
    service: &str,
    name: &str,
    request: &Q,
) -> A {
    let mut answers =
        (0..CALLERS).map(|_| Caller::new(domain, mapping).call(service, name, request));
    let answer = answers.find_map(|answer| answer);
    answer.unwrap_or_else(|| panic!("`{service}` does not answer"))
}

fn assert_all_six_answer(mapping: &str, other: ros2_client::ServiceMapping) {
    let domain = Domain::for_processes(4);
    let module = [
        "--module",
        "4",
        "--x",
        "0",
        "--y",
        "0",
        "--service-mapping",
        mapping,
    ];
    let speed = ["--ros-args", "-p", "speed:=2.0"];
    let agent = Running::start(
        "module_agent",
        &domain,
        &[module.as_slice(), &speed].concat(),
    );
    let by = (domain.number(), other);
    let names = vec!["speed".to_owned(), "nothing".to_owned()];

    let listed: ListParametersResponse = answer(
        by,
        "list_parameters",
        "ListParameters",
        &ListParametersRequest {
            prefixes: Vec::new(),
            depth: 0,
        },
    );
    assert!(listed.result.names.contains(&"lease_s".to_owned()));
    let read: GetParametersResponse = answer(
        by,
        "get_parameters",
        "GetParameters",
        &GetParametersRequest {
            names: names.clone(),
        },
    );
    assert_eq!(read.values[0].double_value.to_string(), "2");
    let types: GetParameterTypesResponse = answer(
        by,
        "get_parameter_types",
        "GetParameterTypes",
        &GetParameterTypesRequest {
            names: names.clone(),
        },
    );
    assert_eq!(types.values, [3, 0]);
    let described: DescribeParametersResponse = answer(
        by,
        "describe_parameters",
        "DescribeParameters",
        &DescribeParametersRequest { names },
    );
    assert_eq!(described.values[0].r#type, 3);
    let change = |value| SetParametersRequest {
        parameter: vec![raw::Parameter {
            name: "speed".to_owned(),
            value: ParameterValue::Double(value).into(),
        }],
    };
    let set: SetParametersResponse = answer(by, "set_parameters", "SetParameters", &change(3.0));
    assert!(set.results[0].successful);
    let set: SetParametersAtomicallyResponse = answer(
        by,
        "set_parameters_atomically",
        "SetParametersAtomically",
        &change(-3.0),
    );
    assert!(set.result.reason.contains("must be from 0.001"), "{set:?}");

    assert_eq!(agent.stop().status, 0);
}

#[test]
fn all_six_answer_by_the_mapping_of_fast_dds() {
    assert_all_six_answer("enhanced", ros2_client::ServiceMapping::Enhanced);
}

#[test]
fn all_six_answer_by_the_mapping_of_cyclone_dds() {
    assert_all_six_answer("cyclone", ros2_client::ServiceMapping::Cyclone);
}
