//! Leaving the formation without dying: retirement on command, and drives that give up.
//!
//! A module that is out of service stays a member: it freezes, computes and agrees like any other, and so counts towards
//! the majority of earlier rosters. Later rosters need no majority that includes it. Only the plan passes it over, so that a spare takes its spot, or the spot is reported open. It lets go of
//! whatever it is docked to and stands where it is.

use crate::model::{ModuleId, Roster, Service};

use super::io::{Command, Event, Output};
use super::{Agent, Stage};

impl Agent {
    /// Whether this module takes a spot when it can.
    #[must_use]
    pub fn service(&self) -> Service {
        self.service
    }

    pub(super) fn obey(&mut self, command: Command) {
        let (service, event) = match command {
            Command::Retire => (Service::Retired, Event::Retired),
            Command::Rejoin => (Service::Active, Event::Rejoined),
        };
        if self.service == service {
            return;
        }
        self.service = service;
        self.voice.state_changed = true;
        self.emit(event);
        if service != Service::Active {
            self.abandon_task();
        }
    }

    /// The drive or the ports gave up, or took too long: the module is of no use to a plan until someone has seen to it.
    pub(super) fn fail_motion(&mut self) {
        let spot = self.abandon_task();
        if self.service == Service::Active {
            self.service = Service::MotionFailed;
            self.voice.state_changed = true;
            self.emit(Event::MotionFailed(spot));
        }
    }

    fn abandon_task(&mut self) -> Option<crate::model::SpotId> {
        self.stand_still();
        self.body.settled_on = None;
        match &mut self.stage {
            Stage::Acting(acting) => acting.give_up(),
            _ => None,
        }
    }

    /// What is known of a module's service; `None` while it has not said anything of itself.
    pub(super) fn service_of(&self, module: ModuleId) -> Option<Service> {
        if module == self.module {
            return Some(self.service);
        }
        let state = self.peers.get(module)?.state.as_ref()?;
        Some(state.service)
    }

    /// The members that were active when the roster was made and are no more.
    pub(super) fn leaving(&self, roster: &Roster) -> Vec<(ModuleId, Service)> {
        roster
            .members
            .iter()
            .filter(|member| member.service == Service::Active)
            .filter_map(|member| Some((member.module.id, self.service_of(member.module.id)?)))
            .filter(|&(_, service)| service != Service::Active)
            .collect()
    }

    /// Whether any living module could take a spot.
    pub(super) fn someone_is_active(&self) -> bool {
        let mut living = self.peers.live(self.now, self.parameters.suspicion);
        living.insert(self.module);
        living
            .into_iter()
            .any(|module| self.service_of(module) == Some(Service::Active))
    }

    /// Once a plan without it is agreed on, a module that is out of service lets go of all that it is docked to.
    pub(super) fn let_go(&mut self) {
        if self.service == Service::Active || self.body.links.is_empty() {
            return;
        }
        for &link in &self.body.links {
            if self.body.ports_busy.insert(link) {
                self.outputs.push_back(Output::Undock(link));
            }
        }
    }
}
