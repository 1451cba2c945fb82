//! Pushes of simulated modules, as hands push robots, and the ports that they tear open.

use std::collections::BTreeMap;
use std::time::Duration;

use formation_model::text::joined;
use formation_model::{MICRO_PER_UNIT, MicroUnits, ModuleId, Pose};

use super::Host;

/// The least distance between two modules: one unit, less the tolerance of a pose.
const DISTANCE_MIN: MicroUnits = MicroUnits(MICRO_PER_UNIT * 19 / 20);

/// A simulated port opens when what it held is farther than this from where it was. A shorter push would tear nothing off.
const SLACK: MicroUnits = MicroUnits(MICRO_PER_UNIT / 4);

/// What is known of pushes.
#[derive(Default)]
pub(super) struct Pushes {
    /// Where the modules were, in the frame of the module that is docked to them, while both ends named the link.
    docked: BTreeMap<(ModuleId, ModuleId), (f64, f64)>,
    /// The module and the order of the last push, and the answer to it.
    last: Option<((u32, u64), Result<String, String>)>,
}

/// Where a pose is in the frame of another one, in units.
fn seen_from(from: &Pose, pose: &Pose) -> (f64, f64) {
    let (x, y) = (
        pose.x.to_units() - from.x.to_units(),
        pose.y.to_units() - from.y.to_units(),
    );
    let (sine, cosine) = from.theta.to_units().sin_cos();
    (x * cosine + y * sine, y * cosine - x * sine)
}

impl Host {
    /// The poses of the hosted modules and of all other live ones, as far as they are known.
    pub(crate) fn poses(&self) -> BTreeMap<ModuleId, Option<Pose>> {
        let peers = self.replica.living().into_iter();
        let peers = peers.map(|(module, state)| (module, state.map(|state| state.pose)));
        let agents = self.replica.agents().iter();
        let own = agents.map(|agent| (agent.module(), Some(agent.pose())));
        peers.chain(own).collect()
    }

    /// The first module, other than this one, to which a place is too near for a body, and how near it is.
    pub(crate) fn too_near(&self, module: ModuleId, pose: &Pose) -> Option<(ModuleId, MicroUnits)> {
        let others = self
            .poses()
            .into_iter()
            .filter(|&(other, _)| other != module);
        let mut distances =
            others.filter_map(|(other, place)| Some((other, place?.distance_to(pose))));
        distances.find(|&(_, distance)| distance < DISTANCE_MIN)
    }

    /// Moves the body of a hosted module, and opens its ports. Returns what it is torn off.
    ///
    /// # Errors
    /// Says why that is not possible.
    pub(crate) fn push_body(
        &mut self,
        now: Duration,
        module: ModuleId,
        (x, y): (MicroUnits, MicroUnits),
    ) -> Result<Vec<ModuleId>, String> {
        let index = self
            .index_of(module)
            .ok_or_else(|| self.does_not_host(module))?;
        let length = x.to_units().hypot(y.to_units());
        if length <= SLACK.to_units() {
            return Err(format!(
                "a push of {length:.2} module sizes is too short: it must be more than {}",
                SLACK.to_units()
            ));
        }
        let agent = &self.replica.agents()[index];
        let from = agent.pose();
        let moved = |from: MicroUnits, by: MicroUnits| from.to_units() + by.to_units();
        let theta = from.theta.to_units();
        let pose = Pose::from_units(moved(from.x, x), moved(from.y, y), theta);
        let pose = pose.map_err(|_| format!("{module} cannot be moved so far"))?;
        if let Some((other, distance)) = self.too_near(module, &pose) {
            return Err(format!(
                "{other} is there, {:.2} module sizes away",
                distance.to_units()
            ));
        }
        let links = self.replica.agents()[index].links();
        let torn_off: Vec<ModuleId> = links.iter().copied().collect();
        if !self.modules[index]
            .drive
            .push(now, pose, torn_off.iter().copied())
        {
            return Err(format!("{module} has a driver of its own: push the robot"));
        }
        self.pass_reports(index, now);
        Ok(torn_off)
    }

    /// Answers an order to push a module as it was answered, if it is the last one that came, else by `push`: a request may arrive more
    /// than once.
    pub(crate) fn push_once(
        &mut self,
        order: (u32, u64),
        push: impl FnOnce(&mut Self) -> Result<String, String>,
    ) -> Result<String, String> {
        if let Some((last, answer)) = &self.pushes.last
            && *last == order
        {
            return answer.clone();
        }
        let answer = push(self);
        self.pushes.last = (order.1 != 0).then(|| (order, answer.clone()));
        answer
    }

    /// Why a request for a module that this process does not host is refused.
    pub(crate) fn does_not_host(&self, module: ModuleId) -> String {
        let hosted = self.modules.iter().map(|hosted| hosted.identity.module.0);
        format!(
            "{module} is not hosted by this process, which hosts {}",
            joined(hosted, ", ")
        )
    }

    /// Opens the simulated ports of modules whose neighbours were torn off: they name the link no more, and are not where they were.
    pub(super) fn open_torn_ports(&mut self, now: Duration) {
        if !self.motion.pushable {
            return;
        }
        for index in 0..self.modules.len() {
            let agent = &self.replica.agents()[index];
            if agent.links().is_empty() {
                continue;
            }
            let (own, pose) = (agent.module(), agent.pose());
            let mut torn = Vec::new();
            for &other in agent.links() {
                let Some(state) = self.replica.state(other) else {
                    continue;
                };
                let seen = seen_from(&pose, &state.pose);
                if state.links.contains(&own) {
                    self.pushes.docked.insert((own, other), seen);
                } else if let Some(was) = self.pushes.docked.get(&(own, other))
                    && (was.0 - seen.0).hypot(was.1 - seen.1) > SLACK.to_units()
                {
                    torn.push(other);
                }
            }
            for other in torn {
                self.pushes.docked.remove(&(own, other));
                if self.modules[index].drive.tear_off(other) {
                    self.pass_reports(index, now);
                }
            }
        }
    }
}
