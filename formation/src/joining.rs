//! The launcher itself as a node, which looks for formations and watches them. It has no services, and publishes nothing of
//! the formation.

use std::env;
use std::ffi::OsString;
use std::io;

use formation_node_support::NAMESPACE;
use ros_runtime::arguments::{Namespace, RosArguments};
use ros_runtime::environment::{self, Environment};
use ros_runtime::exit::Failure;
use ros_runtime::middleware::Middleware;
use ros_runtime::settings::Settings;

/// The namespace of the nodes that the launcher starts: that of the environment, else that of the suite.
///
/// # Errors
/// Says what is wrong with the environment variable.
pub fn namespace() -> Result<Namespace, Failure> {
    let variable = |name: &str| env::var_os(name).map(|value| value.to_string_lossy().into_owned());
    let named = environment::namespace(variable).map_err(Failure::bad_input)?;
    named.map_or_else(|| NAMESPACE.parse().map_err(Failure::failed), Ok)
}

/// The settings of a node of this process, with these parameters in addition to those that make it silent.
///
/// # Errors
/// The namespace or a parameter cannot be used.
pub fn settings(
    environment: Environment,
    middleware: Middleware,
    parameters: &[String],
) -> Result<Settings, Failure> {
    let silent = [
        "start_parameter_services:=false",
        "diagnostics_period_s:=0.0",
    ];
    let parameters = silent
        .into_iter()
        .chain(parameters.iter().map(String::as_str));
    let assigned = parameters.flat_map(|parameter| ["-p", parameter]);
    let words = ["formation", "--ros-args"].into_iter().chain(assigned);
    let no_files = |_: &std::path::Path| Err(io::Error::from(io::ErrorKind::NotFound));
    let (_, ros) =
        RosArguments::extract(words.map(OsString::from), no_files).map_err(Failure::failed)?;
    Ok(Settings {
        middleware,
        interfaces: formation_msgs::INTERFACES,
        environment,
        namespace: namespace()?,
        ros,
        ..Settings::default()
    })
}
