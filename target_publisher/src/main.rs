//! Announces the target configuration.

mod announcer;
mod endpoints;
mod formation_status;
mod goal_resolver;
mod goal_tracker;
mod module_order;
mod operator;
mod parameters;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use async_channel::Receiver;
use clap::{Args, Parser};
use formation_model::{ModuleId, TargetAnnouncement};
use formation_node_support::scenario::read_own_scenario;
use formation_node_support::{ModuleList, Program, stamp};
use ros_runtime::exit::{Failure, STATUS_DONE};
use ros_runtime::settings::Settings;

use crate::announcer::TargetPublisher;
use crate::module_order::{Deed, ModuleOrder};
use crate::operator::OperatorOrder;
use crate::parameters::PublisherParameters;

/// Announces the target of a scenario, and keeps it for late subscribers, until it is asked to stop.
///
/// It serves the action `form_configuration`, by which clients have targets formed, and services that report the status of
/// the formation and withdraw its target. Without a scenario it announces nothing until it is asked to.
#[derive(Parser)]
#[command(version = formation_version::VERSION)]
struct Arguments {
    /// Scenario file whose target and planner parameters are announced; without it, nothing is until a goal comes
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Folder of the scenarios that goals can name [default: that of the scenario file]
    #[arg(long, value_name = "FOLDER")]
    scenario_folder: Option<PathBuf>,
    /// How many modules take part; without it, gathering ends when no further module comes
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    expected_modules: Option<u32>,
    /// The modules that vote in this session, such as 1-25 or 1,4,7-9: nothing moves without more than half of them [default:
    /// none; then a majority of --expected-modules is needed]
    #[arg(long, value_name = "LIST", requires = "scenario", alias = "founders")]
    voters: Option<ModuleList>,
    /// The revision of the target; the highest one is formed [default: the wall clock in milliseconds]
    #[arg(long, value_name = "NUMBER", requires = "scenario", value_parser = plausible_revision)]
    revision: Option<u64>,
    /// Withdraw the target instead: modules then stay where they are
    #[arg(long, requires = "scenario")]
    withdraw: bool,
    #[command(flatten)]
    order: OperatorArguments,
    /// With --remove-module: take the votes of these modules as well, for good
    #[arg(long, requires = "remove_module")]
    vote_too: bool,
}

/// A revision that other targets can follow: every node refuses one that is too far ahead of its clock.
fn plausible_revision(text: &str) -> Result<u64, String> {
    let revision = text.parse().map_err(|_| "must be a number".to_owned())?;
    let latest = stamp::latest();
    if revision > latest {
        return Err(format!(
            "is too far ahead of the clock: must be at most {latest}"
        ));
    }
    Ok(revision)
}

/// Commands to modules. The program gives one, waits until it is taken, and ends.
#[derive(Args)]
#[group(multiple = false, conflicts_with = "scenario")]
struct OperatorArguments {
    /// Stop all modules until they are resumed, and end
    #[arg(long)]
    stop: bool,
    /// Let the modules move again after --stop, and end
    #[arg(long)]
    resume: bool,
    /// Report the bodies of these modules as taken away, so that they block no spot any more, and end
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    remove_module: Vec<u32>,
    /// Have this module leave the formation: it gets no spot until it rejoins; and end
    #[arg(long, value_name = "ID")]
    retire_module: Option<u32>,
    /// Have this module take part again, and end
    #[arg(long, value_name = "ID")]
    rejoin_module: Option<u32>,
    /// Push the body of this module, whose drive is simulated, so many metres along the axes, and end
    #[arg(long, value_name = "ID,X,Y", value_parser = module_order::push_of, allow_hyphen_values = true)]
    push_module: Option<ModuleOrder>,
}

/// What an operator orders.
enum Order {
    /// Of all modules, on a topic.
    OfAll(OperatorOrder),
    /// Of one module, by a service of its process.
    OfOne(ModuleOrder),
}

impl OperatorArguments {
    fn order(&self, takes_vote: bool) -> Option<Order> {
        if self.stop || self.resume {
            return Some(Order::OfAll(OperatorOrder::Stop(self.stop)));
        }
        let served = [
            (self.retire_module, Deed::Retire),
            (self.rejoin_module, Deed::Rejoin),
        ];
        let mut served = served.into_iter().filter_map(|(module, deed)| {
            let module = module.map(ModuleId)?;
            Some(ModuleOrder { module, deed })
        });
        if let Some(order) = served.next().or(self.push_module) {
            return Some(Order::OfOne(order));
        }
        let modules = self.remove_module.iter().copied().map(ModuleId);
        let modules: BTreeSet<ModuleId> = modules.collect();
        let order = OperatorOrder::Remove {
            modules,
            takes_vote,
        };
        (!self.remove_module.is_empty()).then_some(Order::OfAll(order))
    }
}

impl Program for Arguments {
    fn run(self, mut settings: Settings, stop: &Receiver<()>) -> Result<u8, Failure> {
        if let Some(order) = self.order.order(self.vote_too) {
            let outcome = match order {
                Order::OfAll(order) => operator::command(&settings, order, stop)?,
                Order::OfOne(order) => module_order::ask(&settings, order, stop)?,
            };
            tracing::info!("{outcome}");
            return Ok(STATUS_DONE);
        }
        let voters = self.voters.as_ref().map(ModuleList::modules);
        let voters = voters.unwrap_or_default().to_vec();
        let mut read = |path| read_own_scenario(path, &mut settings);
        let scenario = self.scenario.as_deref().map(&mut read).transpose()?;
        let announcement = scenario.map(|scenario| {
            let revision = self.revision.unwrap_or_else(stamp::revision);
            let announcement = TargetAnnouncement::new(scenario.problem(), revision);
            TargetAnnouncement {
                name: scenario.name().to_owned(),
                target: announcement.target.filter(|_| !self.withdraw),
                expected_modules: self.expected_modules,
                voters,
                ..announcement
            }
        });
        let folder = self.scenario_folder.or_else(|| {
            let folder = self.scenario.as_deref()?.parent()?;
            Some(Path::new(".").join(folder))
        });
        TargetPublisher {
            settings,
            announcement,
            parameters: PublisherParameters {
                expected_modules: self.expected_modules,
                scenario_folder: folder.map(|folder| folder.to_string_lossy().into_owned()),
                ..PublisherParameters::default()
            },
        }
        .run(stop)?;
        Ok(STATUS_DONE)
    }
}

fn main() -> ExitCode {
    formation_node_support::main::<Arguments>()
}
