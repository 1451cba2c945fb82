//! The modules of a scenario, each a process of its own, and a verifier that keeps watching them.

use std::collections::{BTreeMap, BTreeSet};
use std::thread;
use std::time::{Duration, Instant};

use formation_model::{PlanningModule, Scenario};
use serde_json::Value;
use tempfile::TempDir;

use crate::namespaces::Namespace;
use crate::programs::Running;
use crate::scenario_file::ScenarioFile;

/// How long the agents wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FleetTiming {
    /// As they are by default.
    Usual,
    /// About half as long, for tests that wait for time-outs.
    Quick,
}

impl FleetTiming {
    /// A module that is silent for longer is considered failed.
    #[must_use]
    pub fn suspicion(self) -> Duration {
        match self {
            Self::Usual => Duration::from_secs(5),
            Self::Quick => Duration::from_millis(2_500),
        }
    }

    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Usual => &[],
            Self::Quick => &[
                "--suspicion-s",
                "2.5",
                "--lease-s",
                "1.25",
                "--heartbeat-s",
                "0.25",
                "--convene-s",
                "0.5",
                "--gather-s",
                "1",
                // In 118 starts of ten modules on two overloaded cores, the last froze at most 3.9 s after the first. The
                // convener waits this long for a module that dies before the first roster.
                "--gather-limit-s",
                "8",
                "--epoch-interval-s",
                "0.5",
            ],
        }
    }
}

/// The nodes have no services, as discovery takes longer with more endpoints. Other tests have nodes with services.
const NO_SERVICES: [&str; 3] = ["--ros-args", "-p", "start_parameter_services:=false"];

/// Agents on one domain.
pub struct Fleet {
    domain: String,
    file: ScenarioFile,
    timing: FleetTiming,
    speed: String,
    spots: usize,
    leaders: BTreeSet<u32>,
    modules: Vec<u32>,
    agents: BTreeMap<u32, Running>,
    stores: Option<TempDir>,
    /// The processes that report bodies as removed.
    reporters: Vec<Running>,
    /// The router of all processes, if they run over Zenoh.
    router: Option<String>,
}

impl Fleet {
    /// The modules of a scenario, none of them started.
    #[must_use]
    pub fn new(name: &str, scenario: &str, domain: &str, timing: FleetTiming) -> Self {
        let parsed = Scenario::from_yaml(scenario).unwrap();
        let problem = parsed.problem();
        let leads = |module: &&PlanningModule| module.leader == Some(module.id);
        Self {
            domain: domain.to_owned(),
            file: ScenarioFile::new(name, scenario),
            timing,
            speed: "5".to_owned(),
            spots: problem.target().spots().len(),
            leaders: problem
                .modules()
                .iter()
                .filter(leads)
                .map(|module| module.id.0)
                .collect(),
            modules: problem.modules().iter().map(|module| module.id.0).collect(),
            agents: BTreeMap::new(),
            stores: None,
            reporters: Vec::new(),
            router: None,
        }
    }

    /// The same over Zenoh. Each process connects to the router at this endpoint, as seen from its own network.
    #[must_use]
    pub fn over_zenoh(mut self, router: &str) -> Self {
        self.router = Some(router.to_owned());
        self
    }

    /// The same with a store for each module, and with all modules named as voters.
    ///
    /// # Panics
    /// When no directory can be created.
    #[must_use]
    pub fn with_stores(mut self) -> Self {
        self.stores = Some(tempfile::tempdir().unwrap());
        self
    }

    /// Every module of the scenario.
    #[must_use]
    pub fn modules(&self) -> &[u32] {
        &self.modules
    }

    /// The modules whose processes live.
    #[must_use]
    pub fn living(&self) -> BTreeSet<u32> {
        self.agents.keys().copied().collect()
    }

    /// A living module's process.
    #[must_use]
    pub fn agent(&self, module: u32) -> &Running {
        &self.agents[&module]
    }

    /// Starts every module.
    pub fn start_all(&mut self) {
        for module in self.modules.clone() {
            self.start(module, None);
        }
    }

    /// Starts or restarts one module, in a network of its own if one is given.
    pub fn start(&mut self, module: u32, network: Option<&Namespace>) {
        let program = if self.leaders.contains(&module) {
            "leader_agent"
        } else {
            "module_agent"
        };
        let id = module.to_string();
        let mut arguments = vec!["--module", &id, "--scenario", self.file.path()];
        arguments.extend(["--speed", &self.speed]);
        arguments.extend(self.timing.arguments());
        if let Some(stores) = &self.stores {
            arguments.extend(["--state-dir", stores.path().to_str().unwrap()]);
        }
        arguments.extend(NO_SERVICES);
        let agent = self.started(network, program, &arguments);
        let earlier = self.agents.insert(module, agent);
        assert!(earlier.is_none(), "module {module} runs already");
    }

    /// Starts one module, which moves at a speed of its own.
    pub fn start_at_speed(&mut self, module: u32, units_per_s: f64) {
        let usual = std::mem::replace(&mut self.speed, units_per_s.to_string());
        self.start(module, None);
        self.speed = usual;
    }

    /// Starts a second process for a module whose first one lives, and hands the second out.
    #[must_use]
    pub fn start_second(&mut self, module: u32) -> Running {
        let first = self.succeed(module);
        self.agents.insert(module, first).unwrap()
    }

    /// Starts a second process in the place of one that lives, and hands the first out.
    #[must_use]
    pub fn succeed(&mut self, module: u32) -> Running {
        let first = self.agents.remove(&module).unwrap();
        self.start(module, None);
        first
    }

    /// Kills one module's process, of which `second` takes the place; returns the time of the kill.
    pub fn replace(&mut self, module: u32, second: Running) -> Instant {
        let died = self.kill(module);
        self.agents.insert(module, second);
        died
    }

    /// Kills one module's process and reports its body as removed, as simulated robots vanish with their processes; returns
    /// the time of the kill.
    pub fn kill_and_remove(&mut self, module: u32) -> Instant {
        let died = self.kill(module);
        self.remove(&[module]);
        died
    }

    /// Begins to report the bodies of modules as removed, whose processes have ended.
    pub fn remove(&mut self, modules: &[u32]) {
        let modules: Vec<String> = modules.iter().map(u32::to_string).collect();
        let options = ["--remove-module", &modules.join(",")];
        let reporter = self.started(None, "target_publisher", &options);
        self.reporters.push(reporter);
    }

    /// Kills one module's process, and leaves its body where it is; returns the time of the kill.
    pub fn kill(&mut self, module: u32) -> Instant {
        let mut agent = self.agents.remove(&module).unwrap();
        agent.kill();
        Instant::now()
    }

    /// Ends every module, each with its log.
    pub fn stop_all(&mut self) -> BTreeMap<u32, crate::Finished> {
        let agents = std::mem::take(&mut self.agents);
        agents
            .into_iter()
            .map(|(module, agent)| (module, agent.stop()))
            .collect()
    }

    /// How far every living module's log has come.
    #[must_use]
    pub fn marks(&self) -> BTreeMap<u32, usize> {
        let marks = self.agents.iter();
        marks
            .map(|(&module, agent)| (module, agent.logged()))
            .collect()
    }

    /// Waits until one of the living modules logs a line with `text` after `marks`; `None` when the time is up.
    #[must_use]
    pub fn wait_for_any(
        &self,
        marks: &BTreeMap<u32, usize>,
        text: &str,
        limit: Duration,
    ) -> Option<u32> {
        let deadline = Instant::now() + limit;
        while Instant::now() < deadline {
            let says_so = |(module, agent): (&u32, &Running)| {
                let lines = agent.log_since(marks.get(module).copied().unwrap_or_default());
                lines
                    .iter()
                    .any(|line| line.text.contains(text))
                    .then_some(*module)
            };
            if let Some(module) = self.agents.iter().find_map(says_so) {
                return Some(module);
            }
            thread::sleep(Duration::from_millis(5));
        }
        None
    }

    /// Starts a program that announces the target.
    #[must_use]
    pub fn announce(&self, network: Option<&Namespace>) -> Running {
        let expected = self.modules.len().to_string();
        let ids: Vec<String> = self.modules.iter().map(u32::to_string).collect();
        let voters = ids.join(",");
        let mut arguments = vec!["--scenario", self.file.path()];
        arguments.extend(["--expected-modules", &expected]);
        if self.stores.is_some() {
            arguments.extend(["--voters", &voters]);
        }
        self.started(network, "target_publisher", &arguments)
    }

    /// Starts a verifier that keeps watching.
    #[must_use]
    pub fn judge(&self, network: Option<&Namespace>) -> Judge {
        self.judge_within(network, self.timing.suspicion())
    }

    /// The same, to which a member that is silent for `silence` does not count as live.
    #[must_use]
    pub fn judge_within(&self, network: Option<&Namespace>, silence: Duration) -> Judge {
        let silence = silence.as_secs_f64().to_string();
        let arguments = [
            "--keep-watching",
            "--json",
            "--time-limit-s",
            "600",
            "--silence-s",
            &silence,
        ];
        Judge {
            verifier: self.started(network, "verifier", &arguments),
            spots: self.spots,
        }
    }

    fn started(&self, network: Option<&Namespace>, program: &str, arguments: &[&str]) -> Running {
        let domain = &self.domain;
        match (network, self.router.as_deref()) {
            (None, None) => Running::start(program, domain, arguments),
            (Some(network), None) => Running::start_within(network, program, domain, arguments),
            (None, Some(router)) => {
                Running::start_over_zenoh(&[router], program, domain, arguments)
            }
            (Some(network), Some(router)) => {
                Running::start_over_zenoh_within(network, &[router], program, domain, arguments)
            }
        }
    }

    /// Waits until all spots are filled and all living modules are members, as the verifier judges it after `since`.
    ///
    /// Only a module that joins the graph again after `since`, as its DDS library locked itself up or no longer receives, may
    /// be left out: the others may have filled all spots by then, and open no epoch for a spare (rule E7).
    ///
    /// # Panics
    /// If that is not the case within `limit`; the message has the logs.
    pub fn wait_until_whole(&self, judge: &Judge, since: Instant, limit: Duration) -> Judged {
        let living = self.living();
        judge.wait_until(since, limit, |judged| {
            let members = judged.modules();
            let mut left_out = living.difference(&members);
            judged.is_whole()
                && members.is_subset(&living)
                && left_out.all(|&module| self.joins_again(module, since))
        })
        .unwrap_or_else(|last| {
            panic!(
                "not whole with modules {living:?} within {limit:?}; the verifier said last: {last:?}\n{}",
                self.story()
            )
        })
    }

    /// Whether a module's process had to join the graph again after a time.
    fn joins_again(&self, module: u32, since: Instant) -> bool {
        let log = self.agent(module).log_since(0);
        let reasons = [
            "locked itself up; restarting",
            "; joining the ROS 2 graph again",
        ];
        let mut lines = log.iter().filter(|line| line.at >= since);
        lines.any(|line| reasons.iter().any(|reason| line.text.contains(reason)))
    }

    /// The last lines of every living module's log.
    #[must_use]
    pub fn story(&self) -> String {
        const LINES_MAX: usize = 40;
        let mut story = String::new();
        for (module, agent) in &self.agents {
            story.push_str(&format!("-- module {module}\n"));
            let lines = agent.log_since(agent.logged().saturating_sub(LINES_MAX));
            for line in lines {
                story.push_str(&line.text);
                story.push('\n');
            }
        }
        story
    }
}

/// A verifier that keeps watching.
pub struct Judge {
    verifier: Running,
    spots: usize,
}

impl Judge {
    /// Waits for a verdict of which `is_it` holds, given after `since`, or before and still standing; the last that was
    /// given if none comes.
    ///
    /// # Errors
    /// The last verdict of all, if the time is up before.
    pub fn wait_until(
        &self,
        since: Instant,
        limit: Duration,
        is_it: impl Fn(&Judged) -> bool,
    ) -> Result<Judged, Box<Option<Judged>>> {
        let mut last = None;
        let found = self.verifier.wait_for_line(0, limit, |line| {
            let judged = Judged::read(line.at, &line.text, self.spots);
            let found = (judged.at >= since && is_it(&judged)).then(|| judged.clone());
            last = Some(judged);
            found
        });
        found.ok_or_else(|| Box::new(last))
    }

    /// Every verdict so far.
    #[must_use]
    pub fn verdicts(&self) -> Vec<Judged> {
        let mut verdicts = Vec::new();
        let count = self.verifier.printed();
        self.verifier.wait_for_line(0, Duration::ZERO, |line| {
            verdicts.push(Judged::read(line.at, &line.text, self.spots));
            (verdicts.len() == count).then_some(())
        });
        verdicts
    }

    /// The process.
    #[must_use]
    pub fn process(&self) -> &Running {
        &self.verifier
    }

    /// Kills the verifier.
    pub fn kill(&mut self) {
        self.verifier.kill();
    }
}

/// One verdict.
#[derive(Clone, Debug)]
pub struct Judged {
    /// When it was printed.
    pub at: Instant,
    /// COMPLETE, PARTIAL or FAILED.
    pub outcome: String,
    /// The number of the epoch that was judged.
    pub epoch: Option<u64>,
    /// Which module is on which spot.
    pub assignments: BTreeMap<u32, u32>,
    /// The spots that bodies block, each with the module of the body.
    pub blocked: BTreeMap<u32, u32>,
    /// The members without a spot.
    pub unassigned: BTreeSet<u32>,
    /// What was wrong.
    pub violations: Vec<String>,
    /// What was missing.
    pub missing: Vec<String>,
    spots: usize,
}

impl Judged {
    fn read(at: Instant, line: &str, spots: usize) -> Self {
        let line: Value = serde_json::from_str(line).unwrap();
        let verdict = &line["verdict"];
        let id = |value: &Value| u32::try_from(value.as_u64().unwrap()).unwrap();
        let list = |key: &str| verdict[key].as_array().unwrap().iter();
        let texts = |key| list(key).map(|text| text.as_str().unwrap().to_owned());
        Self {
            at,
            outcome: verdict["outcome"].as_str().unwrap().to_owned(),
            epoch: verdict["epoch"]["number"].as_u64(),
            assignments: list("assignments")
                .map(|pair| (id(&pair["module"]), id(&pair["spot"])))
                .collect(),
            blocked: list("blocked_spots")
                .map(|pair| (id(&pair["spot"]), id(&pair["module"])))
                .collect(),
            unassigned: list("unassigned").map(id).collect(),
            violations: texts("violations").collect(),
            missing: texts("missing").collect(),
            spots,
        }
    }

    /// Whether every spot is filled, without a fault.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let spots: BTreeSet<u32> = self.assignments.values().copied().collect();
        self.outcome == "COMPLETE" && self.violations.is_empty() && spots.len() == self.spots
    }

    /// The modules of the roster that was judged.
    #[must_use]
    pub fn modules(&self) -> BTreeSet<u32> {
        self.assignments
            .keys()
            .chain(&self.unassigned)
            .copied()
            .collect()
    }
}
