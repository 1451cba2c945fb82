//! Faults and their ends.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ClosedRoster, Decision, Epoch, Heartbeat, Incarnation, Message, ModuleId, ModuleRun, Removal,
    Roster, RosterMessage, SpotClaim, Stop, Voters,
};
use formation_motion::MotionReport;
use formation_protocol::{Agent, Command, Identity, Input};

use super::Cluster;
use super::schedule::Happening;
use crate::faults::Fault;
use crate::network::Participant;
use crate::observation::Observation;
use crate::process::{Process, Stored, Suspension};

/// A second in the numbers of runs, which count the starts of a module below that.
const CLOCK_SECOND: u64 = 1_000_000;

/// Until others know that a participant has left.
const DEPARTURE: Duration = Duration::from_millis(20);

impl Cluster {
    /// Delays the start of a module's process until `at`. To be called before the first step.
    pub fn start_late(&mut self, module: ModuleId, at: Duration) {
        self.late.insert(module, at);
    }

    /// Lets each plan of a module take this time.
    pub fn plan_slowly(&mut self, module: ModuleId, time: Duration) {
        self.plan_times.insert(module, time);
    }

    /// Commands a module to leave the formation or to take part again.
    pub fn command(&mut self, module: ModuleId, command: Command) {
        if self.processes.contains_key(&module) {
            self.note(Fault::Command(module, command));
            self.input(module, Input::Command(command));
        }
    }

    /// Gives one module the command to stop or to resume all; the others know it from heartbeats.
    pub fn stop(&mut self, module: ModuleId, stop: Stop) {
        self.note(Fault::Stop(stop));
        let message = Message::Stop(stop);
        let source = None;
        self.input(module, Input::Message { source, message });
    }

    /// Breaks or repairs a module's drive: a broken one fails whenever it receives a goal. A new process has a new drive.
    pub fn break_drive(&mut self, module: ModuleId, broken: bool) {
        if let Some(process) = self.processes.get_mut(&module) {
            process.drive_broken = broken;
            self.note(Fault::Drive { module, broken });
        }
    }

    /// The driver of a module falls silent: the drive reports that it failed, and nothing else from then on. A new process has a
    /// new drive.
    pub fn mute_drive(&mut self, module: ModuleId) {
        if let Some(process) = self.processes.get_mut(&module) {
            process.is_mute = true;
            process.is_lost = process.drive.is_moving();
            self.note(Fault::SilentDriver(module));
            self.input(module, Input::Motion(MotionReport::Failed));
        }
    }

    /// The clock of a module that is yet to start is ahead of that of the test by this many seconds. What a store holds of its last
    /// run is no later than the next.
    pub fn set_clock_ahead(&mut self, module: ModuleId, ahead: Duration) {
        self.note(Fault::SetClock(module, ahead));
        if let Some(body) = self.bodies.get_mut(&module) {
            let starts = body.incarnation.0 % CLOCK_SECOND;
            let set = Incarnation(ahead.as_secs() * CLOCK_SECOND + starts);
            let last = body.has_store.then_some(body.incarnation);
            body.incarnation = set.max(last.unwrap_or(set));
        }
    }

    /// A module that is yet to start has no store.
    pub fn take_store(&mut self, module: ModuleId) {
        if let Some(body) = self.bodies.get_mut(&module) {
            body.has_store = false;
            body.is_first_run = false;
        }
        self.stores.remove(&module);
    }

    /// From now on, some claims are preceded by a forged one that claims something else for the same turn. It reaches
    /// half of the readers, from a sender that the transport does not identify.
    pub fn forge_claims(&mut self) {
        self.forges_claims = true;
        self.note(Fault::ForgeClaims);
    }

    pub(super) fn forge(&mut self, claim: &SpotClaim) {
        if !self.forges_claims || self.random.below(3) > 0 || claim.decision.selections.is_empty() {
            return;
        }
        let forged = Arc::new(SpotClaim {
            decision: Decision::default(),
            ..claim.clone()
        });
        self.observe(Observation::Injected(Message::Claim(Arc::clone(&forged))));
        let readers = self.readers();
        for reader in readers {
            if reader != self.hosting.first(claim.claimant) && self.random.below(2) == 0 {
                let message = Message::Claim(Arc::clone(&forged));
                let source = None;
                self.input(reader, Input::Message { source, message });
            }
        }
    }

    /// A participant that is no module shows an epoch later than all others, and publishes a roster for it of which modules that
    /// do not exist are the voters. Nothing happens before a target is announced.
    pub fn forge_roster(&mut self) {
        let Some(target) = self.announcement.as_deref().cloned() else {
            return;
        };
        let running = self.running();
        let epochs = running.iter().filter_map(|&one| self.standing(one)?.epoch);
        let newest = epochs.map(|epoch| epoch.number).max().unwrap_or_default();
        let invented = |back: u32| ModuleId(u32::MAX - back);
        let epoch = |ahead| Epoch {
            number: newest + ahead,
            convener: invented(0),
        };
        let incarnation = Incarnation(1);
        let roster = ClosedRoster::from(Roster {
            epoch: epoch(5),
            target,
            members: Vec::new(),
            voters: Voters {
                named: (1..=5).rev().map(invented).collect(),
                ..Voters::default()
            },
            timing: self.parameters.agent.timing(),
            bodies: Vec::new(),
        });
        let stranger = ModuleRun {
            module: invented(0),
            incarnation,
        };
        let sequence = self.now().as_secs();
        self.forge_heartbeat(stranger, sequence, Some(roster.epoch));
        self.inject(&Message::Roster(RosterMessage::Plan(Arc::new(roster))));
        self.note(Fault::ForgeRoster);
    }

    /// A participant that is no module sends a heartbeat as this run, which takes part in nothing yet.
    pub fn forge_heartbeat(&mut self, run: ModuleRun, sequence: u64, epoch: Option<Epoch>) {
        self.inject(&Message::Heartbeat(Heartbeat {
            sequence,
            uptime: Duration::from_secs(sequence),
            epoch,
            ..Heartbeat::first(run)
        }));
    }

    /// Delivers a message to every module at once, from a participant that is no module.
    pub fn inject(&mut self, message: &Message) {
        self.observe(Observation::Injected(message.clone()));
        for reader in self.readers() {
            self.tell(reader, message);
        }
    }

    /// Delivers a message to one module at once, from a participant that is no module.
    pub fn tell(&mut self, reader: ModuleId, message: &Message) {
        let source = Some(Self::STRANGER);
        let message = message.clone();
        self.input(reader, Input::Message { source, message });
    }

    /// Makes each input keep a process busy for `lag`, for a while.
    pub fn slow_down(&mut self, module: ModuleId, lag: Duration, span: Duration) {
        let until = self.now() + span;
        if let Some(process) = self.processes.get_mut(&module) {
            process.inbox.slow = Some((until, lag));
            self.note(Fault::Slow { module, lag, span });
        }
    }

    /// Ends a module's process in order: it tells that it leaves the graph.
    pub fn leave(&mut self, module: ModuleId) {
        self.depart(module);
        self.crash(module);
    }

    /// Ends a module's process without warning; the bodies of its modules stay, halted and docked as they are.
    pub fn crash(&mut self, module: ModuleId) {
        for one in self.hosting.together(module) {
            self.crash_alone(one);
        }
        self.hosting.replicas.remove(&self.hosting.first(module));
    }

    fn crash_alone(&mut self, module: ModuleId) {
        let Some(mut process) = self.end_process(module) else {
            return;
        };
        // A write that was under way may be done or not.
        while let Some((_, state)) = process.writing.pop_front()
            && self.random.below(2) == 0
        {
            self.stores.insert(module, state);
        }
        if let Some(body) = self.bodies.get_mut(&module)
            && !body.has_store
        {
            body.is_first_run = false;
            self.stores.remove(&module);
        }
        self.note(Fault::Crash(module));
    }

    /// Ends a module's process, the body of which stays.
    fn end_process(&mut self, module: ModuleId) -> Option<Process> {
        let links = self.agent(module).map(Agent::links).cloned()?;
        let mut process = self.processes.remove(&module)?;
        let local = process.clock.local(self.now());
        // A drive that moves on is put at once where it will stand.
        process
            .drive
            .halt(local + self.parameters.coasting.unwrap_or_default());
        if let Some(body) = self.bodies.get_mut(&module) {
            body.pose = process.body();
            body.links.clone_from(&links);
        }
        self.observe(Observation::Stands(module, process.body()));
        self.transport.forget(module);
        Some(process)
    }

    /// Takes away the body of a module whose process has ended, and reports that to all running modules.
    pub fn remove(&mut self, module: ModuleId) {
        self.remove_with(module, false);
    }

    /// The same, with the vote of the module or without. A module whose vote was taken does not get its store back.
    pub fn remove_with(&mut self, module: ModuleId, takes_vote: bool) {
        // A process that never started left no body that others know.
        if self.processes.contains_key(&module) || self.late.contains_key(&module) {
            return;
        }
        self.taken_away.insert(module);
        if takes_vote {
            self.take_store(module);
        }
        self.report_gone(module, takes_vote);
    }

    /// Reports the body of a module as removed to all other running modules, whether or not that is true.
    pub fn report_removed(&mut self, module: ModuleId) {
        self.report_gone(module, false);
    }

    fn report_gone(&mut self, module: ModuleId, takes_vote: bool) {
        let Some(run) = self.bodies.get(&module).map(Identity::run) else {
            return;
        };
        let mut numbers = self.renumbered.iter().rev();
        let latest = numbers.find(|&(_, process)| *process == run);
        let run = latest.map_or(run, |(&number, _)| number);
        self.note(Fault::Remove { module, takes_vote });
        for other in self.readers() {
            if other != module {
                self.tell(other, &Message::Removal(Removal { run, takes_vote }));
            }
        }
    }

    /// Starts a module's process again, as a new incarnation.
    pub fn restart(&mut self, module: ModuleId) {
        self.taken_away.remove(&module);
        // A process that starts late is scheduled already.
        if !self.processes.contains_key(&module) && !self.late.contains_key(&module) {
            self.note(Fault::Restart(module));
            let first = self.hosting.first(module);
            self.schedule.add(self.now(), Happening::Start(first));
        }
    }

    /// Stops a process for a while; the inputs that arrive meanwhile wait.
    pub fn pause(&mut self, module: ModuleId, span: Duration) {
        let until = self.now() + span;
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        process.inbox.held_until = process.inbox.held_until.max(until);
        let timeout = Happening::Timeout(process.run);
        self.note(Fault::Pause(module, span));
        self.schedule.add(until, timeout);
    }

    /// Suspends the machine of a process for a while: its clock and its drive stand still as well. What is sent to it best-effort is
    /// lost, or waits for it.
    pub fn suspend(&mut self, module: ModuleId, span: Duration) {
        let now = self.now();
        let until = now + span;
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        if process.inbox.held_until > now {
            return;
        }
        process.inbox.held_until = until;
        process.inbox.loses_best_effort = self.random.below(2) == 0;
        process.clock.stand_still(now, until);
        process.suspension = Some(Suspension {
            from: now,
            until,
            is_shown: false,
        });
        process.timeout_at = Some(until);
        let timeout = Happening::Timeout(process.run);
        self.note(Fault::Suspend(module, span));
        self.schedule.add(until, timeout);
    }

    /// Ends the run of a process whose clock stood still, and begins another with all that it knows.
    pub(super) fn begin_run(&mut self, module: ModuleId) {
        self.depart(module);
        for one in self.hosting.together(module) {
            self.keep_for_next_run(one);
        }
        let first = self.hosting.first(module);
        self.hosting.replicas.remove(&first);
        self.schedule.add(self.now(), Happening::Start(first));
    }

    /// Ends a process for one of its modules, of which the next run is to know what it knows.
    fn keep_for_next_run(&mut self, module: ModuleId) {
        let memory = |agent: &mut Agent| {
            let last_plan = agent.last_plan().cloned();
            (agent.memory(), agent.run().incarnation, last_plan)
        };
        let Some((state, incarnation, last_plan)) = self.hosting.with_agent(module, memory) else {
            return;
        };
        let Some(process) = self.end_process(module) else {
            return;
        };
        let seen = self.sightings.get(&process.run).cloned();
        let seen = seen.unwrap_or_default();
        self.stores.insert(module, Stored { state, seen });
        if let Some(body) = self.bodies.get_mut(&module) {
            body.incarnation = body.incarnation.max(incarnation);
            body.last_plan = last_plan;
        }
    }

    /// The participant of a module leaves the graph, and tells all whom it reaches.
    fn depart(&mut self, module: ModuleId) {
        let from = Participant::Module(module);
        let source = self.source_of(from);
        let readers = self.processes.keys().copied();
        let reached = readers.filter(|&reader| self.is_reached_by(from, reader));
        let runs: Vec<ModuleRun> = reached
            .filter_map(|reader| self.process_run_of(reader))
            .collect();
        let at = self.now() + DEPARTURE;
        for run in runs {
            self.schedule.add(at, Happening::Departed(run, source));
        }
    }

    /// Cuts these modules off from all others.
    pub fn cut(&mut self, aside: &BTreeSet<ModuleId>) {
        self.transport.network.cut(aside);
        self.note(Fault::Cut(aside.clone()));
        self.release();
    }

    /// Lets these links carry nothing from the first module to the second, and all other links work again.
    pub fn sever(&mut self, links: &BTreeSet<(ModuleId, ModuleId)>) {
        self.transport.network.sever(links);
        self.note(Fault::Sever(links.clone()));
        self.release();
    }

    /// Ends the cut and restores all links; reliable messages that were held are sent again.
    pub fn heal(&mut self) {
        self.transport.network.heal();
        self.note(Fault::Heal);
        self.release();
    }

    pub(super) fn note(&mut self, fault: Fault) {
        self.observe(Observation::Fault(fault));
    }
}
