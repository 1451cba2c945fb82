//! What every ROS 2 node offers besides its work: its parameters, its log and its diagnostics.

use std::time::{Duration, Instant};

use ros2_client::builtin_interfaces::Time;
use ros2_client::log::Log;

use crate::diagnostics::{DiagnosticArray, Report};
use crate::inputs::Inputs;
use crate::node::Node;
use crate::parameters::{self, ParameterRequest};
use crate::publisher_queue::PublisherQueue;
use crate::ros_context::{RosContext, RosContextError};
use crate::stamp::Header;
use crate::topic;

/// The endpoints of a node that are not its own.
pub(crate) struct NodeInterfaces {
    /// The node's name as loggers are called.
    logger: String,
    rosout: Option<PublisherQueue<Log>>,
    /// Created when the first report is due.
    diagnostics: Option<PublisherQueue<DiagnosticArray>>,
    /// Between two reports; 0 for none.
    period: Duration,
    report_due: Instant,
}

/// An input for the interfaces of a node.
pub(crate) enum InterfaceInput {
    /// A request to a parameter service.
    Parameters(ParameterRequest),
    /// A line for `/rosout`.
    Log(Log),
}

impl NodeInterfaces {
    /// Creates the endpoints that the settings and the node's parameters ask for.
    pub(crate) fn open(
        ros: &mut RosContext,
        inputs: &mut Inputs<InterfaceInput>,
    ) -> Result<Self, RosContextError> {
        if ros.node_parameters().start_parameter_services {
            inputs.append(parameters::serve(ros)?, InterfaceInput::Parameters);
        }
        let rosout = match ros.log.clone() {
            Some(lines) => {
                inputs.add(lines, InterfaceInput::Log);
                Some(ros.publisher(&topic::ROSOUT)?)
            }
            None => None,
        };
        Ok(Self {
            logger: ros.identity().logger(),
            rosout,
            diagnostics: None,
            period: ros.node_parameters().diagnostics_period,
            report_due: Instant::now(),
        })
    }

    pub(crate) fn handle(
        &mut self,
        input: InterfaceInput,
        ros: &mut RosContext,
        node: &mut impl Node,
    ) {
        match input {
            InterfaceInput::Log(mut line) => {
                if let Some(rosout) = &self.rosout {
                    line.name.clone_from(&self.logger);
                    rosout.publish(line);
                }
            }
            InterfaceInput::Parameters(request) => {
                let apply = &mut |values: &_| {
                    node.set_parameters(values)
                        .map_err(|error| error.to_string())
                };
                for (name, value) in request.answer(&mut ros.parameters, apply) {
                    ros.graph.announce_parameter(name, value);
                }
                let period = ros.node_parameters().diagnostics_period;
                if period != self.period {
                    self.period = period;
                    self.report_due = Instant::now();
                }
            }
        }
    }

    /// When the next report is due.
    pub(crate) fn due(&self) -> Option<Instant> {
        (!self.period.is_zero()).then_some(self.report_due)
    }

    /// Publishes the status of the node, if that is due.
    pub(crate) fn report(
        &mut self,
        ros: &mut RosContext,
        reports: impl FnOnce() -> Vec<Report>,
    ) -> Result<(), RosContextError> {
        if self.due().is_none_or(|due| due > Instant::now()) {
            return Ok(());
        }
        self.report_due = Instant::now() + self.period;
        let diagnostics = match &mut self.diagnostics {
            Some(diagnostics) => diagnostics,
            none => none.insert(ros.publisher(&topic::DIAGNOSTICS)?),
        };
        let node = ros.identity().fully_qualified();
        let statistics = ros.statistics().borrow().report();
        let status = reports().into_iter().chain([statistics]);
        diagnostics.publish(DiagnosticArray {
            header: Header {
                stamp: Time::now(),
                frame_id: String::new(),
            },
            status: status.map(|report| report.into_status(&node)).collect(),
        });
        Ok(())
    }
}
