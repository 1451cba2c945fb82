//! The faults that strike a cluster, and their ends.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{Decision, Message, ModuleId, SpotClaim};
use formation::protocol::{Command, Input};

use super::schedule::Happening;
use super::{Cluster, Observation};
use crate::faults::Strike;
use crate::network::Participant;

impl Cluster {
    /// Lets a module's process start no earlier than `at`; for calls before the first step.
    pub fn start_late(&mut self, module: ModuleId, at: Duration) {
        self.late.insert(module, at);
    }

    /// Tells a module to leave the formation or to take part again.
    pub fn command(&mut self, module: ModuleId, command: Command) {
        if self.processes.contains_key(&module) {
            self.fault(Strike::Command(module, command));
            self.input(module, Input::Command(command));
        }
    }

    /// Breaks or mends a module's drive: a broken one fails as soon as it is to go. A new process has a new drive.
    pub fn break_drive(&mut self, module: ModuleId, broken: bool) {
        if let Some(process) = self.processes.get_mut(&module) {
            process.drive_broken = broken;
            self.fault(Strike::Drive { module, broken });
        }
    }

    /// From now on, some claims are preceded by a forged one that claims something else for the same turn. It reaches
    /// half of the readers, from a sender that the transport does not tell.
    pub fn forge_claims(&mut self) {
        self.forges_claims = true;
        self.fault(Strike::ForgeClaims);
    }

    pub(super) fn forge(&mut self, claim: &SpotClaim) {
        if !self.forges_claims || self.random.below(3) > 0 || claim.decision.selections.is_empty() {
            return;
        }
        let forged = Arc::new(SpotClaim {
            decision: Decision::default(),
            ..claim.clone()
        });
        let readers: Vec<ModuleId> = self.processes.keys().copied().collect();
        for reader in readers {
            if reader != claim.claimant && self.random.below(2) == 0 {
                let message = Message::Claim(Arc::clone(&forged));
                self.input(
                    reader,
                    Input::Message {
                        source: None,
                        message,
                    },
                );
            }
        }
    }

    /// Makes each input keep a process busy for `lag`, for a while.
    pub fn slow_down(&mut self, module: ModuleId, lag: Duration, span: Duration) {
        let until = self.now + span;
        if let Some(process) = self.processes.get_mut(&module) {
            process.slow = Some((until, lag));
            self.fault(Strike::Slow { module, lag, span });
        }
    }

    /// Ends a module's process without warning; its body stays, halted and docked as it is.
    pub fn crash(&mut self, module: ModuleId) {
        let Some(mut process) = self.processes.remove(&module) else {
            return;
        };
        let now = process.local(self.now);
        process.drive.halt(now);
        if let Some(remains) = self.remains.get_mut(&module) {
            remains.identity.pose = process.drive.pose();
            remains.identity.links = process.agent.links().clone();
        }
        self.network.forget(module);
        self.held.retain(|channel, _| {
            channel.from != Participant::Module(module) && channel.to != module
        });
        self.fault(Strike::Crash(module));
    }

    /// Starts a module's process again, as a new incarnation.
    pub fn restart(&mut self, module: ModuleId) {
        // One that has yet to start for the first time starts in its own time.
        if !self.processes.contains_key(&module) && !self.late.contains_key(&module) {
            self.fault(Strike::Restart(module));
            self.schedule(self.now, Happening::Start(module));
        }
    }

    /// Stops a process for a while; what reaches it waits and comes all at once.
    pub fn pause(&mut self, module: ModuleId, duration: Duration) {
        let until = self.now + duration;
        let incarnation = if let Some(process) = self.processes.get_mut(&module) {
            process.held_until = process.held_until.max(until);
            process.incarnation
        } else {
            return;
        };
        self.fault(Strike::Pause(module, duration));
        self.schedule(until, Happening::Timeout(module, incarnation));
    }

    /// Cuts these modules off from all others.
    pub fn cut(&mut self, aside: &BTreeSet<ModuleId>) {
        self.network.cut(aside);
        self.fault(Strike::Cut(aside.clone()));
        self.release();
    }

    /// Lets these links carry nothing from the first module to the second, and all others of them work again.
    pub fn sever(&mut self, links: &BTreeSet<(ModuleId, ModuleId)>) {
        self.network.sever(links);
        self.fault(Strike::Sever(links.clone()));
        self.release();
    }

    /// Ends the cut and mends all links; reliable messages that were held are sent again.
    pub fn heal(&mut self) {
        self.network.heal();
        self.fault(Strike::Heal);
        self.release();
    }

    /// Sends again what was held; what cannot pass yet is held on.
    fn release(&mut self) {
        for (channel, samples) in std::mem::take(&mut self.held) {
            for (sample, message) in samples {
                self.send(channel, sample, message);
            }
        }
    }

    fn fault(&mut self, strike: Strike) {
        self.observe(Observation::Fault(strike));
    }
}
