//! The loop of a process that hosts modules.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use async_channel::Receiver;
use formation::model::{ModuleId, Service};
use formation::protocol::{AgentParameters, Identity};
use formation_msgs::{Eviction, Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration};
use futures::StreamExt;
use ros2_client::Publisher;

use crate::arguments::{
    agent_declarations, agent_parameters, motion_declarations, motion_parameters,
};
use crate::drive::MotionParameters;
use crate::drivers::{DriverInlets, DriverOutlets, DriverWord, ExternalMotion};
use crate::host::{Host, Outgoing};
use crate::membership::{MembershipRequest, MembershipServices};
use formation_node::inlet::{Delivery, deliveries, source_id};
use formation_node::stamp;
use formation_node::topics;
use ros_runtime::diagnostics::traffic_report;
use ros_runtime::facilities::{Facilities, FacilityArrival, FacilityInlets};
use ros_runtime::inbox::{Inbox, Wake};
use ros_runtime::inlet::Inlet;
use ros_runtime::outlet::Outlet;
use ros_runtime::parameters::{Declaration, NodeWide, ParameterError, Values};
use ros_runtime::session::{Session, SessionError};
use ros_runtime::settings::Settings;
use ros_runtime::traffic::Traffic;

/// After so many samples the loop answers before it takes in more.
const SAMPLES_PER_TURN: usize = 256;

/// Samples that found no room are offered again after this.
const RETRY_AFTER: Duration = Duration::from_millis(20);

/// A process that hosts modules.
#[derive(Clone, Debug)]
pub struct ModuleProcess {
    /// Its place in the ROS 2 graph.
    pub settings: Settings,
    /// What each hosted module knows of itself; at least one.
    pub modules: Vec<Identity>,
    /// How long the agents wait.
    pub parameters: AgentParameters,
    /// How the modules move.
    pub motion: MotionParameters,
    /// The frame of all poses (REP-105).
    pub frame_id: String,
}

impl ModuleProcess {
    /// Hosts the modules until `stop` yields, then leaves the graph.
    ///
    /// When the DDS library stops listening, the modules start anew where they stand, as if the process had; those that
    /// were added and those out of service as well.
    ///
    /// # Errors
    /// The ROS 2 graph could not be joined, or no driver told where its module stands.
    pub fn run(self, stop: &Receiver<()>) -> Result<(), SessionError> {
        let ids: Vec<u32> = self.modules.iter().map(|module| module.module.0).collect();
        let name = node_name(&ids);
        let active = |module: &Identity| (module.clone(), Service::Active);
        let mut modules = self.modules.iter().map(active).collect();
        loop {
            match self.take_part(&name, &mut modules, stop) {
                Err(deaf @ SessionError::Deaf) => tracing::warn!("{deaf}; joining anew"),
                end => return end,
            }
        }
    }

    /// Takes part with these modules until `stop` yields or the library stops listening, and leaves them as they are then.
    fn take_part(
        &self,
        name: &str,
        modules: &mut Vec<(Identity, Service)>,
        stop: &Receiver<()>,
    ) -> Result<(), SessionError> {
        let declarations = declarations(&self.parameters, &self.motion);
        let parameters = self.settings.declare(name, declarations)?;
        let (agents, motion) = tunables(parameters.values())?;
        let mut session = Session::open(&self.settings, name, parameters)?;
        let mut traffic = Traffic::default();
        let drivers = match &motion {
            MotionParameters::Simulated { .. } => None,
            MotionParameters::External(motion) => {
                let (identities, services): (Vec<_>, Vec<_>) = std::mem::take(modules)
                    .into_iter()
                    .map(|(identity, service)| (identity.clone(), (identity.module, service)))
                    .unzip();
                let services: BTreeMap<ModuleId, Service> = services.into_iter().collect();
                let drivers = Drivers::open(&mut session, &identities, motion, &self.frame_id)?;
                let present = drivers.wait_for_poses(
                    &session,
                    motion,
                    identities,
                    stop.clone(),
                    &mut traffic,
                )?;
                let Some(present) = present else {
                    return Ok(());
                };
                let in_service = |module: &Identity| services.get(&module.module).copied();
                modules.extend(present.into_iter().map(|module| {
                    let service = in_service(&module).unwrap_or_default();
                    (module, service)
                }));
                Some(drivers)
            }
        };
        let hosted = modules.len();
        let serves = NodeWide::of(session.parameters().values())?.parameter_services;
        let (driver_inlets, driver_outlets) = drivers
            .map(|drivers| (drivers.inlets, drivers.outlets))
            .unzip();
        let inlets = Inlets {
            drivers: driver_inlets,
            target: Inlet::open(&mut session, &topics::TARGET)?,
            states: Inlet::open(&mut session, &topics::MODULE_STATES)?,
            roster: Inlet::open(&mut session, &topics::ROSTER)?,
            claims: Inlet::open(&mut session, &topics::claims(hosted))?,
            heartbeats: Inlet::open(&mut session, &topics::HEARTBEATS)?,
            facilities: FacilityInlets::open(&self.settings, &mut session)?,
            membership: serves
                .then(|| MembershipServices::open(&mut session))
                .transpose()?,
        };
        let outlets = Outlets {
            states: Outlet::open(&mut session, &topics::MODULE_STATES)?,
            claims: Outlet::open(&mut session, &topics::claims(hosted))?,
            heartbeats: Outlet::open(&mut session, &topics::HEARTBEATS)?,
            roster: None,
            evictions: None,
            drivers: driver_outlets,
        };
        let facilities = Facilities::open(&self.settings, &mut session)?;
        let host = Host::new(
            source_id(session.source()),
            modules.iter().cloned(),
            agents,
            &motion,
        );
        let mut process = Running {
            start: Instant::now(),
            session,
            outlets,
            facilities,
            host,
            traffic,
            frame_id: self.frame_id.clone(),
        };
        let result = async_io::block_on(process.turn_until_stopped(&inlets, stop));
        tracing::info!("traffic: {}", process.traffic);
        for (module, refusals) in process.host.refusals() {
            if refusals.total() > 0 {
                tracing::info!(module = module.0, "refused: {refusals}");
            }
        }
        *modules = process.host.modules();
        for (identity, _) in modules {
            identity.incarnation = stamp::incarnation();
        }
        drop(inlets);
        drop(process);
        result
    }
}

/// Both ways of talking with drivers outside.
struct Drivers {
    inlets: DriverInlets,
    outlets: DriverOutlets,
}

impl Drivers {
    fn open(
        session: &mut Session,
        modules: &[Identity],
        motion: &ExternalMotion,
        target_frame: &str,
    ) -> Result<Self, SessionError> {
        let modules: Vec<ModuleId> = modules.iter().map(|module| module.module).collect();
        let frame_id = motion.frame_id.as_deref().unwrap_or(target_frame);
        Ok(Self {
            inlets: DriverInlets::open(session, &modules, motion.pose_source, frame_id)?,
            outlets: DriverOutlets::open(session, &modules, frame_id)?,
        })
    }

    /// The modules whose drivers are there, as they stand; `None` when the process is to end. Those that are not are
    /// left out, and named: they can be started again, and are newcomers then.
    fn wait_for_poses(
        &self,
        session: &Session,
        motion: &ExternalMotion,
        modules: Vec<Identity>,
        stop: Receiver<()>,
        traffic: &mut Traffic,
    ) -> Result<Option<Vec<Identity>>, SessionError> {
        let limit = motion.first_pose_limit;
        let waiting = self.inlets.first_poses(modules, limit, stop, traffic);
        let Some((present, absent)) = async_io::block_on(waiting) else {
            return Ok(None);
        };
        let told = absent
            .iter()
            .map(|module| {
                let topic = session.topic_name(&motion.pose_source.topic_of(*module))?;
                Ok(format!(
                    "{module} does not take part: its driver told no pose on `{topic}` within first_pose_limit_s \
                     ({} s)",
                    limit.as_secs_f64()
                ))
            })
            .collect::<Result<Vec<String>, SessionError>>()?;
        if present.is_empty() {
            return Err(SessionError::Drivers(told.join("; ")));
        }
        for line in told {
            tracing::error!("{line}");
        }
        Ok(Some(present))
    }
}

/// What comes in: messages of other processes, what drivers say, and what the facilities of the node deal with.
enum Arrival {
    Message(Delivery),
    Driver(DriverWord),
    Facility(FacilityArrival),
    Membership(MembershipRequest),
}

struct Inlets {
    drivers: Option<DriverInlets>,
    target: Inlet<TargetConfiguration>,
    states: Inlet<ModuleStates>,
    roster: Inlet<Roster>,
    claims: Inlet<SpotClaim>,
    heartbeats: Inlet<Heartbeat>,
    facilities: FacilityInlets,
    /// Left out where the node answers no tools, as discovery grows with the number of endpoints.
    membership: Option<MembershipServices>,
}

type Wire<M> = Outlet<M, Publisher<M>>;

struct Outlets {
    states: Wire<ModuleStates>,
    claims: Wire<SpotClaim>,
    heartbeats: Wire<Heartbeat>,
    /// Made when first needed, as few processes ever convene or evict, and reliable writers are dear.
    roster: Option<Wire<Roster>>,
    evictions: Option<Wire<Eviction>>,
    drivers: Option<DriverOutlets>,
}

impl Outlets {
    fn flush(&mut self, traffic: &mut Traffic) {
        self.states.flush(traffic);
        self.claims.flush(traffic);
        self.heartbeats.flush(traffic);
        if let Some(roster) = &mut self.roster {
            roster.flush(traffic);
        }
        if let Some(evictions) = &mut self.evictions {
            evictions.flush(traffic);
        }
        if let Some(drivers) = &mut self.drivers {
            drivers.flush(traffic);
        }
    }

    fn is_waiting(&self) -> bool {
        self.states.is_waiting()
            || self.claims.is_waiting()
            || self.heartbeats.is_waiting()
            || self.roster.as_ref().is_some_and(Outlet::is_waiting)
            || self.evictions.as_ref().is_some_and(Outlet::is_waiting)
            || self.drivers.as_ref().is_some_and(DriverOutlets::is_waiting)
    }
}

struct Running {
    start: Instant,
    // The outlets must go before the session in which they were made.
    outlets: Outlets,
    facilities: Facilities,
    session: Session,
    host: Host,
    traffic: Traffic,
    frame_id: String,
}

impl Running {
    async fn turn_until_stopped(
        &mut self,
        inlets: &Inlets,
        stop: &Receiver<()>,
    ) -> Result<(), SessionError> {
        let messages = [
            deliveries(&inlets.target),
            deliveries(&inlets.states),
            deliveries(&inlets.roster),
            deliveries(&inlets.claims),
            deliveries(&inlets.heartbeats),
        ];
        let drivers = inlets.drivers.iter().flat_map(DriverInlets::words);
        let facilities = inlets.facilities.arrivals().into_iter();
        let membership = inlets.membership.iter();
        let membership = membership.flat_map(MembershipServices::requests);
        let mut inbox = Inbox::new(
            messages
                .into_iter()
                .map(|stream| stream.map(Arrival::Message).boxed_local())
                .chain(drivers.map(|stream| stream.map(Arrival::Driver).boxed_local()))
                .chain(facilities.map(|stream| stream.map(Arrival::Facility).boxed_local()))
                .chain(membership.map(|stream| stream.map(Arrival::Membership).boxed_local())),
            stop.clone(),
        );
        loop {
            self.host.advance(self.start.elapsed());
            self.publish()?;
            self.session.check_hearing()?;
            self.report()?;
            match inbox.wait(self.due()).await {
                Wake::Stop => return Ok(()),
                Wake::Due => {}
                Wake::Arrival(arrival) => {
                    self.take_in(arrival, inlets);
                    for arrival in std::iter::from_fn(|| inbox.ready()).take(SAMPLES_PER_TURN) {
                        self.take_in(arrival, inlets);
                    }
                }
            }
        }
    }

    fn due(&self) -> Option<Instant> {
        let retry = self
            .outlets
            .is_waiting()
            .then(|| Instant::now() + RETRY_AFTER);
        let host = self.host.due().map(|due| self.start + due);
        [retry, host, self.facilities.due()]
            .into_iter()
            .flatten()
            .min()
    }

    fn take_in(&mut self, arrival: Arrival, inlets: &Inlets) {
        let delivery = match arrival {
            Arrival::Message(delivery) => delivery,
            Arrival::Driver(word) => {
                if let Some((module, news)) = word.accept(&mut self.traffic) {
                    self.host.hear_driver(self.start.elapsed(), module, news);
                }
                return;
            }
            Arrival::Membership(request) => {
                if let Some(services) = &inlets.membership {
                    services.answer(&request, &mut self.host, self.start.elapsed());
                }
                return;
            }
            Arrival::Facility(arrival) => {
                let now = self.start.elapsed();
                let host = &mut self.host;
                self.facilities.attend(
                    &inlets.facilities,
                    arrival,
                    &mut self.session,
                    &mut self.traffic,
                    &mut |values| {
                        let (agents, motion) = tunables(values)?;
                        host.set_parameters(now, agents, &motion);
                        Ok(())
                    },
                );
                return;
            }
        };
        let own = source_id(self.session.source());
        let Some((source, messages)) = delivery.accept(own, &mut self.traffic) else {
            return;
        };
        let now = self.start.elapsed();
        for message in &messages {
            self.host.receive(now, source, message);
        }
    }

    fn report(&mut self) -> Result<(), SessionError> {
        let now = self.start.elapsed();
        let host = &self.host;
        self.facilities
            .report(&mut self.session, &mut self.traffic, |traffic| {
                let mut reports = host.reports(now);
                reports.push(traffic_report(traffic));
                reports
            })
    }

    fn publish(&mut self) -> Result<(), SessionError> {
        let Self {
            outlets,
            session,
            traffic,
            ..
        } = self;
        outlets.flush(traffic);
        for outgoing in self.host.take_outgoing() {
            match outgoing {
                Outgoing::ModuleStates(states) => {
                    let header = stamp::header(&self.frame_id);
                    let sample = ModuleStates::new(header, states.iter().map(AsRef::as_ref));
                    outlets.states.publish(sample, traffic);
                }
                Outgoing::Heartbeats(heartbeats) => {
                    outlets
                        .heartbeats
                        .publish(Heartbeat::new(&heartbeats), traffic);
                }
                Outgoing::Claim(claim) => {
                    outlets.claims.publish(claim.as_ref().into(), traffic);
                }
                Outgoing::Roster(roster) => {
                    let outlet = match &mut outlets.roster {
                        Some(outlet) => outlet,
                        none => none.insert(Outlet::open(session, &topics::ROSTER)?),
                    };
                    outlet.publish((&roster).into(), traffic);
                }
                Outgoing::Drive(module, command) => {
                    if let Some(drivers) = &mut outlets.drivers {
                        drivers.tell(module, command, traffic);
                    }
                }
                Outgoing::Eviction(notice) => {
                    let outlet = match &mut outlets.evictions {
                        Some(outlet) => outlet,
                        none => none.insert(Outlet::open(session, &topics::EVICTIONS)?),
                    };
                    outlet.publish((&notice).into(), traffic);
                }
            }
        }
        Ok(())
    }
}

/// What can be tuned of agents and drives.
pub(crate) fn declarations(
    agents: &AgentParameters,
    motion: &MotionParameters,
) -> Vec<Declaration> {
    let mut declarations = agent_declarations(agents);
    declarations.extend(motion_declarations(motion));
    declarations
}

fn tunables(values: &Values) -> Result<(AgentParameters, MotionParameters), ParameterError> {
    Ok((agent_parameters(values)?, motion_parameters(values)?))
}

/// What the node of a process is called that hosts these modules, in ascending order.
fn node_name(modules: &[u32]) -> String {
    match modules {
        [] => "modules".to_owned(),
        [module] => format!("module_{module}"),
        [first, .., last] => {
            let count = u32::try_from(modules.len()).unwrap_or(u32::MAX);
            if last.checked_sub(*first) == Some(count - 1) {
                format!("modules_{first}_to_{last}")
            } else {
                format!("modules_{first}_and_{}_more", count - 1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use formation_tests::parameter_section;
    use ros_runtime::arguments::assigned_in;
    use ros2_client::ParameterValue;

    use super::*;

    #[test]
    fn a_node_is_called_after_what_it_hosts() {
        assert_eq!(node_name(&[4]), "module_4");
        assert_eq!(node_name(&[1, 2, 3]), "modules_1_to_3");
        assert_eq!(node_name(&[1, 2, 9]), "modules_1_and_2_more");
        assert_eq!(node_name(&[7, 3]), "modules_7_and_1_more");
    }

    #[test]
    fn the_shipped_file_lists_every_parameter_with_its_default() {
        let shipped: BTreeMap<String, ParameterValue> = ["Agents", "Drives"]
            .into_iter()
            .flat_map(|title| assigned_in(&parameter_section(title)).unwrap())
            .collect();
        let declarations = declarations(&AgentParameters::default(), &MotionParameters::default());
        let declared = declarations.into_iter();
        let declared = declared.map(|declaration| (declaration.name.to_owned(), declaration.value));
        assert_eq!(shipped, declared.collect());
    }
}
