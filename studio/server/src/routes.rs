//! What is answered to which request.

use std::io::{self, Read, Write};
use std::time::Duration;

use formation_studio_engine::{SCENARIO_BYTES_MAX, answer};
use serde_json::{Value, json};
use tiny_http::{Header, Method, Request, Response};

use crate::guard::Guard;
use crate::page::{self, POLICY};
use crate::run::{Run, Step};
use crate::{StudioError, Work};

/// A line at least this often, so that a listener who is gone is noticed.
const BEAT: Duration = Duration::from_secs(5);
/// The longest body: a scenario inside JSON.
const BODY_BYTES_MAX: usize = 2 * SCENARIO_BYTES_MAX;

/// Answers requests.
pub struct Routes {
    guard: Guard,
    run: Run,
    scenario: Option<String>,
}

impl Routes {
    /// Routes to a page that begins with a scenario.
    pub fn new(guard: Guard, work: Work, scenario: Option<String>) -> Result<Self, StudioError> {
        Ok(Self {
            guard,
            run: Run::new(work)?,
            scenario,
        })
    }

    /// Ends what runs.
    pub fn end(&self) {
        self.run.end();
    }

    /// Answers a request.
    pub fn answer(&self, mut request: Request) {
        let (path, query) = match self.guard.admit(&request) {
            Ok(admitted) => admitted,
            Err(refused) => return send(request, refused.status(), "text/plain", refused.text()),
        };
        match (request.method(), path.as_str()) {
            (Method::Get, "api/events") => self.stream(request, &query),
            (Method::Get, "api/state") => send_json(request, 200, &self.state()),
            (Method::Get, path) => match page::file(path) {
                Some(file) => send(request, 200, file.kind, file.content),
                None => send(request, 404, "text/plain", "no such file"),
            },
            (Method::Post, _) => match body_of(&mut request) {
                Ok(body) if path == "api/engine" => {
                    send(request, 200, "application/json", &answer(&body));
                }
                Ok(body) => {
                    let (status, answer) = match self.order(&path, &body) {
                        Ok(()) => (200, json!({ "ok": {} })),
                        Err(text) => (409, json!({ "error": { "text": text } })),
                    };
                    send_json(request, status, &answer);
                }
                Err(text) => send_json(request, 400, &json!({ "error": { "text": text } })),
            },
            _ => send(request, 405, "text/plain", "only GET and POST are answered"),
        }
    }

    /// What the page has to know when it begins.
    fn state(&self) -> Value {
        json!({
            "server": true,
            "read_only": self.run.is_watched(),
            "running": self.run.is_running(),
            "scenario": self.scenario,
        })
    }

    /// Carries out an order of the page.
    ///
    /// # Errors
    /// Says why not.
    fn order(&self, path: &str, body: &str) -> Result<(), String> {
        let body: Value =
            serde_json::from_str(body).map_err(|error| format!("no JSON: {error}"))?;
        let module = || {
            let module = body["module"]
                .as_u64()
                .and_then(|it| u32::try_from(it).ok());
            module.ok_or_else(|| "`module` is missing".to_owned())
        };
        let text = || body["text"].as_str().ok_or("`text` is missing".to_owned());
        match path {
            "api/run" => self.run.start(text()?),
            "api/run/target" => self.run.target(text()?),
            "api/run/kill" => self.run.order(&json!({ "kill": { "module": module()? } })),
            "api/run/restart" => self
                .run
                .order(&json!({ "restart": { "module": module()? } })),
            "api/run/stop" => self.run.order(&json!({ "stop": {} })),
            "api/run/resume" => self.run.order(&json!({ "resume": {} })),
            "api/run/end" => {
                self.run.end();
                Ok(())
            }
            _ => Err(format!("there is no order `{path}`")),
        }
    }

    /// Sends what happens in the run, from an event on, until whoever listens is gone.
    fn stream(&self, request: Request, query: &str) {
        let last = request
            .headers()
            .iter()
            .find(|it| it.field.equiv("Last-Event-ID"));
        let last = last.and_then(|header| header.value.as_str().parse::<usize>().ok());
        let asked = query
            .strip_prefix("from=")
            .and_then(|from| from.parse().ok());
        let from = last
            .map(|last| last.saturating_add(1))
            .or(asked)
            .unwrap_or(0);
        let mut listener = request.into_writer();
        // It ends with an error when the listener is gone.
        let _ = self.stream_to(&mut listener, from);
    }

    fn stream_to(&self, listener: &mut dyn Write, mut next: usize) -> io::Result<()> {
        let head = format!(
            "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\
             X-Content-Type-Options: nosniff\r\nContent-Security-Policy: {POLICY}\r\n\r\nretry: 500\n\n"
        );
        listener.write_all(head.as_bytes())?;
        listener.flush()?;
        loop {
            match self.run.await_events(next, BEAT) {
                Step::Events(first, lines) => {
                    next = first + lines.len();
                    for (id, line) in (first..).zip(lines) {
                        write!(listener, "id: {id}\ndata: {line}\n\n")?;
                    }
                }
                Step::Nothing => listener.write_all(b": \n\n")?,
                Step::Ended => return Ok(()),
            }
            listener.flush()?;
        }
    }
}

/// The body of a request that says that it is JSON, which no form of another page can send unasked.
fn body_of(request: &mut Request) -> Result<String, String> {
    let kinds = request
        .headers()
        .iter()
        .filter(|it| it.field.equiv("Content-Type"));
    let is_json = |header: &Header| header.value.as_str().starts_with("application/json");
    if !kinds.clone().all(is_json) || kinds.count() != 1 {
        return Err("the Content-Type has to be application/json".to_owned());
    }
    let mut body = Vec::new();
    let bytes = u64::try_from(BODY_BYTES_MAX).unwrap_or(u64::MAX);
    let mut limited = request.as_reader().take(bytes.saturating_add(1));
    limited
        .read_to_end(&mut body)
        .map_err(|error| error.to_string())?;
    if body.len() > BODY_BYTES_MAX {
        return Err(format!("the request has more than {BODY_BYTES_MAX} bytes"));
    }
    String::from_utf8(body).map_err(|_| "the request is no UTF-8".to_owned())
}

fn send_json(request: Request, status: u16, answer: &Value) {
    send(request, status, "application/json", &answer.to_string());
}

fn send(request: Request, status: u16, kind: &str, text: &str) {
    let headers = [
        ("Content-Type", kind),
        ("Content-Security-Policy", POLICY),
        ("X-Content-Type-Options", "nosniff"),
        ("Referrer-Policy", "no-referrer"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Cache-Control", "no-store"),
    ];
    let mut response = Response::from_string(text).with_status_code(status);
    for (name, value) in headers {
        if let Ok(header) = Header::from_bytes(name, value) {
            response.add_header(header);
        }
    }
    // Whoever asked may be gone.
    let _ = request.respond(response);
}
