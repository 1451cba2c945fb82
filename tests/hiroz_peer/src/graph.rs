//! What hiroz's graph shows of the other nodes.

use hiroz::dynamic::ros_type_name_from_dds;
use hiroz::entity::{EndpointEntity, EndpointKind, normalize_node_namespace};
use hiroz::prelude::ZContext;
use serde_json::{Value, json};

use crate::peer::NAME;

const KINDS: [EndpointKind; 4] = [
    EndpointKind::Publisher,
    EndpointKind::Subscription,
    EndpointKind::Service,
    EndpointKind::Client,
];

/// The other nodes and their endpoints.
pub fn shown(context: &ZContext) -> Value {
    let graph = context.graph();
    let mut nodes = Vec::new();
    let mut endpoints = Vec::new();
    for (name, namespace) in graph.get_node_names() {
        if name == NAME {
            continue;
        }
        for kind in KINDS {
            let key = (normalize_node_namespace(&namespace), name.clone());
            let found = graph.get_entities_by_node(kind, key);
            endpoints.extend(found.iter().map(|endpoint| described(&name, endpoint)));
        }
        nodes.push(json!({"name": name, "namespace": namespace}));
    }
    let mut actions = graph.get_action_names_and_types();
    actions.sort();
    json!({"nodes": nodes, "endpoints": endpoints, "actions": actions})
}

fn described(node: &str, endpoint: &EndpointEntity) -> Value {
    let info = endpoint.type_info.as_ref();
    json!({
        "node": node,
        "kind": endpoint.kind.to_string(),
        "name": endpoint.topic,
        "type": info.map(|info| ros_type_name_from_dds(&info.name)),
        "hash": info.map(|info| info.hash.to_rihs_string()),
        "reliability": format!("{:?}", endpoint.qos.reliability),
        "durability": format!("{:?}", endpoint.qos.durability),
        "depth": endpoint.qos.history.depth(),
    })
}
