//! Which domain a run takes, so that it does not mix with another formation.
//!
//! A run keeps a claim on its domain and namespace, which other launchers on the machine see at once. Formations that were
//! started otherwise, or on other machines, are found by their messages; two launchers on different machines that choose at
//! the same moment do not see each other.

use std::collections::BTreeSet;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::RangeInclusive;
use std::time::Duration;

use async_channel::bounded;
use formation_model::text::joined;
use formation_node_support::find_sessions;
use ros_runtime::arguments::Namespace;
use ros_runtime::environment::{DiscoveryRange, Domain, Environment};
use ros_runtime::exit::Failure;
use ros_runtime::middleware::Middleware;

use super::claim::{ClaimError, DomainClaim, Holder};
use super::router;
use super::sockets::{has_sockets, participants_taken};
use crate::arguments::RunArguments;
use crate::{console, joining};

/// The domains from which a run takes one by itself: their ports are not among those that machines assign to any program.
const DOMAINS: RangeInclusive<u16> = 0..=100;

/// How long a run looks for other formations in a domain: several discoveries, and a heartbeat of two seconds.
const LOOK: Duration = Duration::from_secs(3);
/// At most in this many domains, so that a run starts or is refused within half a minute.
const LOOKS_MAX: usize = 8;

/// Where the processes of a run are.
pub struct Place {
    /// The domain and the discovery range of all processes.
    pub environment: Environment,
    /// Kept until the run has ended.
    claim: Option<DomainClaim>,
}

impl Place {
    /// A place that no other run can reach.
    pub fn alone(environment: Environment) -> Self {
        let claim = None;
        Self { environment, claim }
    }

    /// Names the session of the run to other launchers.
    pub fn announce(&mut self, session: u32) {
        if let Some(claim) = &mut self.claim {
            claim.announce(session);
        }
    }
}

/// The formation that has a domain and namespace already.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Occupant {
    /// A run on this machine.
    Run(Holder),
    /// One or more that send messages.
    Sessions(BTreeSet<u64>),
}

impl fmt::Display for Occupant {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Run(holder) => write!(formatter, "a {holder}"),
            Self::Sessions(sessions) => {
                let sessions = joined(sessions, " and of session ");
                write!(formatter, "a formation of session {sessions}")
            }
        }
    }
}

/// Takes the domain that the user names, or else the first one in which no other formation is; says so if that is not 0.
///
/// # Errors
/// Names the formation that has the domain.
pub fn choose(
    arguments: &RunArguments,
    middleware: Middleware,
    environment: Environment,
) -> Result<Place, Failure> {
    if middleware == Middleware::Zenoh && !router::names_routers() {
        // The router of the run has no other clients.
        return Ok(Place::alone(environment));
    }
    let namespace = joining::namespace()?;
    let carrier = carrier(middleware);
    let is_named = arguments.domain.is_some() || router::variable("ROS_DOMAIN_ID").is_some();
    let named = environment.domain.number();
    let candidates = if is_named { named..=named } else { DOMAINS };
    let mut first = None;
    let mut looks = 0;
    for number in candidates {
        if number != named && middleware == Middleware::Dds && has_sockets(number) {
            continue;
        }
        let environment = Environment {
            domain: Domain::try_from(number).map_err(Failure::failed)?,
            ..environment
        };
        let occupant = match DomainClaim::take(&carrier, number, namespace.as_str()) {
            Err(ClaimError::Held(holder)) => Occupant::Run(holder),
            claim => {
                let sessions = match needs_look(middleware, environment) {
                    true => {
                        looks += 1;
                        other_sessions(arguments, middleware, environment)?
                    }
                    false => BTreeSet::new(),
                };
                if sessions.is_empty() {
                    if let Some(occupant) = &first {
                        console::note(&format!(
                            "note: {occupant} has domain {named} and namespace {namespace}, so this runs in domain \
                             {number}; for other terminals: export ROS_DOMAIN_ID={number}"
                        ));
                    }
                    return Ok(claimed(claim, environment));
                }
                Occupant::Sessions(sessions)
            }
        };
        first.get_or_insert(occupant);
        if looks == LOOKS_MAX {
            break;
        }
    }
    Err(refusal(first.as_ref(), named, &namespace, is_named))
}

/// Why a run has no domain, and what to do.
fn refusal(
    occupant: Option<&Occupant>,
    domain: u16,
    namespace: &Namespace,
    is_named: bool,
) -> Failure {
    let occupant = occupant.map_or("another program".to_owned(), ToString::to_string);
    let advice = match is_named {
        true => "end it, or use another domain with --domain or ROS_DOMAIN_ID",
        false => "no other domain was found free; choose one with --domain or ROS_DOMAIN_ID",
    };
    Failure::bad_input(format!(
        "{occupant} has domain {domain} and namespace {namespace}; {advice}, or another namespace with ROS_NAMESPACE"
    ))
}

/// The place with its claim. Without one, a run that starts at the same moment may take the same domain.
fn claimed(claim: Result<DomainClaim, ClaimError>, environment: Environment) -> Place {
    if let Err(ClaimError::Unavailable(error)) = &claim {
        console::note(&format!(
            "warning: cannot reserve domain {} ({error}); do not start another run at the same moment",
            environment.domain
        ));
    }
    let claim = claim.ok();
    Place { environment, claim }
}

/// What carries the messages, as claims name it: runs that use different routers do not meet.
fn carrier(middleware: Middleware) -> String {
    match middleware {
        Middleware::Dds => middleware.to_string(),
        Middleware::Zenoh => {
            let mut hasher = DefaultHasher::new();
            router::named_routers().hash(&mut hasher);
            format!("{middleware}-{:016x}", hasher.finish())
        }
    }
}

/// Whether there may be formations that no claim shows. On loopback over DDS, they have sockets on this machine.
fn needs_look(middleware: Middleware, environment: Environment) -> bool {
    middleware == Middleware::Zenoh
        || environment.range != DiscoveryRange::Localhost
        || participants_taken(environment.domain.number()) > 0
}

/// The sessions in a domain other than the one that the user has chosen for this run.
fn other_sessions(
    arguments: &RunArguments,
    middleware: Middleware,
    environment: Environment,
) -> Result<BTreeSet<u64>, Failure> {
    let settings = joining::settings(environment, middleware, &[])?;
    // Until the run starts, a signal ends the launcher.
    let (_sender, never) = bounded(1);
    match find_sessions(&settings, LOOK, &never) {
        Ok(sessions) => {
            let mut sessions: BTreeSet<u64> = sessions.into_keys().collect();
            if let Some(own) = arguments.session {
                sessions.remove(&own.into());
            }
            Ok(sessions)
        }
        Err(error) => {
            console::note(&format!(
                "warning: cannot look for other formations in domain {}: {error}",
                environment.domain
            ));
            Ok(BTreeSet::new())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_names_the_formation_and_what_to_do() {
        let sessions = Occupant::Sessions([4, 7].into());
        let namespace: Namespace = "/fleet".parse().unwrap();
        assert_eq!(
            refusal(Some(&sessions), 5, &namespace, true).to_string(),
            "a formation of session 4 and of session 7 has domain 5 and namespace /fleet; end it, or use another domain \
             with --domain or ROS_DOMAIN_ID, or another namespace with ROS_NAMESPACE"
        );
        let run = Occupant::Run(Holder::default());
        assert_eq!(
            refusal(Some(&run), 0, &namespace, false).to_string(),
            "a `formation run` that is starting has domain 0 and namespace /fleet; no other domain was found free; \
             choose one with --domain or ROS_DOMAIN_ID, or another namespace with ROS_NAMESPACE"
        );
    }
}
