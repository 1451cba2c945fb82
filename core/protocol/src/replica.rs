//! The replica of a process: the agents of its modules, and what these know together of their peers.
//!
//! Each message is recorded once, however many modules the process has, and each of these takes note of what it changes.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Message, ModuleId, ModuleRun, ModuleState, SourceId};

use super::Agent;
use super::io::{Input, Output};
use super::peers::{PeerTable, StateNews};
use super::plans::{ComputedPlan, PlanJob};

/// A message that came to a process.
#[derive(Clone, Debug)]
pub struct Arrived {
    /// The participant that sent it; `None` when the transport does not identify it.
    pub source: Option<SourceId>,
    /// The index of the agent that sent it, if it is one of the same process.
    pub sender: Option<usize>,
    /// The message.
    pub message: Message,
}

/// The number of plans that are kept for other agents and for the next epoch.
const PLANS_KEPT: usize = 3;

/// The agents of a process, each with an index from 0 on.
#[derive(Default)]
pub struct Replica {
    /// What they know of all that sent a message; lent to one agent at a time.
    peers: Box<PeerTable>,
    agents: Vec<Agent>,
    /// The plans that were computed last, for all that ask for one of them.
    computed: VecDeque<Arc<ComputedPlan>>,
    /// The agents that wait for a plan, in the order in which they asked.
    asking: VecDeque<usize>,
    /// Whether a plan is computed.
    is_computing: bool,
}

impl Replica {
    /// Adds an agent, which knows of the peers what the others know. It also gets what these have received of latched topics: the
    /// transport delivers nothing to one process twice.
    /// Enforces C5.
    pub fn add(&mut self, now: Duration, mut agent: Agent) {
        if self.agents.is_empty() {
            agent.context.peers.exchange(&mut self.peers);
            self.agents.push(agent);
            return;
        }
        let latched = self.with(0, |first| first.latched());
        // Its own table is empty.
        agent.context.peers.exchange(&mut Box::default());
        let index = self.agents.len();
        self.agents.push(agent);
        self.with(index, |agent| agent.catch_up(now, latched));
    }

    /// The agents, without their peers, for which [`Self::with`] is.
    #[must_use]
    pub fn agents(&self) -> &[Agent] {
        &self.agents
    }

    /// Lets one agent act, or be asked, that knows its peers.
    ///
    /// # Panics
    /// Panics if there is no agent with this index.
    pub fn with<R>(&mut self, index: usize, act: impl FnOnce(&mut Agent) -> R) -> R {
        let Self { peers, agents, .. } = self;
        let agent = &mut agents[index];
        agent.context.peers.exchange(peers);
        let result = act(agent);
        agent.context.peers.exchange(peers);
        result
    }

    /// The next output of one agent to carry out; `None` when it waits. What it needs computed is among [`Self::next_job`].
    ///
    /// # Panics
    /// Panics if there is no agent with this index.
    pub fn poll_output(&mut self, index: usize) -> Option<Output> {
        loop {
            match self.agents[index].poll_output()? {
                Output::Compute(job) => self.ask(index, &job),
                output => return Some(output),
            }
        }
    }

    /// An agent asks for a plan, in the place of its last one.
    /// Enforces T5.
    fn ask(&mut self, index: usize, job: &PlanJob) {
        self.asking.retain(|&other| other != index);
        let mut computed = self.computed.iter();
        match computed.find(|computed| computed.answers(job)).cloned() {
            Some(known) => {
                let now = self.agents[index].context.now;
                self.hand(now, index, known);
            }
            None => self.asking.push_back(index),
        }
    }

    fn hand(&mut self, now: Duration, index: usize, computed: Arc<ComputedPlan>) {
        let input = Input::Computed(computed);
        self.with(index, |agent| agent.handle(now, input));
    }

    /// The next plan to compute, for all agents that wait for it; none before the last one is handed in.
    pub fn next_job(&mut self) -> Option<PlanJob> {
        if self.is_computing {
            return None;
        }
        let mut asking = self.asking.iter();
        let job = asking.find_map(|&index| self.agents[index].context.plans.asked())?;
        self.is_computing = true;
        Some(job.clone())
    }

    /// Hands in the plan that was computed last to the agents that wait for it.
    pub fn handle_computed(&mut self, now: Duration, computed: &Arc<ComputedPlan>) {
        self.is_computing = false;
        self.computed.push_front(Arc::clone(computed));
        self.computed.truncate(PLANS_KEPT);
        for index in std::mem::take(&mut self.asking) {
            match self.agents[index].context.plans.asked() {
                Some(job) if computed.answers(job) => self.hand(now, index, Arc::clone(computed)),
                Some(_) => self.asking.push_back(index),
                None => {}
            }
        }
    }

    /// Handles messages that have come by the time `now`, and then does once what is due for each agent. In a large formation, to look at
    /// all modules after each of the messages that come from all of them would take most of the time.
    pub fn handle_messages(&mut self, now: Duration, received: impl IntoIterator<Item = Arrived>) {
        for agent in &mut self.agents {
            agent.begin_input(now);
        }
        // For which agents a message may change what is due.
        let mut changed = vec![false; self.agents.len()];
        for one in received {
            self.handle_message(one, &mut changed);
        }
        for (index, changed) in changed.into_iter().enumerate() {
            self.with(index, |agent| agent.end_input(changed));
        }
    }

    /// Handles a message, and marks the agents for which it may change what is due.
    fn handle_message(&mut self, received: Arrived, changed: &mut [bool]) {
        let Arrived {
            source,
            sender,
            message,
        } = received;
        let is_alone = self.agents.len() == 1;
        let others = changed.iter_mut().enumerate();
        let others = others.filter(|&(index, _)| Some(index) != sender);
        match message {
            Message::Heartbeat(heartbeat) if !is_alone => {
                // Others may not know yet who votes.
                let knows = |agent: &Agent| agent.context.session.voters_digest() != 0;
                let knows = self.agents.iter().position(knows).unwrap_or_default();
                let record = |agent: &mut Agent| agent.context.record_heartbeat(source, heartbeat);
                let heard = self.with(knows, record);
                for (index, changed) in others {
                    *changed |= self.agents[index].heeds(heard)
                        && self.with(index, |agent| agent.note_heartbeat(heard));
                }
            }
            Message::ModuleState(state) if !is_alone => {
                let seen = self.with(0, |first| first.context.record_state(source, state));
                if seen.news != Ok(StateNews::Old) {
                    for (index, changed) in others {
                        *changed |= self.with(index, |agent| agent.note_seen(&seen));
                    }
                }
            }
            message => {
                for (index, changed) in others {
                    let message = message.clone();
                    *changed |= self.with(index, |agent| agent.handle_message(source, message));
                }
            }
        }
    }

    /// A participant has left the graph by itself.
    pub fn handle_departed(&mut self, now: Duration, source: SourceId) {
        let mut is_any = false;
        for index in 0..self.agents.len() {
            self.with(index, |agent| {
                agent.begin_input(now);
                // What it sent for is silent once the first agent has recorded that.
                is_any |= agent.context.record_departure(source);
                agent.end_input(is_any);
            });
        }
    }

    /// The live modules, as far as their messages came, and the latest state of each. One that is alone in its process receives none of
    /// its own messages.
    #[must_use]
    pub fn living(&self) -> BTreeMap<ModuleId, Option<&Arc<ModuleState>>> {
        let liveness = self.agents.first().map(|agent| agent.context.liveness());
        let live = liveness.map(|liveness| self.peers.live(liveness));
        let live = live.into_iter().flatten();
        live.map(|(module, peer)| (module, peer.state.as_ref()))
            .collect()
    }

    /// The latest state of a live module, as [`Self::living`] has it.
    #[must_use]
    pub fn state(&self, module: ModuleId) -> Option<&Arc<ModuleState>> {
        let liveness = self.agents.first()?.context.liveness();
        let peer = self.peers.get(module)?;
        peer.state.as_ref().filter(|_| liveness.includes(peer))
    }

    /// When the latest heartbeat of a module was sent, on the clock of the process.
    #[must_use]
    pub fn last_heard(&self, module: ModuleId) -> Option<Duration> {
        let peer = self.peers.get(module)?;
        peer.heartbeat.as_ref().map(|_| peer.last_seen())
    }

    /// The latest run of a module from which a message came, or whose body is known.
    #[must_use]
    pub fn latest_run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        let peer = self.peers.get(module).map(|peer| peer.incarnation);
        let bodies = self.agents.iter();
        let bodies = bodies.filter_map(|agent| agent.context.bodies.get(module));
        let incarnations = bodies.map(|body| body.incarnation).chain(peer);
        Some(module.run(incarnations.max()?))
    }
}

#[cfg(test)]
mod tests {
    use formation_model::{Incarnation, Pose};

    use super::*;
    use crate::plans::tests::job;
    use crate::{AgentParameters, Identity};

    #[test]
    fn agents_that_ask_for_the_same_share_one_plan() {
        let mut replica = Replica::default();
        for module in 0..4 {
            let identity = Identity::single(ModuleId(module).run(Incarnation(1)), Pose::default());
            let agent = Agent::new(identity, AgentParameters::default(), Duration::ZERO);
            replica.add(Duration::ZERO, agent.with_plans_of_host());
        }
        let get = |replica: &mut Replica, index: usize, seed: u64| {
            let plan = replica.with(index, |agent| agent.context.plan(job(seed)));
            while replica.poll_output(index).is_some() {}
            plan.or_else(|| replica.with(index, |agent| agent.context.plan(job(seed))))
        };
        for index in 0..3 {
            assert!(get(&mut replica, index, 1).is_none());
        }
        assert!(get(&mut replica, 3, 2).is_none());
        let first = replica.next_job().unwrap();
        assert_eq!(first, job(1));
        assert_eq!(replica.next_job(), None, "one is computed already");
        // This one now needs another plan.
        assert!(get(&mut replica, 2, 2).is_none());
        let first = Arc::new(first.run());
        replica.handle_computed(Duration::ZERO, &first);
        for index in 0..2 {
            assert!(Arc::ptr_eq(&get(&mut replica, index, 1).unwrap(), &first));
        }
        assert!(get(&mut replica, 2, 2).is_none());
        let second = Arc::new(replica.next_job().unwrap().run());
        replica.handle_computed(Duration::ZERO, &second);
        for index in 2..4 {
            assert!(Arc::ptr_eq(&get(&mut replica, index, 2).unwrap(), &second));
        }
        assert_eq!(replica.next_job(), None);
        // The next epoch may have the same problem.
        assert!(Arc::ptr_eq(&get(&mut replica, 3, 1).unwrap(), &first));
    }
}
