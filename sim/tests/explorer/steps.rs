//! One step, and its effects on agents and drives.

use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Incarnation, Message, ModuleId, Pose, SourceId};
use formation_motion::MotionReport;
use formation_protocol::{Identity, Input, Output};

use super::world::{Actor, Agenda, World, hash_of, id};
use super::{Explorer, MODULES, Step, Trail};

/// The duration of a motion.
const JOURNEY: Duration = Duration::from_millis(700);
/// The duration of a cut, and the time from a crash to a restart.
const CUT: Duration = Duration::from_secs(7);
const DOWN: Duration = Duration::from_secs(1);

impl Explorer {
    pub(super) fn launch(
        &self,
        world: &mut World,
        index: usize,
        incarnation: Incarnation,
        body: Option<(Pose, BTreeSet<ModuleId>)>,
    ) {
        let module = self.problem.module(id(index)).unwrap();
        let (pose, links) = body.unwrap_or((module.pose, module.links.clone()));
        let identity = Identity {
            pose,
            links,
            ..Identity::of(module, incarnation)
        };
        let agent = self.agents.make(identity, self.parameters, world.now);
        world.actors[index] = Some(Rc::new(Actor {
            agent,
            incarnation,
            pose,
            drive: None,
            hash: 0,
        }));
        let target = Message::Target(Arc::clone(&self.target));
        world.send(None, index, &target);
        let latched: Vec<(usize, Message)> = world
            .published
            .latched
            .iter()
            .filter(|((from, _), _)| *from != index)
            .flat_map(|((from, _), messages)| messages.iter().map(|one| (*from, one.clone())))
            .collect();
        for (from, message) in latched {
            world.send(Some(from), index, &message);
        }
        self.input(world, index, Input::Timeout);
    }

    pub(super) fn take(&self, world: &mut World, step: Step) {
        let now = world.now.as_secs_f64();
        let line = match step {
            Step::Deliver(flight) | Step::Lose(flight) => {
                let flight = &world.flights[flight];
                let verb = if matches!(step, Step::Lose(_)) {
                    "lost"
                } else {
                    "delivered"
                };
                let from = flight.from.map_or(0, |from| from + 1);
                format!(
                    "{now:.1} s {verb} from {from} to {}: {}",
                    flight.to + 1,
                    flight.topic
                )
            }
            Step::RunTimer => format!("{now:.1} s the next timer runs out"),
            other => format!("{now:.1} s {other:?}"),
        };
        world.trail = Some(Rc::new(Trail {
            before: world.trail.take(),
            line,
        }));
        match step {
            Step::Deliver(index) => {
                if index > 0 {
                    world.deviate();
                }
                let flight = world.flights.remove(index);
                let source = flight.from.map(|from| SourceId(from as u128));
                let message = flight.message.clone();
                self.input(world, flight.to, Input::Message { source, message });
            }
            Step::Lose(index) => {
                world.deviate();
                world.flights.remove(index);
            }
            Step::RunTimer => {
                if !world.flights.is_empty() {
                    world.deviate();
                }
                self.run_timer(world);
            }
            Step::Crash(index) => {
                world.use_fault();
                world.remove(index);
            }
            Step::CrashAndRestart(index) => {
                world.use_fault();
                // The body keeps its pose and links; the state of the process is lost.
                world.disturbance.agenda = Some((world.now + DOWN, Agenda::Restart(index)));
                world.flights.retain(|flight| flight.to != index);
            }
            Step::CutOff(index) => {
                world.use_fault();
                world.disturbance.cut = Some(index);
                world.disturbance.agenda = Some((world.now + CUT, Agenda::Heal));
            }
        }
        world.judge(self.problem.target());
    }

    fn run_timer(&self, world: &mut World) {
        let actor_due = (0..MODULES)
            .filter(|&index| !world.is_down(index))
            .filter_map(|index| Some((world.actors[index].as_ref()?.due(), index)))
            .min();
        if let Some((at, agenda)) = world.disturbance.agenda
            && actor_due.is_none_or(|(due, _)| at <= due)
        {
            world.now = world.now.max(at);
            world.disturbance.agenda = None;
            world.disturbance.last = world.now;
            match agenda {
                Agenda::Heal => {
                    world.disturbance.cut = None;
                    let held = std::mem::take(&mut world.held);
                    world.flights.extend(held);
                }
                Agenda::Restart(index) => {
                    let old = world.actors[index].take().unwrap();
                    world.remove(index);
                    let body = (old.pose, old.agent.links().clone());
                    self.launch(world, index, Incarnation(old.incarnation.0 + 1), Some(body));
                }
            }
            return;
        }
        let Some((due, index)) = actor_due else {
            return;
        };
        world.now = world.now.max(due);
        let now = world.now;
        let actor = Rc::make_mut(world.actors[index].as_mut().unwrap());
        let input = match actor.drive {
            Some((goal, arrives, repeated, _)) if arrives <= now => {
                actor.drive = None;
                // A drive stops when its goal no longer repeats.
                if arrives > repeated + self.parameters.lease {
                    Input::Motion(MotionReport::Halted(actor.pose))
                } else {
                    actor.pose = goal.pose;
                    Input::Motion(MotionReport::Arrived {
                        goal: goal.pose,
                        pose: goal.pose,
                    })
                }
            }
            _ => Input::Timeout,
        };
        self.input(world, index, input);
    }

    fn input(&self, world: &mut World, index: usize, input: Input) {
        let now = world.now;
        let mut inputs = vec![input];
        while let Some(input) = inputs.pop() {
            let Some(actor) = world.actors[index].as_mut() else {
                return;
            };
            let actor = Rc::make_mut(actor);
            actor.agent.handle(now, input);
            let mut published = Vec::new();
            let mut moved = None;
            while let Some(output) = actor.agent.poll_output() {
                match output {
                    Output::Publish(message) => published.push(message),
                    Output::Move(goal) => {
                        let plan = actor.agent.epoch().zip(actor.agent.digest());
                        let arrives = match actor.drive {
                            Some((same, arrives, ..)) if same.pose == goal.pose => arrives,
                            _ => now + JOURNEY,
                        };
                        actor.drive = Some((goal, arrives, now, plan));
                        moved = Some(plan);
                    }
                    Output::Halt => {
                        actor.drive = None;
                        let report = MotionReport::Halted(actor.pose);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    Output::Dock(other) => {
                        let report = MotionReport::Docked(other);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    Output::Undock(other) => {
                        let report = MotionReport::Undocked(other);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    // These agents compute their plans themselves.
                    Output::Event(_)
                    | Output::Persist { .. }
                    | Output::Compute(_)
                    | Output::BeginRun { .. } => {}
                }
            }
            actor.hash = hash_of(&(
                actor.agent.state_hash(),
                actor.incarnation,
                actor.pose,
                &actor.drive,
            ));
            for message in published {
                world.publish(index, &message);
            }
            if let Some(plan) = moved {
                world.set_off(index, plan, self.parameters.lease);
            }
        }
    }
}
