//! A ROS 2 node without a ROS 2 installation. This crate knows nothing of formations.
//!
//! A process joins the graph with [`ros_context::RosContext::join`], which creates one participant and one node, over DDS or
//! Zenoh. From this context it gets the queues of its topics, services and actions, which are declared as values
//! ([`topic::Topic`], [`service::DeclaredService`], [`action::Action`]). Then [`ros_context::RosContext::run`] runs the one event loop
//! of all nodes, which calls the process's [`node::Node`], and serves its parameters, `/rosout` and
//! `/diagnostics`.
//!
//! Five watchdogs guard against faults of the DDS library: `dds_liveness` finds that it no longer receives, `addresses` that it
//! does not listen at all addresses of the machine, `wall_clock` that it reads no heartbeats as the clock was set back,
//! `returned_participants` that it does not match who is back, and `dds_deadlock` that it has locked itself up.

pub mod action;
mod addresses;
pub mod arguments;
pub mod cdr;
mod dds_action;
mod dds_client;
mod dds_deadlock;
mod dds_graph;
mod dds_liveness;
mod dds_service;
mod dds_state_writer;
pub mod diagnostics;
pub mod environment;
mod event_loop;
pub mod exit;
mod fast_dds;
pub mod goals;
mod graph;
pub mod inputs;
pub mod interfaces;
mod logging;
pub mod middleware;
pub mod node;
mod node_interfaces;
pub mod parameters;
mod participant_events;
mod publisher_queue;
mod raw_sample;
mod returned_participants;
pub mod ros_context;
mod ros_context_error;
mod rosout;
pub mod security;
pub mod service;
pub mod service_mapping;
pub mod settings;
pub mod stamp;
mod subscription;
pub mod terminal;
pub mod topic;
pub mod topic_statistics;
pub mod type_hash;
mod wall_clock;
pub mod words;
#[cfg(feature = "zenoh")]
mod zenoh_graph;

pub use publisher_queue::PublisherQueue;
pub use raw_sample::RawSample;
#[cfg(feature = "zenoh")]
pub use zenoh_graph::{protection, router};
