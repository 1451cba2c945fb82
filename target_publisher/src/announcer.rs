//! The node of the process that announces the target, and pursues the goals of clients.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation_model::TargetAnnouncement;
use formation_msgs::{InSession, OperatorCommand, SessionId, TargetConfiguration};
use formation_node_support::messages::{Received, module_size_of, session_of};
use formation_node_support::{stamp, topics};
use ros_runtime::PublisherQueue;
use ros_runtime::action::ActionRequest;
use ros_runtime::inputs::Inputs;
use ros_runtime::node::Node;
use ros_runtime::parameters::{ParameterError, Tunables, Values};
use ros_runtime::ros_context::{RosContext, RosContextError, rejoining};
use ros_runtime::service::{Call, RequestId};
use ros_runtime::settings::Settings;
use ros2_client::builtin_interfaces::Time;

use crate::endpoints::{self, FormConfigurationServer, Input};
use crate::goal_resolver::{GoalResolver, refuse_long_plans};
use crate::goal_tracker::GoalTracker;
use crate::operator::Commander;
use crate::parameters::PublisherParameters;

const NODE_NAME: &str = "target_publisher";

/// A process that announces a target, keeps it for late subscribers, and announces the targets of goals.
pub(crate) struct TargetPublisher {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What it announces at its start, if anything.
    pub announcement: Option<TargetAnnouncement>,
    /// Its parameters, unless ROS 2 assigns others.
    pub parameters: PublisherParameters,
}

impl TargetPublisher {
    /// Announces the target, and those of goals, until `stop` yields, then leaves the graph.
    ///
    /// When the DDS library no longer receives, it rejoins, announces its latest target again, and continues its goal.
    pub(crate) fn run(self, stop: &Receiver<()>) -> Result<(), RosContextError> {
        let start = Instant::now();
        let mut tracker = GoalTracker::default();
        let mut commander = Commander::default();
        rejoining(|| self.announce(start, &mut tracker, &mut commander, stop))
    }

    fn announce(
        &self,
        start: Instant,
        tracker: &mut GoalTracker<RequestId>,
        commander: &mut Commander,
        stop: &Receiver<()>,
    ) -> Result<(), RosContextError> {
        let declared = self
            .settings
            .declare(NODE_NAME, self.parameters.declarations())?;
        let parameters = self.parameters.clone().read(declared.values())?;
        if let Some(announcement) = &self.announcement
            && tracker.status.own().is_none()
        {
            let announcement = TargetAnnouncement {
                expected_modules: parameters.expected_modules,
                ..announcement.clone()
            };
            refuse_long_plans(&announcement).map_err(RosContextError::BadInput)?;
            tracker.status.announce(start.elapsed(), announcement);
        }
        let mut ros = RosContext::join(&self.settings, NODE_NAME, declared)?;
        let target = ros.state_publisher(&topics::TARGET)?;
        let mut inputs = Inputs::default();
        let mut action = None;
        // Where the node serves no tools it serves no client, as discovery grows with the number of endpoints.
        let mut commands = None;
        if ros.node_parameters().start_parameter_services {
            commands = Some(ros.publisher(&topics::COMMANDS)?);
            action = Some(endpoints::open(&mut ros, &mut inputs)?);
        } else if self.announcement.is_none() {
            tracing::warn!(
                "announces nothing and serves no goals, as start_parameter_services is false"
            );
        }
        tracker.renew_goal_states();
        let mut announcer = Announcer {
            start,
            tracker,
            commander,
            commands,
            resolver: GoalResolver {
                folder: parameters.scenario_folder.clone().map(PathBuf::from),
                expected_modules: parameters.expected_modules,
                module_size: module_size_of(&ros),
            },
            parameters,
            announced: None,
            session: session_of(&ros),
            target,
            action,
        };
        if announcer.commander.has_commands() {
            announcer.publish_commands();
        }
        ros.run(&mut announcer, inputs, stop)
    }
}

struct Announcer<'a> {
    start: Instant,
    session: SessionId,
    tracker: &'a mut GoalTracker<RequestId>,
    commander: &'a mut Commander,
    commands: Option<PublisherQueue<OperatorCommand>>,
    resolver: GoalResolver,
    parameters: PublisherParameters,
    /// The revision that was published last.
    announced: Option<u64>,
    target: PublisherQueue<TargetConfiguration>,
    action: Option<FormConfigurationServer>,
}

impl Node for Announcer<'_> {
    type Input = Input;

    fn handle(&mut self, input: Input) {
        let now = self.start.elapsed();
        match input {
            Input::Messages(Received { messages, .. }) => {
                let mut is_commanded = false;
                for message in messages {
                    is_commanded |= self.commander.handle_message(now, &message);
                    self.tracker.handle_message(now, &message);
                }
                if is_commanded {
                    self.publish_commands();
                }
            }
            Input::Verdict(verdict) => self.tracker.status.handle_verdict(now, verdict),
            Input::QueryStatus(Call { request, reply }) => {
                reply(self.tracker.status.answer(request));
            }
            Input::WithdrawTarget(Call { request, reply }) => {
                let status = &mut self.tracker.status;
                let outcome = status.withdraw(now, stamp::revision(), request.revision);
                // The answer must be true when it is sent.
                self.publish_target();
                reply(outcome.into());
            }
            Input::StopFormation(Call { request, reply }) => {
                let outcome = self.commander.stop(!request.resume);
                reply(outcome.inspect(|_| self.publish_commands()).into());
            }
            Input::RemoveModule(call) => self.commander.ask_removal(now, call),
            Input::Action(request) => self.handle_action(now, *request),
        }
    }

    fn advance(&mut self, _: &mut RosContext) -> Result<ControlFlow<()>, RosContextError> {
        let now = self.start.elapsed();
        self.tracker.advance(now, &self.parameters);
        self.publish_target();
        let reported = self.commander.report_removals(now);
        if !reported.is_empty() {
            self.publish_commands();
        }
        for (request, text) in reported {
            request.answer(Ok(text));
        }
        if let Some(action) = &self.action {
            if let Some((goal, feedback)) = self.tracker.take_feedback(now) {
                action.publish_feedback(goal, feedback);
            }
            if let Some(states) = self.tracker.take_goal_states() {
                action.status.publish(states);
            }
            for (id, status, result) in self.tracker.take_answers() {
                action.answer_result(id, status, result);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    fn due(&self) -> Option<Instant> {
        let due = self.tracker.due(&self.parameters).into_iter();
        let due = due.chain(self.commander.due()).min();
        due.map(|due| self.start + due)
    }

    fn set_parameters(&mut self, values: &Values) -> Result<(), ParameterError> {
        self.parameters = self.parameters.clone().read(values)?;
        Ok(())
    }
}

impl Announcer<'_> {
    fn handle_action(
        &mut self,
        now: Duration,
        request: ActionRequest<formation_msgs::FormConfigurationGoal>,
    ) {
        let fresh = stamp::revision();
        match request {
            ActionRequest::SendGoal(id, goal, content) => {
                let stamp = Time::now();
                let target = self.resolver.resolve(content);
                let accepted = self.tracker.begin(now, stamp, goal, fresh, target);
                if let Some(action) = &self.action {
                    action.answer_goal(id, accepted, stamp);
                }
            }
            ActionRequest::CancelGoal(id, meant) => {
                let response = self.tracker.cancel(now, fresh, &meant);
                // Modules must see the withdrawal also when another goal came in at the same time, or would not replan.
                self.publish_target();
                if let Some(action) = &self.action {
                    action.answer_cancellation(id, response);
                }
            }
            ActionRequest::GetResult(id, goal) => self.tracker.ask(goal, id),
        }
    }

    /// Publishes the commands that are in force.
    fn publish_commands(&self) {
        if let Some(commands) = &self.commands {
            commands.publish(self.commander.sample().in_session(self.session));
        }
    }

    /// Publishes what the process has to announce, unless it has done so.
    fn publish_target(&mut self) {
        let Some(own) = self.tracker.status.own() else {
            return;
        };
        if self.announced == Some(own.revision) {
            return;
        }
        self.announced = Some(own.revision);
        let mut sample = TargetConfiguration::new(own, self.resolver.module_size);
        sample.header.stamp = stamp::header("").stamp;
        self.target.publish(sample.in_session(self.session));
        let (revision, name) = (own.revision, &own.name);
        match &own.target {
            Some(target) => {
                tracing::info!(
                    revision,
                    name,
                    spots = target.spots().len(),
                    "announced the target"
                );
            }
            None => tracing::info!(revision, name, "withdrew the target"),
        }
    }
}
