//! One thing after the other: starts, deliveries, time-outs and the ticks of the drives.

use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use formation::model::{Incarnation, Message, ModuleId};
use formation::motion::SimulatedDrive;
use formation::protocol::{Input, MotionReport, Output};

use super::schedule::{Happening, Scheduled};
use super::{Cluster, Observation};
use crate::process::Process;

impl Cluster {
    /// Lets the next thing happen; `false` when nothing is left to happen before `limit`.
    pub fn step(&mut self, limit: Duration) -> bool {
        match self.queue.peek() {
            Some(Reverse(next)) if next.at <= limit => {}
            _ => {
                self.now = self.now.max(limit);
                return false;
            }
        }
        if let Some(Reverse(next)) = self.queue.pop() {
            self.now = next.at;
            self.happen(next.happening);
        }
        true
    }

    /// Runs until `done` holds, or `limit` has come; tells whether it holds.
    pub fn run_until(&mut self, limit: Duration, mut done: impl FnMut(&Self) -> bool) -> bool {
        while !done(self) {
            if !self.step(limit) {
                return done(self);
            }
        }
        true
    }

    pub(super) fn schedule(&mut self, at: Duration, happening: Happening) {
        self.order += 1;
        self.queue.push(Reverse(Scheduled {
            at,
            order: self.order,
            happening,
        }));
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Start(module) => self.start(module),
            Happening::Deliver {
                channel,
                source,
                reader,
                sample,
                message,
            } => {
                let skipped = channel.topic.depth() == 1
                    && self
                        .newest
                        .get(&(channel.from, channel.topic))
                        .is_some_and(|&newest| newest > sample)
                    && self.random.below(2) == 0;
                let current = self
                    .processes
                    .get(&channel.to)
                    .map(|process| process.incarnation);
                if !skipped && current == Some(reader) {
                    self.input(channel.to, Input::Message { source, message });
                }
            }
            Happening::Timeout(module, incarnation) => {
                let due = self.processes.get_mut(&module).is_some_and(|process| {
                    let mine = process.incarnation == incarnation;
                    if mine {
                        process.timeout_at = None;
                    }
                    mine
                });
                if due {
                    self.input(module, Input::Timeout);
                }
            }
            Happening::DriveTick(module, incarnation) => self.tick_drive(module, incarnation),
        }
    }

    fn start(&mut self, module: ModuleId) {
        if let Some(at) = self.late.remove(&module)
            && at > self.now
        {
            self.schedule(at, Happening::Start(module));
            return;
        }
        let Some(remains) = self.remains.get_mut(&module) else {
            return;
        };
        remains.identity.incarnation.0 += 1;
        let identity = remains.identity.clone();
        let incarnation = identity.incarnation;
        let clock_offset = Duration::from_micros(self.random.below(1_000_000_000));
        let drift_max = i64::from(self.parameters.drift_ppm_max);
        let drift = self.random.below(drift_max.unsigned_abs() * 2 + 1);
        let drift = i64::try_from(drift).unwrap_or(0) - drift_max;
        let mut process = Process {
            drive: SimulatedDrive::new(
                identity.pose,
                self.parameters.speed_units_per_s,
                self.parameters.agent.lease,
            ),
            agent: self
                .agents
                .make(identity, self.parameters.agent, Duration::ZERO),
            incarnation,
            driven_by: None,
            clock_offset,
            clock_drift_ppm: drift,
            timeout_at: None,
            ticking: false,
            held_until: Duration::ZERO,
            slow: None,
            waiting: VecDeque::new(),
            drive_broken: false,
            knows_target: false,
            target_revision: 0,
            history: BTreeMap::new(),
        };
        let local = process.local(self.now);
        process.agent = self
            .agents
            .make(remains.identity.clone(), self.parameters.agent, local);
        self.processes.insert(module, process);
        self.catch_up(module);
        self.input(module, Input::Timeout);
    }

    pub(super) fn input(&mut self, module: ModuleId, input: Input) {
        let now = self.now;
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let is_timeout = matches!(input, Input::Timeout);
        if !is_timeout || process.waiting.is_empty() {
            process.waiting.push_back(input);
        }
        while let Some(process) = self.processes.get_mut(&module) {
            if now < process.held_until {
                // A time-out is no thing that waits: the process looks at its clock when it goes on.
                process
                    .waiting
                    .retain(|input| !matches!(input, Input::Timeout));
                break;
            }
            let Some(input) = process.waiting.pop_front() else {
                break;
            };
            if let Some((until, lag)) = process.slow {
                if now < until {
                    process.held_until = now + lag;
                } else {
                    process.slow = None;
                }
            }
            if let Input::Message {
                message: Message::Target(announcement),
                ..
            } = &input
            {
                process.knows_target = announcement.target.is_some();
                process.target_revision = announcement.revision;
            }
            let local = process.local(now);
            process.agent.handle(local, input);
            self.drain(module);
        }
        self.reschedule_timeout(module);
    }

    fn reschedule_timeout(&mut self, module: ModuleId) {
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let mut due = process.global(process.agent.poll_timeout());
        if !process.waiting.is_empty() {
            due = process.held_until;
        }
        let at = due.max(process.held_until).max(self.now);
        if process.timeout_at.is_none_or(|scheduled| at < scheduled) {
            process.timeout_at = Some(at);
            let incarnation = process.incarnation;
            self.schedule(at, Happening::Timeout(module, incarnation));
        }
    }

    fn drain(&mut self, module: ModuleId) {
        while let Some(process) = self.processes.get_mut(&module) {
            let Some(output) = process.agent.poll_output() else {
                return;
            };
            let local = process.local(self.now);
            match output {
                Output::Publish(message) => self.publish(module, &message),
                Output::Event(event) => self.observe(Observation::Noted(module, event)),
                Output::Move(goal) => {
                    let plan = process.agent.epoch().zip(process.agent.digest());
                    if process.drive_broken {
                        process
                            .agent
                            .handle(local, Input::Motion(MotionReport::Failed));
                        continue;
                    }
                    process.driven_by = plan;
                    process.drive.go(local, goal);
                    let incarnation = process.incarnation;
                    let starts = !std::mem::replace(&mut process.ticking, true);
                    self.observe(Observation::SetOff(module, plan));
                    if starts {
                        let at = self.now + self.parameters.drive_tick;
                        self.schedule(at, Happening::DriveTick(module, incarnation));
                    }
                }
                Output::Halt => {
                    let report = process.drive.halt(local);
                    process.agent.handle(local, Input::Motion(report));
                }
                Output::Dock(other) => {
                    let report = Input::Motion(MotionReport::Docked(other));
                    process.agent.handle(local, report);
                }
                Output::Undock(other) => {
                    let report = Input::Motion(MotionReport::Undocked(other));
                    process.agent.handle(local, report);
                }
            }
        }
    }

    fn tick_drive(&mut self, module: ModuleId, incarnation: Incarnation) {
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        if process.incarnation != incarnation {
            return;
        }
        let local = process.local(self.now);
        let report = process.drive.advance(local);
        process.ticking = process.drive.is_moving();
        if process.ticking {
            let at = self.now + self.parameters.drive_tick;
            self.schedule(at, Happening::DriveTick(module, incarnation));
        }
        if let Some(report) = report {
            self.input(module, Input::Motion(report));
        }
    }
}
