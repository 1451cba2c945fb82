//! A run that another program attends: it takes orders, and goes on after a verdict.

use std::path::Path;

use formation_model::ModuleId;
use formation_model::text::listed_in_full;
use ros_runtime::exit::Failure;

use super::attendance::{OrderLine, RunOrder};
use super::lines::{self, RunLine};
use super::operator;
use super::recording::Recording;
use super::run_loop::RunLoop;
use super::supervisor::ProcessId;
use crate::{check, scenario_file};

impl RunLoop<'_> {
    /// Carries out an order, and prints what came of it.
    pub(super) fn take_order(&mut self, line: &str) {
        let (number, outcome) = match serde_json::from_str(line) {
            Ok(OrderLine { number, order }) => (number, self.carry_out(&order)),
            Err(error) => (0, Err(format!("the order cannot be read: {error}"))),
        };
        let error = outcome.err();
        lines::print(&RunLine::Answer { number, error });
    }

    fn carry_out(&mut self, order: &RunOrder) -> Result<(), String> {
        match order {
            RunOrder::Kill(module) => self.kill(*module),
            RunOrder::Restart(module) => self.restart(*module),
            RunOrder::Retire(module) => self.retire(*module, false),
            RunOrder::Rejoin(module) => self.retire(*module, true),
            RunOrder::Push(module, x, y) => self.push(*module, (*x, *y)),
            RunOrder::Stop => {
                self.give("the order to stop", &[operator::STOP.to_owned()]);
                Ok(())
            }
            RunOrder::Resume => {
                self.give("the order to resume", &[operator::RESUME.to_owned()]);
                Ok(())
            }
            RunOrder::Target(path) => {
                let announced = self.announce(path);
                announced.map_err(|failure| failure.to_string())
            }
        }
    }

    fn process_of(&self, module: ModuleId) -> Result<ProcessId, String> {
        let mut agents = self.roles.agents.iter();
        let found = agents.find(|(_, modules)| modules.contains(&module));
        let found = found.map(|(&process, _)| process);
        found.ok_or_else(|| format!("{module} is none of this run"))
    }

    fn kill(&mut self, module: ModuleId) -> Result<(), String> {
        let process = self.process_of(module)?;
        match self.supervisor.kill(process) {
            true => Ok(()),
            false => Err(format!("the process of {module} has ended already")),
        }
    }

    fn retire(&mut self, module: ModuleId, rejoins: bool) -> Result<(), String> {
        self.process_of(module)?;
        let what = match rejoins {
            true => format!("the order to {module} to take part again"),
            false => format!("the order to {module} to leave the formation"),
        };
        self.give(&what, &operator::retirement(module.0, rejoins));
        Ok(())
    }

    fn push(&mut self, module: ModuleId, (x, y): (f64, f64)) -> Result<(), String> {
        self.process_of(module)?;
        let Some(attendance) = &self.attendance else {
            return Err("this run takes no orders".to_owned());
        };
        let size = attendance.start.module_size.metres();
        let order = operator::push(module.0, (x * size, y * size));
        self.give(&format!("the push of {module}"), &order);
        Ok(())
    }

    fn restart(&mut self, module: ModuleId) -> Result<(), String> {
        let process = self.process_of(module)?;
        let modules = self.roles.agents.get(&process).cloned();
        let modules = modules.unwrap_or_default();
        let Some(attendance) = &mut self.attendance else {
            return Err("this run takes no orders".to_owned());
        };
        if attendance.restarting.contains_key(&process) {
            return Err(format!("the process of {module} is starting again"));
        }
        // What it keeps belongs to one process at a time, so the other begins when this one has ended.
        if self.supervisor.kill(process) {
            attendance.restarting.insert(process, modules);
            return Ok(());
        }
        self.start_again(process, &modules)
            .map_err(|failure| failure.to_string())
    }

    fn start_again(&mut self, ended: ProcessId, modules: &[ModuleId]) -> Result<(), Failure> {
        let Some(attendance) = &self.attendance else {
            return Ok(());
        };
        let start = attendance.start;
        let mut hosts = start.hosts.iter();
        let host = hosts.find(|host| host.modules == modules);
        let host = host.ok_or_else(|| Failure::failed("no process of this run hosts them"))?;
        let process = start.agent(self.supervisor, host)?;
        self.roles.agents.remove(&ended);
        self.roles.agents.insert(process, modules.to_vec());
        self.observed.deaths.forget(modules);
        self.display.show_process(modules, true);
        Ok(())
    }

    /// Replaces the target publisher by one of another scenario.
    fn announce(&mut self, path: &Path) -> Result<(), Failure> {
        let scenario = scenario_file::load_formable(path)?;
        check::refuse_long_plans(path, &scenario)?;
        let dead = self.observed.deaths.modules();
        let living = self.roles.modules().filter(|module| !dead.contains(module));
        let living = living.count();
        let Some(attendance) = &mut self.attendance else {
            return Err(Failure::failed("this run takes no orders"));
        };
        let size = scenario.module_size().unwrap_or_default();
        if size != attendance.start.module_size {
            return Err(Failure::bad_input(
                "the next target must have the module size of the run",
            ));
        }
        let start = attendance.start;
        let publisher = start.target_publisher(self.supervisor, path, living)?;
        let former = std::mem::replace(&mut self.roles.target_publisher, publisher);
        if self.supervisor.terminate(former) {
            attendance.dismissed.insert(former);
        }
        // What came before says nothing of the next target, and the log of a long run would grow without a bound.
        self.observed.recording = Recording::default();
        Ok(())
    }

    /// Takes in the end of a process that was ordered. Returns whether it was.
    pub(super) fn take_ordered_exit(&mut self, process: ProcessId) -> bool {
        let Some(attendance) = &mut self.attendance else {
            return false;
        };
        if attendance.dismissed.remove(&process) {
            return true;
        }
        let Some(modules) = attendance.restarting.remove(&process) else {
            return false;
        };
        self.display.show_process(&modules, false);
        if let Err(failure) = self.start_again(process, &modules) {
            let modules = listed_in_full(modules.iter().copied());
            self.display
                .note(&format!("warning: {modules} not started again: {failure}"));
        }
        true
    }
}
