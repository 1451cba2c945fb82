//! Starts, deliveries, time-outs and reports of the drives, one after another.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Message, MicroUnits, ModuleId, ModuleRun};
use formation_motion::{MotionReport, SimulatedDrive};
use formation_protocol::{Agent, Event, Input, Output, PlanJob};

use super::Cluster;
use super::schedule::{Delivery, Happening};
use crate::network::{Channel, Participant, duration_below};
use crate::observation::Observation;
use crate::process::{Clock, Inbox, Process, Stored, Suspension, shifted};

impl Cluster {
    /// Lets the next thing happen; `false` when nothing is left to happen before `limit`.
    pub fn step(&mut self, limit: Duration) -> bool {
        match self.schedule.next(limit) {
            Some(Happening::Start(module)) => self.start(module),
            Some(Happening::Deliver(delivery)) => self.deliver(delivery),
            Some(Happening::Timeout(run)) => self.time_out(run),
            Some(Happening::DriveTick(run)) => self.tick_drive(run),
            Some(Happening::Persisted(run, number)) => self.finish_writing(run, number),
            Some(Happening::Computed(run, computed)) => {
                if self.process_of(run).is_some() {
                    self.input(run.module, Input::Computed(computed));
                }
            }
            Some(Happening::Departed(run, source)) => {
                if self.process_of(run).is_some() {
                    self.input(run.module, Input::Departed(source));
                }
            }
            Some(Happening::Undocked(run, other)) => {
                if self.process_of(run).is_some() {
                    self.input(run.module, Input::Motion(MotionReport::Undocked(other)));
                }
            }
            None => return false,
        }
        true
    }

    /// Runs until `done` holds, or `limit` has come; returns whether it holds.
    pub fn run_until(&mut self, limit: Duration, mut done: impl FnMut(&Self) -> bool) -> bool {
        while !done(self) {
            if !self.step(limit) {
                return done(self);
            }
        }
        true
    }

    fn deliver(&mut self, delivery: Delivery) {
        let channel = delivery.channel;
        let is_skipped =
            self.transport.is_replaced(channel, delivery.sample) && self.random.below(2) == 0;
        if !is_skipped && self.process_run_of(channel.to) == Some(delivery.reader) {
            self.note_sighting(channel.to, &delivery.message);
            let (source, message) = (delivery.source, delivery.message);
            let is_heartbeat = matches!(message, Message::Heartbeat(_));
            self.input(channel.to, Input::Message { source, message });
            if is_heartbeat {
                self.note_clock(channel, delivery.sent_at);
            }
        }
    }

    /// A heartbeat may show to the modules of a process that their machine was suspended.
    fn note_clock(&mut self, channel: Channel, sent_at: Duration) {
        let Participant::Module(from) = channel.from else {
            return;
        };
        for module in self.hosting.together(channel.to) {
            let processes = (self.processes.get(&module), self.processes.get(&from));
            let (Some(to), Some(from)) = processes else {
                continue;
            };
            let suspension = to.suspension;
            if let Some(last) = suspension.filter(|last| last.is_shown_by(from, sent_at))
                && let Some(to) = self.processes.get_mut(&module)
            {
                let is_shown = true;
                to.suspension = Some(Suspension { is_shown, ..last });
            }
        }
    }

    /// A message reaches the modules of a process, which know from then on of a module if it is a state of that.
    pub(super) fn note_sighting(&mut self, module: ModuleId, message: &Message) {
        if let Message::ModuleState(state) = message {
            for run in self.runs_of_process(module) {
                self.sightings.entry(run).or_default().insert(state.module);
            }
        }
    }

    /// The runs of all modules of a module's process, by their numbers at its start.
    fn runs_of_process(&self, module: ModuleId) -> Vec<ModuleRun> {
        let together = self.hosting.together(module).into_iter();
        together
            .filter_map(|one| self.process_run_of(one))
            .collect()
    }

    /// The process of a run, unless it has ended.
    fn process_of(&mut self, run: ModuleRun) -> Option<&mut Process> {
        let process = self.processes.get_mut(&run.module);
        process.filter(|process| process.run == run)
    }

    fn time_out(&mut self, run: ModuleRun) {
        if let Some(process) = self.process_of(run) {
            process.timeout_at = None;
            self.input(run.module, Input::Timeout);
        }
    }

    fn start(&mut self, module: ModuleId) {
        if let Some(&at) = self.late.get(&module)
            && at > self.now()
        {
            self.schedule.add(at, Happening::Start(module));
            return;
        }
        self.late.remove(&module);
        // The first module of a process starts with all others.
        if self.hosting.first(module) != module || self.processes.contains_key(&module) {
            return;
        }
        let clock = self.draw_clock();
        let together = self.hosting.together(module);
        for &one in &together {
            self.start_module(one, clock);
        }
        self.catch_up(module);
        for one in together {
            self.input(one, Input::Timeout);
        }
    }

    fn start_module(&mut self, module: ModuleId, clock: Clock) {
        let Some(body) = self.bodies.get_mut(&module) else {
            return;
        };
        body.incarnation.0 += 1;
        let identity = body.clone();
        body.last_plan = None;
        let drive = SimulatedDrive::new(
            identity.pose,
            self.parameters.speed_units_per_s,
            self.parameters
                .coasting
                .unwrap_or(self.parameters.agent.lease),
        );
        let local = clock.local(self.now());
        let run = identity.run();
        let mut agent = self.agents.make(identity, self.parameters.agent, local);
        if self.parameters.plan_time_max.is_some() {
            agent = agent.with_plans_of_host();
        }
        if let Some(stored) = self.stores.get(&module) {
            self.sightings.insert(run, stored.seen.clone());
            agent = agent.restored(Some(stored.state.clone()));
        }
        let process = Process {
            run,
            clock,
            inbox: Inbox::default(),
            timeout_at: None,
            drive,
            is_coasting: false,
            started: self.schedule.now,
            suspension: None,
            is_mute: false,
            is_lost: false,
            measured_off: <(MicroUnits, MicroUnits)>::default(),
            drive_broken: false,
            tick_at: None,
            driven_by: None,
            announcement: None,
            writing: VecDeque::new(),
            history: BTreeMap::new(),
        };
        self.processes.insert(module, process);
        let first = self.hosting.first(module);
        if self.hosting.together(module).len() > 1
            && let Some(source) = self.source(Participant::Module(module))
        {
            agent = agent.published_by(source);
        }
        let replica = self.hosting.replicas.entry(first).or_default();
        replica.add(local, agent);
    }

    /// Computes a plan, which the agent gets when the time that this takes has passed.
    fn compute(&mut self, run: ModuleRun, job: PlanJob) {
        let given = self.plan_times.get(&run.module).copied();
        let time = given.unwrap_or_else(|| {
            let longest = self.parameters.plan_time_max.unwrap_or_default();
            duration_below(&mut self.random, longest)
        });
        let computed = Happening::Computed(run, Arc::new(job.run()));
        self.schedule.add(self.now() + time, computed);
    }

    fn draw_clock(&mut self) -> Clock {
        let offset = Duration::from_micros(self.random.below(1_000_000_000));
        let drift_max = self.parameters.drift_ppm_max;
        let drift = self.random.below(u64::from(drift_max) * 2 + 1);
        Clock {
            offset,
            drift_ppm: drift.cast_signed() - i64::from(drift_max),
            ..Clock::default()
        }
    }

    pub(super) fn input(&mut self, module: ModuleId, input: Input) {
        let to = match input {
            Input::Message { .. } | Input::Departed(_) => self.hosting.first(module),
            _ => module,
        };
        if let Some(process) = self.processes.get_mut(&to) {
            process.inbox.add(input);
        }
        let together = self.hosting.together(module);
        let mut is_done = false;
        while !is_done {
            is_done = true;
            for &one in &together {
                is_done &= !self.handle_next(one);
            }
        }
        for one in together {
            self.reschedule_timeout(one);
        }
    }

    /// Handles the next inputs of a module, and if it is the first one of its process, those that concern all. Returns whether there were
    /// any.
    fn handle_next(&mut self, module: ModuleId) -> bool {
        let now = self.now();
        let Some(process) = self.processes.get_mut(&module) else {
            return false;
        };
        let inputs = process.inbox.next(now);
        if inputs.is_empty() {
            return false;
        }
        let local = process.clock.local(now);
        let mut received = Vec::new();
        for input in inputs {
            match input {
                Input::Message { source, message } => {
                    received.push(self.received(module, source, message));
                }
                Input::Departed(source) => {
                    if let Some(replica) = self.hosting.replicas.get_mut(&module) {
                        replica.handle_departed(local, source);
                    }
                }
                input => {
                    self.hosting
                        .with_agent(module, |agent| agent.handle(local, input));
                }
            }
        }
        let together = self.hosting.together(module);
        for one in &received {
            if let Message::Target(announcement) = &one.message {
                for one in &together {
                    if let Some(process) = self.processes.get_mut(one) {
                        process.announcement = Some(Arc::clone(announcement));
                    }
                }
            }
        }
        if !received.is_empty()
            && let Some(replica) = self.hosting.replicas.get_mut(&module)
        {
            replica.handle_messages(local, received);
        }
        for one in together {
            self.drain(one);
        }
        true
    }

    fn reschedule_timeout(&mut self, module: ModuleId) {
        let now = self.now();
        let timeout = self.agent(module).map(Agent::poll_timeout);
        let process = self.processes.get_mut(&module);
        let Some((process, timeout)) = process.zip(timeout) else {
            return;
        };
        let held_until = process.inbox.held_until;
        let due = if process.inbox.waiting.is_empty() {
            process.clock.global(timeout)
        } else {
            held_until
        };
        let at = due.max(held_until).max(now);
        if process.timeout_at.is_none_or(|scheduled| at < scheduled) {
            process.timeout_at = Some(at);
            self.schedule.add(at, Happening::Timeout(process.run));
        }
    }

    fn drain(&mut self, module: ModuleId) {
        let now = self.now();
        let coasts = self.parameters.coasting.is_some();
        let poll = |agent: &mut Agent| agent.poll_output();
        while let Some(output) = self.hosting.with_agent(module, poll).flatten() {
            let Some(process) = self.processes.get_mut(&module) else {
                return;
            };
            let local = process.clock.local(now);
            match output {
                Output::Publish(mut message) => {
                    if let Message::ModuleState(state) = &mut message {
                        let at = &mut Arc::make_mut(state).at.0;
                        // Where the clock stood still it shows one time twice.
                        *at = if *at == local {
                            now
                        } else {
                            process.clock.global(*at)
                        };
                    }
                    self.publish(module, &message);
                }
                Output::Event(event) => {
                    if let Event::RunRenumbered(_) = event {
                        let start = process.run;
                        let run = self.run_of(module);
                        self.renumbered.extend(run.map(|run| (run, start)));
                    }
                    self.observe(Observation::Noted(module, event));
                }
                Output::Move(goal) => {
                    let agent = self.hosting.agent(module);
                    let plan = agent.and_then(|agent| agent.epoch().zip(agent.digest()));
                    if process.drive_broken {
                        self.report_now(module, MotionReport::Failed);
                        continue;
                    }
                    process.driven_by = plan;
                    process.is_coasting = false;
                    let off = process.measured_off;
                    let stood = process.drive.pose_at(local);
                    let stood = shifted(&stood, (MicroUnits(-off.0.0), MicroUnits(-off.1.0)));
                    process.drive.go(local, goal);
                    self.observe(Observation::Stands(module, stood));
                    self.observe(Observation::SetOff(module, plan));
                    self.schedule_tick(module);
                }
                Output::Persist { number, state } => {
                    let run = process.run;
                    let seen = self.sightings.get(&run).cloned().unwrap_or_default();
                    let state = *state;
                    process.writing.push_back((number, Stored { state, seen }));
                    let at = now + duration_below(&mut self.random, self.parameters.write_max);
                    self.schedule.add(at, Happening::Persisted(run, number));
                }
                Output::Halt if coasts && process.drive.is_moving() => process.is_coasting = true,
                Output::Halt => {
                    // Earlier reports may wait for a process that has just continued.
                    let report = process.drive.halt(local);
                    if !process.is_mute {
                        process.inbox.add(Input::Motion(report));
                    }
                    let pose = process.body();
                    self.observe(Observation::Stands(module, pose));
                }
                Output::Dock(other) => {
                    let report = self.try_to_dock(module, other);
                    self.report_now(module, report);
                }
                Output::Undock(other) if self.parameters.undocking > Duration::ZERO => {
                    let run = process.run;
                    let at = now + self.parameters.undocking;
                    self.schedule.add(at, Happening::Undocked(run, other));
                }
                Output::Undock(other) => {
                    self.report_now(module, MotionReport::Undocked(other));
                }
                Output::BeginRun { .. } => return self.begin_run(module),
                Output::Compute(job) => {
                    let run = process.run;
                    self.compute(run, job);
                }
            }
        }
    }

    /// Hands in a report of a module's drive or ports while its outputs are carried out.
    fn report_now(&mut self, module: ModuleId, report: MotionReport) {
        let now = self.now();
        let Some(process) = self.processes.get(&module) else {
            return;
        };
        let local = process.clock.local(now);
        let input = Input::Motion(report);
        self.hosting
            .with_agent(module, |agent| agent.handle(local, input));
    }

    /// The store of a module holds what was given to it up to this number.
    fn finish_writing(&mut self, run: ModuleRun, number: u64) {
        let process = self.processes.get_mut(&run.module);
        let Some(process) = process.filter(|process| process.run == run) else {
            return;
        };
        while process
            .writing
            .front()
            .is_some_and(|&(next, _)| next <= number)
        {
            if let Some((_, state)) = process.writing.pop_front() {
                self.stores.insert(run.module, state);
            }
        }
        self.input(run.module, Input::Persisted(number));
    }

    fn tick_drive(&mut self, run: ModuleRun) {
        let now = self.now();
        let process = self.process_of(run);
        let Some(process) = process.filter(|process| process.tick_at == Some(now)) else {
            return;
        };
        process.tick_at = None;
        let local = process.clock.local(now);
        if let Some(mut report) = process.drive.advance(local) {
            let pose = process.drive.pose();
            let is_moving = process.drive.is_moving();
            let is_silent = process.is_mute || (process.is_coasting && is_moving);
            if process.is_coasting && !is_moving {
                process.is_coasting = false;
                report = MotionReport::Halted(pose);
            }
            let body = process.body();
            self.observe(Observation::Stands(run.module, body));
            self.schedule_tick(run.module);
            if !is_silent {
                self.input(run.module, Input::Motion(report));
            }
        }
    }

    /// Schedules the next report of a drive that moves: after a tick, or when it arrives or halts.
    pub(super) fn schedule_tick(&mut self, module: ModuleId) {
        let now = self.now();
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let Some(due) = process.drive.due() else {
            return;
        };
        let left = due.saturating_sub(process.clock.local(now));
        let at = now + left.min(self.parameters.drive_tick);
        if process.tick_at.is_none_or(|tick| at < tick) {
            process.tick_at = Some(at);
            let tick = Happening::DriveTick(process.run);
            self.schedule.add(at, tick);
        }
    }
}
