//! Protected Zenoh: configuration files with certificates, the access control of routers, and what a configuration lacks.
//!
//! Access control is by the common name of a certificate, which names a role. A router applies it to what arrives from a
//! session; whatever it lets in, it may pass on to all sessions that the rules let subscribe.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use zenoh::Config;

use super::configuration::{self, set};
use super::names::mangled;
use crate::ros_context_error::RosContextError;
use crate::security::Security;

/// The only protocol of protected links.
const TLS: &str = "tls";

/// A certificate with its key and the authority that signed it, all in PEM.
#[derive(Clone, Copy, Debug)]
pub struct Credentials<'a> {
    /// The certificate of the authority.
    pub authority: &'a str,
    /// The certificate.
    pub certificate: &'a str,
    /// Its private key.
    pub key: &'a str,
}

/// What processes with a certificate may do. Names are fully qualified; `*` stands for one part of a name, `$*` for any
/// characters within a part, and `**` for any number of parts.
#[derive(Clone, Debug, Default)]
pub struct Rights {
    /// The common name of the certificates.
    pub common_name: String,
    /// The topics that they may publish.
    pub publish: Vec<String>,
    /// The topics that they may subscribe.
    pub subscribe: Vec<String>,
    /// The services that they may offer.
    pub serve: Vec<String>,
    /// The services that they may call.
    pub call: Vec<String>,
}

/// The configuration file of sessions that connect to the routers at these endpoints, such as `tls/10.0.0.1:7447`. It holds
/// the private key.
///
/// # Errors
/// Zenoh refuses a value.
pub fn session_file(credentials: Credentials<'_>, routers: &[String]) -> Result<String, String> {
    let mut settings = configuration::settings(&configuration::SESSION)?;
    set(&mut settings, "connect/endpoints", json!(routers));
    set(&mut settings, "transport/link/protocols", json!([TLS]));
    let secrets = with_credentials(credentials, &["connect"]);
    set(&mut settings, "transport/link/tls", secrets);
    finished(&settings)
}

/// The configuration file of routers that listen at this endpoint, connect to other routers only where an argument says so,
/// and let sessions do what these rights give them. Routers, whose common name is `router`, trust each other. It holds the
/// private key.
///
/// # Errors
/// Zenoh refuses a value.
pub fn router_file(
    credentials: Credentials<'_>,
    listen: &str,
    router: &str,
    rights: &[Rights],
) -> Result<String, String> {
    let mut settings = configuration::settings(&configuration::ROUTER)?;
    set(&mut settings, "listen/endpoints", json!([listen]));
    set(&mut settings, "transport/link/protocols", json!([TLS]));
    let secrets = with_credentials(credentials, &["listen", "connect"]);
    set(&mut settings, "transport/link/tls", secrets);
    set(
        &mut settings,
        "access_control",
        access_control(router, rights),
    );
    finished(&settings)
}

fn finished(settings: &Value) -> Result<String, String> {
    let text = format!("{settings:#}\n");
    Config::from_json5(&text)
        .map_err(|error| format!("Zenoh refuses the configuration: {error}"))?;
    Ok(text)
}

/// The section of TLS. Everything is in the file itself, so that one file is all that a machine needs.
fn with_credentials(credentials: Credentials<'_>, sides: &[&str]) -> Value {
    let mut section = json!({
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
        "root_ca_certificate_base64": STANDARD.encode(credentials.authority),
    });
    for side in sides {
        section[format!("{side}_certificate_base64")] =
            STANDARD.encode(credentials.certificate).into();
        section[format!("{side}_private_key_base64")] = STANDARD.encode(credentials.key).into();
    }
    section
}

/// All keys: `**` leaves out those with a part that begins with `@`.
const EVERYTHING: [&str; 3] = ["**", "**/@adv/**", "@ros2_lv/**"];

/// What a message or declaration is, as access control names it.
const ALL_MESSAGES: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];

fn access_control(router: &str, rights: &[Rights]) -> Value {
    let both = json!(["ingress", "egress"]);
    let mut rules = vec![
        json!({"id": "routers", "permission": "allow", "flows": both, "messages": ALL_MESSAGES, "key_exprs": EVERYTHING}),
        json!({"id": "received", "permission": "allow", "flows": ["egress"], "messages": ALL_MESSAGES,
            "key_exprs": EVERYTHING}),
    ];
    let mut subjects = vec![json!({"id": router, "cert_common_names": [router]})];
    let mut policies = vec![json!({"rules": ["routers"], "subjects": [router]})];
    for role in rights {
        let name = &role.common_name;
        let mut given = vec!["received".to_owned()];
        for (part, messages, keys) in rules_of(role) {
            if keys.is_empty() {
                continue;
            }
            let id = format!("{name}: {part}");
            rules.push(
                json!({"id": id, "permission": "allow", "flows": ["ingress"], "messages": messages,
                "key_exprs": keys}),
            );
            given.push(id);
        }
        subjects.push(json!({"id": name, "cert_common_names": [name]}));
        policies.push(json!({"rules": given, "subjects": [name]}));
    }
    json!({"enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies})
}

/// Kinds of messages, and the keys on which a role may send them.
type Rule = (&'static str, &'static [&'static str], Vec<String>);

/// The rules of a role, as [`super::names`] and `zenoh-ext` make keys and tokens.
fn rules_of(role: &Rights) -> [Rule; 8] {
    let keys = |names: &[String], end: &str| -> Vec<String> {
        names
            .iter()
            .map(|name| match name.trim_matches('/') {
                // It stands for the type and its hash as well.
                name if name.ends_with("**") => format!("*/{name}{end}"),
                name => format!("*/{name}/*/*{end}"),
            })
            .collect()
    };
    // A cache and what subscriptions need to notice losses stand below the key of a latched topic.
    let with_cache = |names: &[String]| [keys(names, ""), keys(names, "/@adv/pub/**")].concat();
    let shown = |names: &[String], kind: &str| -> Vec<String> {
        names.iter().map(|name| token(kind, name)).collect()
    };
    let mut tokens = vec![format!("{TOKEN}/NN/%/*/*")];
    tokens.extend(shown(&role.publish, "MP"));
    tokens.extend(shown(&role.subscribe, "MS"));
    tokens.extend(shown(&role.serve, "SS"));
    tokens.extend(shown(&role.call, "SC"));
    tokens.extend(keys(&role.publish, "/@adv/pub/**"));
    tokens.extend(keys(&role.subscribe, "/@adv/sub/**"));
    let mut graph = keys(&role.subscribe, "/@adv/**");
    graph.push("@ros2_lv/**".to_owned());
    [
        ("publish", &["put", "delete"], with_cache(&role.publish)),
        (
            "cache",
            &["declare_queryable", "reply"],
            with_cache(&role.publish),
        ),
        (
            "subscribe",
            &["declare_subscriber"],
            [keys(&role.subscribe, ""), keys(&role.subscribe, "/@adv/**")].concat(),
        ),
        ("history", &["query"], keys(&role.subscribe, "/@adv/**")),
        (
            "serve",
            &["declare_queryable", "reply"],
            keys(&role.serve, ""),
        ),
        ("call", &["query"], keys(&role.call, "")),
        ("appear", &["liveliness_token"], tokens),
        (
            "look",
            &["liveliness_query", "declare_liveliness_subscriber"],
            graph,
        ),
    ]
}

/// The begin of all tokens: domain, session, node and endpoint.
const TOKEN: &str = "@ros2_lv/*/*/*/*";

/// The tokens of endpoints of a kind and with these names.
fn token(kind: &str, name: &str) -> String {
    let parts = name.split('/').map(|part| match part {
        "*" | "**" => "$*",
        part => part,
    });
    let name = mangled(&parts.collect::<Vec<_>>().join("/"));
    format!("{TOKEN}/{kind}/%/*/*/{name}/*/*/*")
}

/// What a configuration lacks for links to be protected; `None` if they are.
pub(super) fn shortfall(config: &Config) -> Option<String> {
    let value = |key: &str| {
        let text = config.get_json(key).unwrap_or_default();
        serde_json::from_str::<Value>(&text).unwrap_or_default()
    };
    if value("transport/link/protocols") != json!([TLS]) {
        return Some("`transport/link/protocols` is not `[\"tls\"]`".to_owned());
    }
    if value("transport/link/tls/enable_mtls") != json!(true) {
        return Some("`transport/link/tls/enable_mtls` is not `true`".to_owned());
    }
    if value("transport/link/tls/verify_name_on_connect") == json!(false) {
        return Some("`transport/link/tls/verify_name_on_connect` is `false`".to_owned());
    }
    // Behind `#`, an endpoint replaces what was checked above.
    ["connect/endpoints", "listen/endpoints"]
        .into_iter()
        .find_map(|key| {
            let with_settings = texts_of(&value(key))
                .into_iter()
                .find(|text| text.contains('#'));
            with_settings.map(|endpoint| format!("`{key}` gives `{endpoint}` settings of its own"))
        })
}

/// What a router lacks besides.
pub(super) fn shortfall_of_router(config: &Config) -> Option<String> {
    let is = |key: &str, wanted: &str| config.get_json(key).is_ok_and(|value| value == wanted);
    let is_controlled =
        is("access_control/enabled", "true") && is("access_control/default_permission", "\"deny\"");
    let lacks_control = || "`access_control` is not enabled with the default `deny`".to_owned();
    shortfall(config).or_else(|| (!is_controlled).then(lacks_control))
}

/// All texts in a value.
fn texts_of(value: &Value) -> Vec<String> {
    match value {
        Value::String(text) => vec![text.clone()],
        Value::Array(values) => values.iter().flat_map(texts_of).collect(),
        Value::Object(values) => values.values().flat_map(texts_of).collect(),
        Value::Null | Value::Bool(_) | Value::Number(_) => Vec::new(),
    }
}

/// Refuses the configuration of a session whose links are not protected where they must be, and warns where they should be.
///
/// # Errors
/// Says what is missing, and which command makes files that have it.
pub(super) fn check_session(security: Security, config: &Config) -> Result<(), RosContextError> {
    check(security, shortfall(config), configuration::SESSION_FILE)
}

/// Checks the configuration of a router, like [`check_session`].
///
/// # Errors
/// As [`check_session`].
pub(super) fn check_router(security: Security, config: &Config) -> Result<(), RosContextError> {
    let shortfall = shortfall_of_router(config);
    check(security, shortfall, configuration::ROUTER_FILE)
}

fn check(
    security: Security,
    shortfall: Option<String>,
    variable: &str,
) -> Result<(), RosContextError> {
    let Some(shortfall) = shortfall else {
        return Ok(());
    };
    let shortfall = format!(
        "in the configuration of Zenoh {shortfall}; name a file that `formation security create` made in {variable}"
    );
    security
        .without(&shortfall)
        .map_err(RosContextError::BadInput)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CREDENTIALS: Credentials<'_> = Credentials {
        authority: "authority",
        certificate: "certificate",
        key: "key",
    };

    fn session() -> Config {
        let routers = ["tls/localhost:7447".to_owned()];
        Config::from_json5(&session_file(CREDENTIALS, &routers).unwrap()).unwrap()
    }

    #[test]
    fn a_session_lacks_nothing_until_one_setting_is_weakened() {
        assert_eq!(shortfall(&session()), None);
        assert!(check_session(Security::Enforced, &session()).is_ok());
        for (key, value) in [
            ("transport/link/protocols", "[\"tls\", \"tcp\"]"),
            ("transport/link/tls/enable_mtls", "false"),
            ("transport/link/tls/verify_name_on_connect", "false"),
            (
                "connect/endpoints",
                "[\"tls/localhost:7447#enable_mtls=false\"]",
            ),
        ] {
            let mut config = session();
            config.insert_json5(key, value).unwrap();
            let lacking = shortfall(&config).unwrap();
            assert!(lacking.contains(key), "{lacking}");
            let error = check_session(Security::Enforced, &config).unwrap_err();
            assert!(error.to_string().contains(key), "{error}");
            assert!(check_session(Security::Permissive, &config).is_ok());
        }
        let error = check_session(Security::Enforced, &Config::default()).unwrap_err();
        let error = error.to_string();
        assert!(error.contains("ZENOH_SESSION_CONFIG_URI"), "{error}");
    }

    #[test]
    fn a_router_lacks_nothing_until_its_access_control_is_weakened() {
        let rights = Rights {
            common_name: "module".to_owned(),
            publish: vec!["/formation/module_$*/pose".to_owned()],
            subscribe: vec!["/formation/**".to_owned()],
            serve: vec!["/formation/*/get_parameters".to_owned()],
            call: Vec::new(),
        };
        let file = router_file(CREDENTIALS, "tls/[::]:7447", "router", &[rights]).unwrap();
        let router = || Config::from_json5(&file).unwrap();
        assert_eq!(shortfall_of_router(&router()), None);
        for (key, value) in [
            ("access_control/enabled", "false"),
            ("access_control/default_permission", "\"allow\""),
        ] {
            let mut config = router();
            config.insert_json5(key, value).unwrap();
            let error = check_router(Security::Enforced, &config).unwrap_err();
            assert!(error.to_string().contains("access_control"), "{error}");
        }
    }

    #[test]
    fn tokens_and_keys_are_those_of_the_graph() {
        assert_eq!(
            token("MP", "/formation/module_$*/pose"),
            "@ros2_lv/*/*/*/*/MP/%/*/*/%formation%module_$*%pose/*/*/*"
        );
        assert_eq!(
            token("SC", "/formation/**"),
            "@ros2_lv/*/*/*/*/SC/%/*/*/%formation%$*/*/*/*"
        );
        let rights = Rights {
            publish: vec!["/formation/target".to_owned()],
            ..Rights::default()
        };
        let [(_, messages, keys), ..] = rules_of(&rights);
        assert_eq!(messages, ["put", "delete"]);
        let expected = [
            "*/formation/target/*/*",
            "*/formation/target/*/*/@adv/pub/**",
        ];
        assert_eq!(keys, expected);
    }
}
