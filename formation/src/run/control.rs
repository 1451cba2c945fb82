//! A run that another program controls: orders come as lines of JSON, and what happens goes out as lines of JSON.

use std::path::PathBuf;

use formation_model::ModuleId;
use formation_model::text::listed_in_full;
use rustix::process::Signal;
use serde::{Deserialize, Serialize};

use super::operator;
use super::roles::Death;
use super::run_loop::{RunEnd, RunLoop};
use crate::console;

/// What may be ordered, one object a line, such as `{"kill": {"module": 3}}`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Order {
    /// Halt all modules.
    Stop {},
    /// Let them go on.
    Resume {},
    /// End the process of a module with SIGKILL.
    Kill { module: ModuleId },
    /// Start the process of a module again.
    Restart { module: ModuleId },
    /// Form the target of another scenario file from where the modules stand.
    Target { scenario: PathBuf },
    /// End the run.
    End {},
}

/// What is told besides the lines of the verifier.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Told<'a> {
    /// A process of modules ended.
    Ended {
        /// The modules that it hosted.
        modules: &'a [ModuleId],
        /// How it ended.
        text: String,
    },
    /// A process of modules was started again.
    Restarted {
        /// The modules that it hosts.
        modules: &'a [ModuleId],
    },
    /// An order was carried out.
    Done {
        /// What was done.
        text: String,
    },
    /// An order was refused.
    Refused {
        /// Why.
        text: String,
    },
}

impl<'a> Told<'a> {
    /// The end of a process.
    pub fn ended(death: &'a Death) -> Self {
        Self::Ended {
            modules: &death.modules,
            text: death.to_string(),
        }
    }
}

impl RunLoop<'_> {
    /// Tells what happened, if somebody controls the run.
    pub(super) fn tell(&mut self, told: &Told<'_>) {
        if self.is_controlled {
            // Nobody reads any more when the input ends, which ends the run.
            let _ = console::result_json(told);
        }
    }

    /// Passes on a line of the verifier, if somebody controls the run.
    pub(super) fn tell_line(&mut self, line: &str) {
        if self.is_controlled {
            let _ = console::result_line(line);
        }
    }

    /// Carries out an order.
    pub(super) fn take_order(&mut self, line: &str) -> Option<RunEnd> {
        let order = serde_json::from_str(line);
        let done = match order {
            Err(error) => Err(format!("no order: {error}")),
            Ok(Order::End {}) => return Some(RunEnd::Asked),
            Ok(Order::Stop {}) => {
                self.give("the order to stop", &[operator::STOP.to_owned()]);
                Ok("the modules are told to stop".to_owned())
            }
            Ok(Order::Resume {}) => {
                self.give("the order to resume", &[operator::RESUME.to_owned()]);
                Ok("the modules are told to go on".to_owned())
            }
            Ok(Order::Kill { module }) => self.kill(module),
            Ok(Order::Restart { module }) => self.restart(module),
            Ok(Order::Target { scenario }) => self.announce(&scenario),
        };
        let told = match done {
            Ok(text) => Told::Done { text },
            Err(text) => Told::Refused { text },
        };
        self.tell(&told);
        None
    }

    fn kill(&mut self, module: ModuleId) -> Result<String, String> {
        let mut agents = self.roles.agents.iter();
        let found = agents.find(|(_, modules)| modules.contains(&module));
        let (&process, modules) = found.ok_or_else(|| format!("no process hosts {module}"))?;
        let hosted = listed_in_full(modules.iter().copied());
        match self.supervisor.signal(process, Signal::KILL) {
            true => Ok(format!("the process of {hosted} is killed")),
            false => Err(format!("the process of {hosted} has ended already")),
        }
    }

    fn restart(&mut self, module: ModuleId) -> Result<String, String> {
        let mut agents = self.roles.agents.iter();
        let found = agents.find(|(_, modules)| modules.contains(&module));
        let (&ended, modules) = found.ok_or_else(|| format!("no process hosts {module}"))?;
        let modules = modules.clone();
        let hosted = listed_in_full(modules.iter().copied());
        if !self.observed.deaths.modules().contains(&module) {
            return Err(format!("the process of {hosted} runs"));
        }
        let started = (self.orders.agent)(self.supervisor, &modules);
        let process = started.map_err(|failure| failure.to_string())?;
        self.roles.agents.remove(&ended);
        self.roles.agents.insert(process, modules.clone());
        self.observed.deaths.forget(&modules);
        self.tell(&Told::Restarted { modules: &modules });
        Ok(format!("the process of {hosted} is started again"))
    }

    /// Replaces the target publisher, whose end is then no loss.
    fn announce(&mut self, scenario: &std::path::Path) -> Result<String, String> {
        let started = (self.orders.target)(self.supervisor, scenario);
        let process = started.map_err(|failure| failure.to_string())?;
        let former = std::mem::replace(&mut self.roles.target_publisher, process);
        self.order_givers.insert(former);
        self.supervisor.signal(former, Signal::TERM);
        Ok("the next target is announced".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_objects_with_one_key() {
        let read = |line: &str| serde_json::from_str::<Order>(line).ok();
        assert_eq!(read(r#"{"stop": {}}"#), Some(Order::Stop {}));
        let kill = Order::Kill {
            module: ModuleId(3),
        };
        assert_eq!(read(r#"{"kill": {"module": 3}}"#), Some(kill));
        for wrong in ["", "{}", r#"{"kill": {}}"#, r#"{"launch": {}}"#, "stop"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}
