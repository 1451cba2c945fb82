//! The inputs and outputs of an agent.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ConfigurationId, Incarnation, Message, ModuleId, ModuleRun, PlanningModule, Pose, SourceId,
};
use formation_motion::{MotionGoal, MotionReport};

use super::durable::DurableState;
use super::event::Event;
use super::plans::{ComputedPlan, PlanJob};
use super::shown_plans::ShownPlan;

/// What a module knows about itself when its process starts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The module.
    pub module: ModuleId,
    /// This run of its process.
    pub incarnation: Incarnation,
    /// Whether it has a store, which outlives its process.
    pub has_store: bool,
    /// Whether no run of it took part in the session before.
    pub is_first_run: bool,
    /// What [`super::Agent::last_plan`] said of the run before in the same process, whose drive stands.
    pub last_plan: Option<ShownPlan>,
    /// Its pose at the start.
    pub pose: Pose,
    /// The modules that it is docked to at the start.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs.
    pub configuration: Option<ConfigurationId>,
    /// The module that leads it.
    pub leader: Option<ModuleId>,
}

impl Identity {
    /// A module that is docked to none at this pose. It has no store, and runs of it may have taken part before.
    #[must_use]
    pub fn single(run: ModuleRun, pose: Pose) -> Self {
        Self {
            module: run.module,
            incarnation: run.incarnation,
            has_store: false,
            is_first_run: false,
            last_plan: None,
            pose,
            links: BTreeSet::new(),
            configuration: None,
            leader: None,
        }
    }

    /// The same for a module as a scenario has it, docked to others.
    #[must_use]
    pub fn of(module: &PlanningModule, incarnation: Incarnation) -> Self {
        Self {
            links: module.links.clone(),
            configuration: module.configuration,
            leader: module.leader,
            ..Self::single(module.id.run(incarnation), module.pose)
        }
    }

    /// The module and this run of its process.
    #[must_use]
    pub fn run(&self) -> ModuleRun {
        self.module.run(self.incarnation)
    }
}

/// A command from an operator or a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Leave the formation: stop, undock, take no further spot, and make way for others, unless the drive has failed.
    Retire,
    /// Take part again, after [`Self::Retire`] or after a failure of the drive or ports.
    Rejoin,
}

/// One input of an agent.
#[derive(Clone, Debug)]
pub enum Input {
    /// A message from another agent or from the publisher of the target.
    Message {
        /// The sender; `None` when the transport does not identify it.
        source: Option<SourceId>,
        /// The message.
        message: Message,
    },
    /// This participant has left the graph by itself, as a process does that ends or joins anew.
    Departed(SourceId),
    /// A report from the drive or the docking ports.
    Motion(MotionReport),
    /// A command.
    Command(Command),
    /// The store holds what this [`Output::Persist`], and every earlier one, gave to it, whatever happens to the process.
    Persisted(u64),
    /// The plan of [`Output::Compute`].
    Computed(Arc<ComputedPlan>),
    /// The time that [`super::Agent::poll_timeout`] returned has come.
    Timeout,
}

/// One output of an agent, for its host to carry out.
#[derive(Clone, Debug)]
pub enum Output {
    /// Publish a message to the other agents.
    Publish(Message),
    /// Move to a goal.
    Move(MotionGoal),
    /// Stop, and report [`MotionReport::Halted`].
    Halt,
    /// Undock from this module, and report [`MotionReport::Undocked`].
    Undock(ModuleId),
    /// Dock to this module, and report [`MotionReport::Docked`].
    Dock(ModuleId),
    /// Write this to the module's store in place of the state before, and answer with [`Input::Persisted`] once it is there for
    /// good. A host whose store fails ends the agent.
    Persist {
        /// Counts the states that were given to the store, from 1.
        number: u64,
        /// What the store has to hold.
        state: Box<DurableState>,
    },
    /// Compute this plan, and hand it in as [`Input::Computed`]; it takes the place of an earlier request. Only agents
    /// [with plans of their host](super::Agent::with_plans_of_host) ask.
    Compute(PlanJob),
    /// End this run, and begin another that goes on from [`super::Agent::memory`]: the clock stood still for about this long, so that
    /// others take the heartbeats of this run for old ones.
    BeginRun {
        /// By how much the clock is late.
        stood_still: Duration,
    },
    /// Log an event.
    Event(Event),
}
