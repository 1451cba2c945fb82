//! rclpy over Fast DDS, the default middleware of ROS 2, with the Python package of our interface files.

use std::collections::BTreeMap;
use std::env;
use std::ffi::{OsStr, OsString};
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::programs::{Running, program, root, target_directory};
use crate::python::{environment, locked, run};
use crate::ros_tool::RosTool;
use crate::tools::{Tool, on_path, report, tool_or_skip};

const IS_3_11: &str = "import sys; \
    sys.version_info[:2] == (3, 11) or sys.exit('Python 3.11 is needed, but python3 is ' + sys.version.split()[0])";

/// An environment with rclpy, Fast DDS and `formation_msgs`.
pub struct Rclpy {
    python: PathBuf,
    /// What the package was built into.
    build: PathBuf,
    interfaces: PathBuf,
}

impl Rclpy {
    /// The environment under the build's target directory, which this makes where it is missing or made for other wheels or
    /// interface files. `None`, after a line that says so, where the wheels or a compiler cannot be had.
    ///
    /// # Panics
    /// When it cannot be had and `FORMATION_REQUIRE_TOOLS` names it.
    #[must_use]
    pub fn find() -> Option<Self> {
        tool_or_skip(Tool::Rclpy, made())
    }

    /// The type hashes that the generator of ROS 2 computed: those of our interfaces, and those that the wheels publish of
    /// theirs.
    ///
    /// # Panics
    /// When the generator wrote none.
    #[must_use]
    pub fn type_hashes(&self) -> BTreeMap<String, String> {
        let generated = self.build.join("rosidl_generator_type_description");
        let published = self.environment().join("share");
        let packages = entries(&generated).chain(entries(&published));
        let folders =
            packages.flat_map(|package| ["msg", "srv", "action"].map(|kind| package.join(kind)));
        let files = folders
            .filter(|folder| folder.is_dir())
            .flat_map(|folder| entries(&folder).collect::<Vec<_>>())
            .filter(|file| file.extension().is_some_and(|kind| kind == "json"));
        // A file has the hashes of its own types, such as requests and responses, and of those that they contain.
        let of_file = |file: PathBuf| {
            let text = fs::read_to_string(file).unwrap();
            let description: Value = serde_json::from_str(&text).unwrap();
            let hashes = description["type_hashes"].as_array().unwrap().clone();
            hashes.into_iter().map(|hash| {
                let text = |key: &str| hash[key].as_str().unwrap().to_owned();
                (text("type_name"), text("hash_string"))
            })
        };
        files.flat_map(of_file).collect()
    }

    /// Starts a script of the repository, named as seen from its root, on a domain of loopback.
    #[must_use]
    pub fn start(&self, script: &str, domain: &str, arguments: &[&str]) -> RosTool {
        let mut command = self.command(script, &[]);
        command
            .args(arguments)
            .env("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
            .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
            .env("ROS_DOMAIN_ID", domain)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        RosTool::of(command, "see tests/src/rclpy.rs")
    }

    /// A command that runs a script of the repository with the packages of these prefixes besides.
    fn command(&self, script: &str, more_prefixes: &[&Path]) -> Command {
        let environment = self.environment();
        let own = [self.interfaces.as_path(), environment];
        let prefixes = more_prefixes.iter().copied().chain(own);
        let libraries = own.map(|prefix| prefix.join("lib"));
        let mut command = Command::new(&self.python);
        command
            .env("PATH", self.path())
            .arg(root().join(script))
            .env(
                "PYTHONPATH",
                self.interfaces.join("lib/python3.11/site-packages"),
            )
            .env("LD_LIBRARY_PATH", env::join_paths(libraries).unwrap())
            .env("AMENT_PREFIX_PATH", env::join_paths(prefixes).unwrap());
        command
    }

    fn environment(&self) -> &Path {
        self.python.ancestors().nth(2).unwrap()
    }

    /// The path of programs, on which its interpreter is the first.
    fn path(&self) -> OsString {
        let inherited = env::var_os("PATH").unwrap_or_default();
        let own = self.environment().join("bin");
        let places = [own].into_iter().chain(env::split_paths(&inherited));
        env::join_paths(places).unwrap()
    }

    /// Installs the package of the launch files with CMake, as `colcon build` does. Returns the prefix, which is in this folder. Its
    /// programs are those of this build.
    ///
    /// # Panics
    /// When CMake fails.
    #[must_use]
    pub fn install_launch_package(&self, folder: &Path) -> PathBuf {
        let [build, prefix, cargo] = ["build", "install", "cargo"].map(|name| folder.join(name));
        let built = program("formation");
        let built = built.parent().unwrap();
        // In place of cargo, which would build everything once more.
        let script = format!(
            "#!/bin/sh\nwhile [ \"$1\" != --target-dir ]; do shift; done\nmkdir -p \"$2/release\"\n\
             cd '{}' && cp {} \"$2/release\"\n",
            built.display(),
            PROGRAMS.join(" ")
        );
        fs::write(&cargo, script).unwrap();
        fs::set_permissions(&cargo, Permissions::from_mode(0o755)).unwrap();
        let environment = self.environment();
        let cmake = |arguments: &[&OsStr]| {
            let mut command = Command::new(environment.join("bin/cmake"));
            command
                .args(arguments)
                .env("PATH", self.path())
                .env("AMENT_PREFIX_PATH", environment)
                .env("CMAKE_PREFIX_PATH", environment);
            run(&mut command).unwrap();
        };
        let [source, define_prefix, define_cargo, define_python] = [
            root().join("launch_scripts").into_os_string(),
            defined("CMAKE_INSTALL_PREFIX", &prefix),
            defined("CARGO", &cargo),
            defined("Python3_EXECUTABLE", &self.python),
        ];
        cmake(&[
            "-S".as_ref(),
            &source,
            "-B".as_ref(),
            build.as_ref(),
            &define_prefix,
            &define_cargo,
            &define_python,
        ]);
        cmake(&["--build".as_ref(), build.as_ref()]);
        cmake(&["--install".as_ref(), build.as_ref()]);
        prefix
    }

    /// Runs a launch file of the package that was installed with this prefix, in a group of processes of its own.
    #[must_use]
    pub fn launch(&self, prefix: &Path, domain: &str, arguments: &[&str]) -> Running {
        let mut command = self.command("tests/python/launch_installed.py", &[prefix]);
        command.arg("formation_launch").process_group(0);
        Running::start_command(command, "launch_installed.py", domain, arguments)
    }
}

/// The programs of the package.
const PROGRAMS: [&str; 8] = [
    "formation",
    "leader_agent",
    "module_agent",
    "recorder",
    "target_publisher",
    "verifier",
    "visualiser",
    "world",
];

/// The definition of a variable of CMake.
fn defined(name: &str, value: &Path) -> OsString {
    let mut definition = OsString::from(format!("-D{name}="));
    definition.push(value);
    definition
}

fn made() -> Result<Rclpy, String> {
    on_path(&["c++", "g++"])?;
    let folder = target_directory().join("rclpy");
    let requirements = root().join("tests/rclpy_requirements.txt");
    let python = environment(&folder, &requirements, IS_3_11)?;
    let build = target_directory().join("rclpy_interfaces");
    let _lock = locked(&build)?;
    let complete = build.join("built_from");
    let wanted = sources();
    if fs::read(&complete).ok().as_deref() != Some(wanted.as_bytes()) {
        report(
            "Building the Python package of the interface files, which takes one to three minutes, once.",
        );
        if build.exists() {
            fs::remove_dir_all(&build).unwrap();
        }
        fs::create_dir_all(&build).unwrap();
        run(Command::new(&python)
            .arg(root().join("tests/python/build_interfaces.py"))
            .arg(&folder)
            .arg(&build))?;
        fs::write(complete, wanted).unwrap();
    }
    let interfaces = build.join("install");
    Ok(Rclpy {
        python,
        build,
        interfaces,
    })
}

/// All files that the package is built from.
fn sources() -> String {
    let package = root().join("msgs");
    let mut files: Vec<PathBuf> = vec![
        package.join("CMakeLists.txt"),
        package.join("package.xml"),
        root().join("tests/rclpy_requirements.txt"),
    ];
    for kind in ["msg", "srv", "action"] {
        files.extend(entries(&package.join(kind)));
    }
    files.sort();
    files
        .iter()
        .map(|file| fs::read_to_string(file).unwrap())
        .collect()
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
}
