//! The state of a search: agents, the messages between them, and the next steps.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher as _};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Heartbeat, Incarnation, Message, ModuleId, ModuleState, Pose, RosterMessage,
};
use formation_motion::MotionGoal;
use formation_protocol::Agent;

use super::evidence::{Evidence, PlanKey};
use super::{Bound, MODULES, Step, Trail};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Agenda {
    Restart(usize),
    Heal,
}

#[derive(Clone)]
pub(super) struct Flight {
    pub(super) from: Option<usize>,
    pub(super) to: usize,
    pub(super) topic: u8,
    pub(super) message: Message,
    pub(super) hash: u64,
}

/// The goal, when it is reached, when it was last repeated, and its plan.
pub(super) type Journey = (MotionGoal, Duration, Duration, Option<PlanKey>);

#[derive(Clone)]
pub(super) struct Actor {
    pub(super) agent: Agent,
    pub(super) incarnation: Incarnation,
    pub(super) pose: Pose,
    pub(super) drive: Option<Journey>,
    pub(super) hash: u64,
}

/// The fault in progress, and what may still disturb the schedule.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct Disturbance {
    /// The module that is cut off.
    pub(super) cut: Option<usize>,
    /// What ends the fault, and when.
    pub(super) agenda: Option<(Duration, Agenda)>,
    /// The number of deviations that are left.
    pub(super) deviations: u8,
    /// Whether a fault may still occur.
    pub(super) fault: bool,
    /// When the last disturbance came or ended.
    pub(super) last: Duration,
}

/// The latest messages of each module.
#[derive(Clone, Default)]
pub(super) struct Published {
    /// The messages on latched topics, for modules that start later.
    pub(super) latched: BTreeMap<(usize, u8), Vec<Message>>,
    pub(super) heartbeats: BTreeMap<usize, Heartbeat>,
    pub(super) states: BTreeMap<usize, Arc<ModuleState>>,
}

#[derive(Clone)]
pub(super) struct World {
    pub(super) now: Duration,
    pub(super) actors: [Option<Rc<Actor>>; MODULES],
    pub(super) flights: Vec<Rc<Flight>>,
    pub(super) held: Vec<Rc<Flight>>,
    pub(super) disturbance: Disturbance,
    pub(super) published: Published,
    pub(super) ended_since: Option<Duration>,
    pub(super) evidence: Rc<Evidence>,
    pub(super) violation: Option<String>,
    pub(super) trail: Option<Rc<Trail>>,
}

pub(super) fn hash_of(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

fn hash_of_message(message: &Message) -> u64 {
    match message {
        // There is one target.
        Message::Target(announcement) => hash_of(&announcement.revision),
        Message::ModuleState(state) | Message::OtherSessionState(state) => hash_of(state),
        Message::Roster(RosterMessage::Gather {
            epoch,
            target_revision,
            ..
        }) => hash_of(&(epoch, target_revision)),
        Message::Roster(RosterMessage::Plan(roster)) => hash_of(&(
            roster.epoch,
            &roster.members,
            &roster.voters,
            &roster.bodies,
        )),
        Message::Claim(claim) => hash_of(claim),
        Message::Eviction(notice) => hash_of(notice),
        Message::Heartbeat(heartbeat) => hash_of(heartbeat),
        Message::Stop(stop) => hash_of(stop),
        Message::Removal(removal) => hash_of(removal),
    }
}

fn topic_of(message: &Message) -> u8 {
    match message {
        Message::Target(_) => 0,
        Message::ModuleState(_) | Message::OtherSessionState(_) => 1,
        Message::Roster(_) => 2,
        Message::Claim(_) => 3,
        Message::Eviction(_) => 4,
        Message::Heartbeat(_) => 5,
        Message::Stop(_) | Message::Removal(_) => 6,
    }
}

const HEARTBEATS: u8 = 5;
const CLAIMS: u8 = 3;

pub(super) fn id(index: usize) -> ModuleId {
    ModuleId(u32::try_from(index).unwrap() + 1)
}

impl Actor {
    pub(super) fn due(&self) -> Duration {
        let timeout = self.agent.poll_timeout();
        self.drive
            .map_or(timeout, |(_, arrives, ..)| arrives.min(timeout))
    }
}

impl World {
    pub(super) fn hash(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.now.hash(&mut hasher);
        for actor in &self.actors {
            actor.as_ref().map(|actor| actor.hash).hash(&mut hasher);
        }
        for flights in [&self.flights, &self.held] {
            flights.len().hash(&mut hasher);
            for flight in flights {
                (flight.from, flight.to, flight.hash).hash(&mut hasher);
            }
        }
        (self.disturbance, self.ended_since).hash(&mut hasher);
        self.evidence.hash(&mut hasher);
        hasher.finish()
    }

    pub(super) fn is_down(&self, index: usize) -> bool {
        matches!(self.disturbance.agenda, Some((_, Agenda::Restart(down))) if down == index)
    }

    pub(super) fn remove(&mut self, index: usize) {
        self.actors[index] = None;
        self.flights.retain(|flight| flight.to != index);
        self.published.latched.retain(|(from, _), _| *from != index);
        self.published.heartbeats.remove(&index);
        self.published.states.remove(&index);
        Rc::make_mut(&mut self.evidence).in_epoch.remove(&id(index));
    }

    pub(super) fn deviate(&mut self) {
        self.disturbance.deviations -= 1;
        self.disturbance.last = self.now;
    }

    pub(super) fn use_fault(&mut self) {
        self.disturbance.fault = false;
        self.disturbance.last = self.now;
    }

    pub(super) fn choices(&self, bound: Bound) -> Vec<Step> {
        let mut steps = Vec::new();
        let in_time = self.now < bound.until;
        let deviates = self.disturbance.deviations > 0 && in_time;
        let mut channels = BTreeSet::new();
        for (index, flight) in self.flights.iter().enumerate() {
            let first = channels.insert((flight.from, flight.to, flight.topic));
            if index == 0 || (deviates && first) {
                steps.push(Step::Deliver(index));
            }
            if deviates && flight.topic == HEARTBEATS {
                steps.push(Step::Lose(index));
            }
        }
        if self.flights.is_empty() || deviates {
            steps.push(Step::RunTimer);
        }
        if self.disturbance.fault && in_time {
            for index in 0..MODULES {
                steps.push(Step::Crash(index));
                steps.push(Step::CrashAndRestart(index));
                steps.push(Step::CutOff(index));
            }
        }
        steps
    }

    pub(super) fn send(&mut self, from: Option<usize>, to: usize, message: &Message) {
        if self.actors[to].is_none() || self.is_down(to) {
            return;
        }
        let topic = topic_of(message);
        let flight = Rc::new(Flight {
            from,
            to,
            topic,
            message: message.clone(),
            hash: hash_of_message(message),
        });
        let severed = self
            .disturbance
            .cut
            .is_some_and(|cut| from.is_some() && (from == Some(cut)) != (to == cut));
        if !severed {
            self.flights.push(flight);
        } else if topic != HEARTBEATS {
            // Only the latest of a latched topic gets through when the cut ends; of claims, all.
            if topic != CLAIMS {
                self.held
                    .retain(|held| (held.from, held.to, held.topic) != (from, to, topic));
            }
            self.held.push(flight);
        }
    }

    pub(super) fn publish(&mut self, index: usize, message: &Message) {
        let topic = topic_of(message);
        if topic != HEARTBEATS {
            let latched = self.published.latched.entry((index, topic)).or_default();
            if topic != CLAIMS {
                latched.clear();
            }
            latched.push(message.clone());
        }
        self.note(index, message);
        for to in (0..MODULES).filter(|&to| to != index) {
            self.send(Some(index), to, message);
        }
    }
}
