//! The configuration of Zenoh, from the variables that `rmw_zenoh_cpp` reads.

use serde_json::{Map, Value};
use zenoh::Config;

/// The file of the configuration of sessions.
pub(super) const SESSION_FILE: &str = "ZENOH_SESSION_CONFIG_URI";
/// The file of the configuration of a router.
pub(super) const ROUTER_FILE: &str = "ZENOH_ROUTER_CONFIG_URI";
/// Values that replace those of either file: `key=value` with `;` between them.
const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";

/// What sessions and routers share: no multicast, and stamps on all data, which caches need.
const COMMON: [(&str, &str); 3] = [
    ("scouting/multicast/enabled", "false"),
    ("timestamping/enabled", "true"),
    ("queries_default_timeout", "60000"),
];

/// A session is a client of a router on this machine. A client has one link, so that a hundred processes have a hundred;
/// a hundred peers, which `rmw_zenoh_cpp` makes of them, would have 4,950. A sample for which the link has no room is dropped
/// after 10 ms, in microseconds here: longer than the default of 1 ms, as there may be more processes than processors.
pub(super) const SESSION: [(&str, &str); 4] = [
    ("mode", "\"client\""),
    ("connect/endpoints", "[\"tcp/localhost:7447\"]"),
    (
        "connect/retry",
        "{\"period_init_ms\": 200, \"period_max_ms\": 1000, \"period_increase_factor\": 2}",
    ),
    (
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop",
        "10000",
    ),
];

/// A router listens on the port of `rmw_zenohd`.
pub(super) const ROUTER: [(&str, &str); 3] = [
    ("mode", "\"router\""),
    ("listen/endpoints", "[\"tcp/[::]:7447\"]"),
    ("scouting/delay", "0"),
];

/// The settings of a session or a router with these defaults, for a file.
///
/// # Errors
/// A default is no JSON.
pub(super) fn settings(defaults: &[(&str, &str)]) -> Result<Value, String> {
    let mut settings = Value::Null;
    for (key, value) in COMMON.iter().chain(defaults) {
        let value = serde_json::from_str(value).map_err(|error| format!("{key}: {error}"))?;
        set(&mut settings, key, value);
    }
    Ok(settings)
}

/// Sets the value with this path, which is separated by `/`.
pub(super) fn set(settings: &mut Value, path: &str, value: Value) {
    let mut place = settings;
    for part in path.split('/') {
        if !place.is_object() {
            *place = Value::Object(Map::new());
        }
        place = &mut place[part];
    }
    *place = value;
}

/// The configuration of a session.
///
/// # Errors
/// Names the variable that cannot be used, and why.
pub(super) fn of_session(variable: impl Fn(&str) -> Option<String>) -> Result<Config, String> {
    configuration(SESSION_FILE, &SESSION, &[], variable)
}

/// The configuration of a router, in which `given` takes precedence over the variables.
///
/// # Errors
/// Names the variable that cannot be used, and why.
pub(super) fn of_router(
    given: &[(&str, String)],
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Config, String> {
    configuration(ROUTER_FILE, &ROUTER, given, variable)
}

fn configuration(
    file: &str,
    defaults: &[(&str, &str)],
    given: &[(&str, String)],
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Config, String> {
    let set = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
    let wrong =
        |name: &str, reason: &dyn ToString| crate::environment::wrong(name, &reason.to_string());
    let mut config = match set(file) {
        Some(path) => Config::from_file(path.trim())
            .map_err(|error| wrong(file, &format!("{path}: {error}")))?,
        None => {
            let mut config = Config::default();
            for (key, value) in COMMON.iter().chain(defaults) {
                config
                    .insert_json5(key, value)
                    .map_err(|error| format!("Zenoh refuses {key}={value}: {error}"))?;
            }
            config
        }
    };
    for entry in set(OVERRIDE).unwrap_or_default().split(';') {
        let entry = entry.trim();
        if entry.is_empty() {
            continue;
        }
        let (key, value) = entry
            .split_once('=')
            .ok_or_else(|| wrong(OVERRIDE, &format!("`{entry}` is not `key=value`")))?;
        config
            .insert_json5(key.trim(), value.trim())
            .map_err(|error| wrong(OVERRIDE, &format!("`{entry}`: {error}")))?;
    }
    for (key, value) in given {
        config
            .insert_json5(key, value)
            .map_err(|error| format!("Zenoh refuses {key}={value}: {error}"))?;
    }
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(value: Option<&str>) -> Result<Config, String> {
        of_session(|name| value.filter(|_| name == OVERRIDE).map(str::to_owned))
    }

    #[test]
    fn the_override_replaces_single_values() {
        let default = session(None).unwrap();
        assert_eq!(default.get_json("mode").unwrap(), "\"client\"");
        let endpoints = default.get_json("connect/endpoints").unwrap();
        assert!(endpoints.contains("tcp/localhost:7447"), "{endpoints}");
        let changed = session(Some(
            "connect/endpoints=[\"tcp/10.0.0.1:7447\", \"tcp/10.0.0.2:7447\"]; mode=\"peer\";",
        ))
        .unwrap();
        assert_eq!(changed.get_json("mode").unwrap(), "\"peer\"");
        let endpoints = changed.get_json("connect/endpoints").unwrap();
        assert!(endpoints.contains("10.0.0.2"), "{endpoints}");
        for wrong in ["mode", "nonsense/key=1", "mode=\"nothing\""] {
            let error = session(Some(wrong)).unwrap_err();
            assert!(error.contains(OVERRIDE) && error.contains(wrong), "{error}");
        }
    }

    #[test]
    fn a_file_that_does_not_exist_is_named() {
        let variable = |name: &str| (name == SESSION_FILE).then(|| "/nowhere.json5".to_owned());
        let error = of_session(variable).unwrap_err();
        assert!(
            error.contains(SESSION_FILE) && error.contains("/nowhere.json5"),
            "{error}"
        );
    }

    #[test]
    fn arguments_of_a_router_take_precedence() {
        let given = [("listen/endpoints", "[\"tcp/127.0.0.1:9\"]".to_owned())];
        let config = of_router(&given, |_| None).unwrap();
        assert_eq!(config.get_json("mode").unwrap(), "\"router\"");
        let endpoints = config.get_json("listen/endpoints").unwrap();
        assert!(endpoints.contains("127.0.0.1:9"), "{endpoints}");
    }
}
