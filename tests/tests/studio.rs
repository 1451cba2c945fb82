//! The studio as its page uses it, and as another page would: real processes, from HTTP calls.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Line, Running, scenario_path};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(120);
const JSON: &str = "Content-Type: application/json\r\n";

/// An H of seven spots, and a line of as many.
const H: [(i32, i32); 7] = [(0, 0), (0, 1), (0, 2), (1, 1), (2, 0), (2, 1), (2, 2)];
const LINE: [(i32, i32); 7] = [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0)];

/// A scenario with these spots, and eight modules in a row.
fn scenario(name: &str, spots: &[(i32, i32)]) -> String {
    let numbered = || (1..).zip(spots);
    let edges: Vec<[i32; 2]> = numbered()
        .flat_map(|(a, from)| numbered().map(move |(b, to)| (a, from, b, to)))
        .filter(|(a, from, b, to)| a < b && (from.0 - to.0).abs() + (from.1 - to.1).abs() == 1)
        .map(|(a, _, b, _)| [a, b])
        .collect();
    let place =
        |(id, &(x, y)): (i32, &(i32, i32))| json!({"id": id, "x": f64::from(x), "y": f64::from(y)});
    let spots: Vec<Value> = numbered().map(place).collect();
    let modules: Vec<Value> = (1..=8)
        .map(|id| json!({"id": id, "x": f64::from(2 * id - 6), "y": -3.0}))
        .collect();
    json!({"name": name, "target": {"spots": spots, "edges": edges}, "singletons": modules})
        .to_string()
}

/// A studio, and its address.
struct Studio {
    process: Running,
    port: u16,
    token: String,
}

impl Studio {
    fn start(domain: &str, arguments: &[&str]) -> Self {
        let process = Running::start("formation", domain, &[&["studio"], arguments].concat());
        let rest = |line: &Line| {
            line.text
                .strip_prefix("http://127.0.0.1:")
                .map(str::to_owned)
        };
        let rest = process.wait_for_line(0, PATIENCE, rest);
        let rest = rest.unwrap_or_else(|| panic!("no address: {:?}", process.log_since(0)));
        let (port, token) = rest.trim().split_once('/').unwrap();
        Self {
            port: port.parse().unwrap(),
            token: token.trim_end_matches('/').to_owned(),
            process,
        }
    }

    fn send(&self, method: &str, call: &str, headers: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (token, length) = (&self.token, body.len());
        let host = match headers.contains("Host: ") {
            true => String::new(),
            false => format!("Host: 127.0.0.1:{}\r\n", self.port),
        };
        let head = format!(
            "{method} /{token}/api/{call} HTTP/1.1\r\n{host}Connection: close\r\n{headers}Content-Length: {length}\r\n\r\n"
        );
        // A body that is too long is refused before all of it was sent.
        let _ = stream
            .write_all(head.as_bytes())
            .and_then(|()| stream.write_all(body.as_bytes()));
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        // Short answers come in one piece.
        (status, body.to_owned())
    }

    fn post(&self, call: &str, body: &Value) -> Value {
        let (status, answer) = self.send("POST", call, JSON, &body.to_string());
        assert_eq!(status, 200, "{call}: {answer}");
        serde_json::from_str(&answer).unwrap()
    }

    fn order(&self, call: &str, body: &Value) {
        let answer = self.post(call, body);
        assert_eq!(answer, json!({"ok": {}}), "{call}");
    }

    fn refusal(&self, call: &str, body: &Value) -> String {
        let answer = self.post(call, body);
        let text = answer["error"]["text"].as_str();
        text.unwrap_or_else(|| panic!("{call} is not refused: {answer}"))
            .to_owned()
    }

    fn state(&self) -> Value {
        let (status, state) = self.send("GET", "state", "", "");
        assert_eq!(status, 200);
        serde_json::from_str(&state).unwrap()
    }

    /// Waits until the state is as expected.
    fn wait_for(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let state = self.state();
            if is_so(&state) {
                return state;
            }
            assert!(Instant::now() < deadline, "{what} is missing: {state}");
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn wait_for_complete(&self, spots: u64) -> Value {
        self.wait_for("COMPLETE", |state| {
            state["verdict"]["outcome"] == "COMPLETE" && state["verdict"]["spots"] == spots
        })
    }

    /// Nothing was started.
    fn is_idle(&self) {
        let state = self.state();
        assert_eq!(state["running"], false, "{state}");
        assert_eq!(state["modules"], json!([]));
        assert_eq!(children(self.process.id()), Vec::<u32>::new());
    }
}

/// The processes that a process has started and that have not ended.
fn children(parent: u32) -> Vec<u32> {
    let tasks = std::fs::read_dir(format!("/proc/{parent}/task")).unwrap();
    let lists = tasks.map(|task| {
        let path = task.unwrap().path().join("children");
        std::fs::read_to_string(path).unwrap_or_default()
    });
    let lists: Vec<String> = lists.collect();
    let ids = lists.iter().flat_map(|list| list.split_whitespace());
    ids.map(|id| id.parse().unwrap()).collect()
}

/// Waits until these processes are gone.
fn await_end_of<'a>(processes: impl Iterator<Item = &'a u32>) {
    let deadline = Instant::now() + PATIENCE;
    for process in processes {
        // One that has ended and has no parent that waits for it is a zombie.
        let runs = || {
            let stat = std::fs::read_to_string(format!("/proc/{process}/stat"));
            stat.is_ok_and(|stat| !stat.contains(") Z "))
        };
        while runs() {
            assert!(Instant::now() < deadline, "process {process} still runs");
            thread::sleep(Duration::from_millis(20));
        }
    }
}

fn process_states(state: &Value) -> Vec<(u64, String)> {
    let modules = state["modules"].as_array().unwrap().iter();
    modules
        .map(|module| {
            let process = module["process"].as_str().unwrap().to_owned();
            (module["id"].as_u64().unwrap(), process)
        })
        .collect()
}

/// What a state says of a module.
fn module_of(state: &Value, id: u64) -> &Value {
    let modules = state["modules"].as_array().unwrap();
    modules.iter().find(|module| module["id"] == id).unwrap()
}

#[test]
fn eight_processes_form_an_h_lose_one_and_form_a_line_from_where_they_stand() {
    let domain = &*Domain::for_processes(12);
    let studio = Studio::start(domain, &["--domain", domain, "--speed", "2"]);
    studio.order("run", &json!({"yaml": scenario("h", &H)}));
    let refused = studio.refusal("run", &json!({"yaml": scenario("h", &H)}));
    assert!(refused.starts_with("a run is under way; "), "{refused}");
    studio.wait_for("motion", |state| state["stage"] == "moving");
    studio.order("run/kill", &json!({"module": 3}));
    let formed = studio.wait_for_complete(7);
    let log = formed["log"].to_string();
    assert!(log.contains("Epoch 2: all modules halt"), "{log}");
    let dead = process_states(&formed).into_iter();
    let dead: Vec<u64> = dead
        .filter(|(_, process)| process == "dead")
        .map(|(id, _)| id)
        .collect();
    assert_eq!(dead, [3]);
    let refused = studio.refusal("run/kill", &json!({"module": 3}));
    assert_eq!(refused, "the process of module 3 has ended already");
    let refused = studio.refusal("run/kill", &json!({"module": 9}));
    assert_eq!(refused, "module 9 is none of this run");
    studio.order("run/restart", &json!({"module": 3}));
    studio.wait_for("module 3", |state| {
        process_states(state).iter().all(|(_, is)| is == "running")
    });
    studio.order("run/target", &json!({"yaml": scenario("line", &LINE)}));
    studio.wait_for("motion to the line", |state| state["stage"] == "moving");
    studio.order("run/stop", &json!({}));
    studio.wait_for("the stop", |state| state["progress"]["stopped"] == true);
    studio.order("run/resume", &json!({}));
    let formed = studio.wait_for_complete(7);
    let modules = formed["modules"].as_array().unwrap().iter();
    let row = modules.filter(|module| module["phase"] == "SETTLED");
    let mut xs: Vec<f64> = row
        .filter(|module| module["y"].as_f64().unwrap().abs() < 0.05)
        .map(|module| module["x"].as_f64().unwrap().round())
        .collect();
    xs.sort_by(f64::total_cmp);
    assert_eq!(xs, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    // Seven spots and eight modules: the spare takes the spot of a module that retires.
    studio.order("run/retire", &json!({"module": 1}));
    let retired = |state: &Value| module_of(state, 1)["in_service"] == false;
    // The verdict on what was formed before stands until the others gather.
    studio.wait_for("the plan without module 1", |state| {
        retired(state) && module_of(state, 1)["phase"] == "SPARE"
    });
    studio.wait_for_complete(7);
    studio.order("run/rejoin", &json!({"module": 1}));
    studio.wait_for("the return of module 1", |state| !retired(state));
    studio.wait_for_complete(7);
    // The settled module on the left end is pushed away.
    let state = studio.state();
    let settled = state["modules"].as_array().unwrap().iter();
    let settled = settled.filter(|module| module["phase"] == "SETTLED");
    let place = |module: &Value| module["x"].as_f64().unwrap();
    let left = settled.min_by(|one, other| place(one).total_cmp(&place(other)));
    let left = left.unwrap()["id"].as_u64().unwrap();
    studio.order("run/push", &json!({"module": left, "x": -1.5, "y": 0.0}));
    studio.wait_for("the push", |state| place(module_of(state, left)) < -1.0);
    studio.wait_for("a module that moves", |state| state["stage"] == "moving");
    studio.wait_for_complete(7);
    studio.order("run/restart", &json!({"module": 1}));
    studio.wait_for("the new process of module 1", |state| {
        state["log"].to_string().contains("Module 1 starts again")
    });
    // What ends makes room for the next at once.
    studio.order("run/end", &json!({}));
    studio.order("run", &json!({"yaml": scenario("h", &H)}));
    studio.wait_for("the next run", |state| state["stage"] == "moving");
    // The end of the server is that of all processes.
    let run = children(studio.process.id());
    let programs: Vec<u32> = run.iter().flat_map(|&run| children(run)).collect();
    assert_eq!((run.len(), programs.len()), (1, 10), "{programs:?}");
    let finished = studio.process.stop();
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    await_end_of(run.iter().chain(&programs));
}

#[test]
fn a_server_that_is_killed_leaves_no_process_behind() {
    let domain = &*Domain::for_processes(12);
    let mut studio = Studio::start(domain, &["--domain", domain]);
    studio.order("run", &json!({"yaml": scenario("h", &H)}));
    studio.wait_for("motion", |state| state["stage"] == "moving");
    let run = children(studio.process.id());
    let programs: Vec<u32> = run.iter().flat_map(|&run| children(run)).collect();
    assert_eq!((run.len(), programs.len()), (1, 10), "{programs:?}");
    studio.process.kill();
    await_end_of(run.iter().chain(&programs));
}

#[test]
fn what_is_hostile_is_refused_and_nothing_is_started() {
    let domain = &*Domain::for_processes(1);
    let studio = Studio::start(domain, &["--domain", domain]);
    let run = json!({"yaml": scenario("h", &H)}).to_string();
    for headers in [
        "Origin: http://attacker.example\r\n",
        "Origin: null\r\n",
        "Host: attacker.example\r\n",
        "Sec-Fetch-Site: cross-site\r\n",
    ] {
        let headers = format!("{headers}{JSON}");
        assert_eq!(
            studio.send("POST", "run", &headers, &run).0,
            403,
            "{headers}"
        );
    }
    let (status, _) = studio.send("POST", "run", "Content-Type: text/plain\r\n", &run);
    assert_eq!(status, 415);
    let module = |id: usize| format!("{{id: {id}, x: {id}.0, y: 0.0}}");
    let many: Vec<String> = (1..=20_000).map(module).collect();
    let many = format!(
        "target: {{spots: [{{id: 1, x: 0.0, y: 3.0}}]}}\nsingletons: [{}]",
        many.join(", ")
    );
    let refused = studio.refusal("run", &json!({"yaml": many}));
    assert!(refused.contains("at most 10000"), "{refused}");
    let million: String = (0..1_000_000)
        .map(|id| format!("- {{id: {id}}}\n"))
        .collect();
    let body = json!({"yaml": million}).to_string();
    assert_eq!(studio.send("POST", "run", JSON, &body).0, 413);
    let bomb = "a: &a [x, x, x, x, x, x, x, x, x]\nb: &b [*a, *a, *a, *a, *a, *a, *a, *a]\nc: &c [*b, *b, *b, *b, *b]\n";
    for yaml in [
        bomb.to_owned(),
        "<img src=x onerror=alert(1)>: 1".to_owned(),
        "target: {spots: []}".to_owned(),
        "\u{0}".to_owned(),
        scenario(&"<b>".repeat(1_000), &H),
    ] {
        studio.refusal("run", &json!({"yaml": yaml}));
    }
    for body in [
        json!({"yaml": scenario("h", &H), "options": {"modules_per_process": 0}}),
        json!({"yaml": scenario("h", &H), "options": {"driver": "touch /tmp/x"}}),
        json!({"yaml": scenario("h", &H), "command": "true"}),
        json!({}),
        json!([]),
    ] {
        studio.refusal("run", &body);
    }
    for call in [
        "run/kill",
        "run/restart",
        "run/retire",
        "run/rejoin",
        "run/push",
        "run/stop",
        "run/resume",
        "run/target",
    ] {
        studio.refusal(call, &json!({"module": 1, "yaml": ""}));
    }
    studio.is_idle();
}

#[test]
fn an_attached_page_watches_a_run_and_cannot_change_it() {
    let domain = &*Domain::for_processes(13);
    let studio = Studio::start(domain, &["--attach", "--domain", domain]);
    let file = scenario_path("mcs_detach");
    let arguments = [
        "run",
        file.to_str().unwrap(),
        "--json",
        "--domain",
        domain,
        "--speed",
        "0.7",
    ];
    let run = Running::start("formation", domain, &arguments);
    studio.wait_for("a module that moves", |state| state["stage"] == "moving");
    assert_eq!(studio.state()["read_only"], true);
    for call in [
        "run",
        "run/kill",
        "run/restart",
        "run/retire",
        "run/rejoin",
        "run/push",
        "run/stop",
        "run/resume",
        "run/target",
        "run/end",
    ] {
        let refused = studio.refusal(call, &json!({"module": 1}));
        assert!(refused.contains("only watches"), "{refused}");
    }
    studio.wait_for_complete(7);
    let run = run.finish(PATIENCE);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(run.json()["replanned"], false, "it was not disturbed");
    assert_eq!(studio.process.stop().status, 0);
}
