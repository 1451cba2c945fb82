//! Runs as readable text: one line for each thing worth reading.

use std::time::Duration;

use formation::model::{Message, RosterMessage};

use crate::cluster::Observation;

/// The line for an observation; `None` for what repeats without news, such as heartbeats.
pub(crate) fn line(now: Duration, observation: &Observation) -> Option<String> {
    let text = match observation {
        Observation::Published(module, message) => format!("{module:<10} {}", published(message)?),
        Observation::Noted(module, event) => format!("{module:<10} {event}"),
        Observation::SetOff(..) => return None,
        Observation::Fault(what) => format!("--------   {what}"),
    };
    Some(format!("{:>9.3} s  {text}", now.as_secs_f64()))
}

fn published(message: &Message) -> Option<String> {
    match message {
        Message::Roster(RosterMessage::Gather { epoch, .. }) => {
            Some(format!("-> GATHER for {epoch}"))
        }
        Message::Roster(RosterMessage::Plan(roster)) => {
            let members: Vec<String> = roster
                .members
                .iter()
                .map(|member| match member.module.pin {
                    Some(spot) => format!("{}@{}", member.module.id.0, spot.0),
                    None => member.module.id.0.to_string(),
                })
                .collect();
            Some(format!(
                "-> roster of {}: {}",
                roster.epoch,
                members.join(" ")
            ))
        }
        Message::Claim(claim) => {
            let pairs: Vec<String> = claim
                .decision
                .selections
                .iter()
                .map(|pair| format!("{}={}", pair.spot.0, pair.module.0))
                .collect();
            let what = if pairs.is_empty() {
                "NO_SPOT_FOUND".to_owned()
            } else {
                pairs.join(" ")
            };
            Some(format!(
                "-> claim {} of {}: {what}",
                claim.turn, claim.epoch
            ))
        }
        Message::Eviction(notice) => {
            let eviction = &notice.eviction;
            let to = eviction
                .to
                .map_or("nowhere".to_owned(), |spot| spot.to_string());
            Some(format!(
                "-> eviction of {} from {} to {to}",
                eviction.evicted, eviction.from
            ))
        }
        Message::Target(_) | Message::ModuleState(_) | Message::Heartbeat(_) => None,
    }
}
