//! What every node of ROS 2 offers beside its work: its parameters, its log lines and how it is doing.

use std::time::{Duration, Instant};

use futures::StreamExt;
use futures::stream::LocalBoxStream;
use ros2_client::Publisher;
use ros2_client::log::Log;

use crate::diagnostics::{DiagnosticArray, Report};
use crate::outlet::Outlet;
use crate::parameters::{NodeWide, ParameterError, ParameterRequest, ParameterServices, Values};
use crate::rosout::LogLines;
use crate::session::{Session, SessionError};
use crate::settings::Settings;
use crate::stamp::Header;
use crate::topic;
use crate::traffic::Traffic;

/// The ends at which others reach the node. They outlive the loop's borrowing of them, so they stand apart from
/// [`Facilities`], which change.
pub struct FacilityInlets {
    services: Option<ParameterServices>,
    log: Option<LogLines>,
}

/// Something for the facilities of a node to deal with.
pub enum FacilityArrival {
    /// A request to a parameter service.
    Parameters(ParameterRequest),
    /// A line for `/rosout`.
    Log(Log),
}

/// What a loop with subscriptions takes in.
pub enum Arrival<T> {
    /// A sample.
    Sample(T),
    /// Something for the facilities.
    Facility(FacilityArrival),
}

/// All that comes in.
pub fn arrivals<'a, T: 'a>(
    samples: impl IntoIterator<Item = LocalBoxStream<'a, T>>,
    facilities: &'a FacilityInlets,
) -> Vec<LocalBoxStream<'a, Arrival<T>>> {
    let samples = samples
        .into_iter()
        .map(|samples| samples.map(Arrival::Sample).boxed_local());
    let others = facilities
        .arrivals()
        .into_iter()
        .map(|arrivals| arrivals.map(Arrival::Facility).boxed_local());
    samples.chain(others).collect()
}

impl FacilityInlets {
    /// Opens what the node's parameters ask for.
    pub fn open(settings: &Settings, session: &mut Session) -> Result<Self, SessionError> {
        let serves = NodeWide::of(session.parameters().values())?.parameter_services;
        Ok(Self {
            services: serves
                .then(|| ParameterServices::open(session))
                .transpose()?,
            log: settings.log.clone(),
        })
    }

    /// Everything that comes in, for ever.
    pub fn arrivals(&self) -> Vec<LocalBoxStream<'_, FacilityArrival>> {
        let requests = self.services.iter().flat_map(ParameterServices::requests);
        let lines = self.log.iter().map(LogLines::lines);
        requests
            .map(|requests| requests.map(FacilityArrival::Parameters).boxed_local())
            .chain(lines.map(|lines| lines.map(FacilityArrival::Log).boxed_local()))
            .collect()
    }
}

/// The ends at which the node speaks of itself.
pub struct Facilities {
    /// The node's name as loggers are called.
    logger: String,
    rosout: Option<Outlet<Log, Publisher<Log>>>,
    diagnostics: Option<Outlet<DiagnosticArray, Publisher<DiagnosticArray>>>,
    period: Option<Duration>,
    report_due: Instant,
}

impl Facilities {
    /// Opens what the settings and the node's parameters ask for.
    pub fn open(settings: &Settings, session: &mut Session) -> Result<Self, SessionError> {
        let rosout = match settings.log {
            Some(_) => Some(Outlet::open(session, &topic::ROSOUT)?),
            None => None,
        };
        let period = NodeWide::of(session.parameters().values())?.diagnostics_period;
        let diagnostics = match period {
            Some(_) => Some(Outlet::open(session, &topic::DIAGNOSTICS)?),
            None => None,
        };
        Ok(Self {
            logger: session.identity().logger(),
            rosout,
            diagnostics,
            period,
            report_due: Instant::now(),
        })
    }

    /// Deals with what came in. `apply` puts new values of parameters to use, or says why they cannot be.
    pub fn attend(
        &mut self,
        inlets: &FacilityInlets,
        arrival: FacilityArrival,
        session: &mut Session,
        traffic: &mut Traffic,
        apply: &mut dyn FnMut(&Values) -> Result<(), ParameterError>,
    ) {
        match arrival {
            FacilityArrival::Log(mut line) => {
                if let Some(rosout) = &mut self.rosout {
                    line.name.clone_from(&self.logger);
                    rosout.publish(line, traffic);
                }
            }
            FacilityArrival::Parameters(request) => {
                let Some(services) = &inlets.services else {
                    return;
                };
                session.answer(services, request, &mut |values| {
                    apply(values).map_err(|error| error.to_string())
                });
                // What was accepted has passed its range, so it is a period.
                if let Ok(NodeWide {
                    diagnostics_period, ..
                }) = NodeWide::of(session.parameters().values())
                    && diagnostics_period != self.period
                {
                    self.period = diagnostics_period;
                    self.report_due = Instant::now();
                }
            }
        }
    }

    /// When there is something to do next.
    pub fn due(&self) -> Option<Instant> {
        self.period.map(|_| self.report_due)
    }

    /// Publishes how the node is doing, if that is due.
    pub fn report(
        &mut self,
        session: &mut Session,
        traffic: &mut Traffic,
        reports: impl FnOnce(&Traffic) -> Vec<Report>,
    ) -> Result<(), SessionError> {
        let Some(period) = self.period.filter(|_| self.report_due <= Instant::now()) else {
            return Ok(());
        };
        self.report_due = Instant::now() + period;
        let outlet = match &mut self.diagnostics {
            Some(outlet) => outlet,
            none => none.insert(Outlet::open(session, &topic::DIAGNOSTICS)?),
        };
        let node = session.identity().fully_qualified();
        let status = reports(traffic)
            .into_iter()
            .map(|report| report.into_status(&node))
            .collect();
        let header = Header::now();
        outlet.publish(DiagnosticArray { header, status }, traffic);
        Ok(())
    }
}
