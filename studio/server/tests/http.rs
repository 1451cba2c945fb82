//! Requests as a page, another page and an attacker make them, byte for byte.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use formation_studio_server::{Backend, EventHub, REQUEST_BYTES_MAX, Server};
use tokio::sync::oneshot::{Sender, channel};

const PATIENCE: Duration = Duration::from_secs(30);

#[derive(Default)]
struct Echo {
    calls: AtomicUsize,
}

impl Backend for Echo {
    fn engine(&self, request: &str) -> String {
        self.calls.fetch_add(1, Ordering::Relaxed);
        format!("{{\"ok\":{request}}}")
    }

    fn state(&self) -> String {
        "{\"kind\":\"state\"}".to_owned()
    }

    fn order(&self, name: &str, body: &str) -> Option<String> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        (name == "run").then(|| body.to_owned())
    }
}

struct Served {
    port: u16,
    token: String,
    backend: Arc<Echo>,
    hub: EventHub,
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    fn start() -> Self {
        let server = Server::listen(0).unwrap();
        let address = server.address();
        let rest = address.strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = rest.split_once('/').unwrap();
        let token = token.strip_suffix('/').unwrap().to_owned();
        let port = port.parse().unwrap();
        let (backend, hub) = (Arc::new(Echo::default()), EventHub::default());
        let (stop, stopped) = channel();
        let (its_backend, its_hub) = (Arc::clone(&backend), hub.clone());
        let thread = thread::spawn(move || {
            let stopped = async {
                let _ = stopped.await;
            };
            server.serve(its_backend, its_hub, stopped).unwrap();
        });
        Self {
            port,
            token,
            backend,
            hub,
            stop: Some(stop),
            thread: Some(thread),
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends a request as it is written, and returns status, headers and body.
    fn send(&self, request: &str) -> (u16, String, String) {
        let mut stream = self.connect();
        // The server may refuse before it has read all.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8(answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, head.to_ascii_lowercase(), body.to_owned())
    }

    fn get(&self, path: &str, headers: &str) -> u16 {
        self.send(&format!(
            "GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n"
        ))
        .0
    }

    fn post(&self, call: &str, headers: &str, body: &str) -> (u16, String, String) {
        let (port, token, length) = (self.port, &self.token, body.len());
        self.send(&format!(
            "POST /{token}/api/{call} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n{headers}\
             Content-Length: {length}\r\n\r\n{body}"
        ))
    }

    fn calls(&self) -> usize {
        self.backend.calls.load(Ordering::Relaxed)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        drop(self.stop.take());
        let _ = self.thread.take().unwrap().join();
    }
}

const JSON: &str = "Content-Type: application/json\r\n";

#[test]
fn the_page_is_served_by_its_names_of_this_machine_and_to_nobody_else() {
    let served = Served::start();
    let state = format!("/{}/api/state", served.token);
    let port = served.port;
    for name in ["127.0.0.1", "localhost", "[::1]"] {
        assert_eq!(served.get(&state, &format!("Host: {name}:{port}\r\n")), 200);
    }
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    let own = format!("{host}Origin: http://127.0.0.1:{port}\r\n");
    assert_eq!(served.get(&state, &own), 200);
    for headers in [
        "Host: attacker.example\r\n".to_owned(),
        format!("Host: attacker.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".to_owned(),
        format!("Host: 127.0.0.1:{}\r\n", port ^ 1),
        format!("{host}Host: attacker.example\r\n"),
        format!("{host}Origin: http://attacker.example\r\n"),
        format!("{host}Origin: http://127.0.0.1\r\n"),
        format!("{host}Origin: https://127.0.0.1:{port}\r\n"),
        format!("{host}Origin: null\r\n"),
        format!("{own}Origin: http://attacker.example\r\n"),
        format!("{host}Sec-Fetch-Site: cross-site\r\n"),
        format!("{host}Sec-Fetch-Site: same-site\r\n"),
    ] {
        for path in ["api/state", "api/events", "", "live.js"] {
            let path = format!("/{}/{path}", served.token);
            let status = served.get(&path, &headers);
            // Some are refused by the HTTP library already.
            assert!([400, 403].contains(&status), "{status} {path} {headers}");
        }
    }
}

#[test]
fn a_call_with_another_origin_or_type_is_refused_before_it_is_made() {
    let served = Served::start();
    let wrong = [
        format!("Origin: http://attacker.example\r\n{JSON}"),
        format!("Origin: null\r\n{JSON}"),
        format!("Sec-Fetch-Site: cross-site\r\n{JSON}"),
        "Content-Type: text/plain\r\n".to_owned(),
        "Content-Type: application/x-www-form-urlencoded\r\n".to_owned(),
        String::new(),
    ];
    for headers in wrong {
        let (status, _, _) = served.post("run", &headers, "{}");
        assert!([403, 415].contains(&status), "{status} {headers}");
        let (status, _, _) = served.post("engine", &headers, "{}");
        assert!([403, 415].contains(&status), "{status} {headers}");
    }
    assert_eq!(served.calls(), 0);
    let own = format!("Origin: http://127.0.0.1:{}\r\n{JSON}", served.port);
    let (status, _, body) = served.post("engine", &own, "[1]");
    assert_eq!((status, body.as_str()), (200, "{\"ok\":[1]}"));
    assert_eq!(served.post("run", &own, "{\"yaml\":\"\"}").0, 200);
    assert_eq!(served.post("run/unknown", &own, "{}").0, 404);
}

#[test]
fn a_wrong_token_is_no_page() {
    let served = Served::start();
    let host = format!("Host: 127.0.0.1:{}\r\n", served.port);
    let token = &served.token;
    assert_eq!(token.len(), 32);
    for path in [
        "/".to_owned(),
        "/api/state".to_owned(),
        format!("/{token}"),
        format!("/{}/api/state", &token[..31]),
        format!("/{token}0/api/state"),
        format!("/{}/api/state", token.to_uppercase() + "x"),
        "//api/state".to_owned(),
        format!("/x/{token}/api/state"),
        format!("/{token}/../api/state"),
        format!("/{token}/%2e%2e/Cargo.toml"),
        format!("/{token}/no_such_file.js"),
    ] {
        assert_eq!(served.get(&path, &host), 404, "{path}");
    }
    let other = Served::start();
    assert_ne!(other.token, served.token, "drawn for each server");
}

#[test]
fn a_body_that_is_too_long_or_no_text_is_refused() {
    let served = Served::start();
    let long = "x".repeat(REQUEST_BYTES_MAX + 1);
    assert_eq!(served.post("engine", JSON, &long).0, 413);
    assert_eq!(served.calls(), 0);
    let port = served.port;
    let token = &served.token;
    let mut stream = served.connect();
    let head = format!(
        "POST /{token}/api/engine HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n{JSON}Content-Length: 2\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(b"\xff\xfe").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 400 "), "{answer}");
    assert_eq!(served.calls(), 0);
}

#[test]
fn every_answer_has_the_headers_that_keep_a_page_in_bounds() {
    let served = Served::start();
    let host = format!("Host: 127.0.0.1:{}\r\n", served.port);
    for path in [
        format!("/{}/live.js", served.token),
        format!("/{}/api/state", served.token),
        "/nothing".to_owned(),
    ] {
        let request = format!("GET {path} HTTP/1.1\r\nConnection: close\r\n{host}\r\n");
        let (_, head, _) = served.send(&request);
        for header in [
            "content-security-policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; ",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "x-frame-options: deny",
            "cache-control: no-store",
        ] {
            assert!(head.contains(header), "{path}: {header}\n{head}");
        }
        assert!(!head.contains("access-control"), "{head}");
        assert!(!head.contains("unsafe-inline"), "{head}");
    }
}

#[test]
fn events_come_after_the_state_to_every_page() {
    let served = Served::start();
    let mut pages = Vec::new();
    for _ in 0..2 {
        let mut stream = served.connect();
        let request = format!(
            "GET /{}/api/events HTTP/1.1\r\nHost: localhost:{}\r\n\r\n",
            served.token, served.port
        );
        stream.write_all(request.as_bytes()).unwrap();
        pages.push(BufReader::new(stream));
    }
    let next = |page: &mut BufReader<TcpStream>| loop {
        let mut line = String::new();
        assert_ne!(page.read_line(&mut line).unwrap(), 0, "no event came");
        if let Some(event) = line.strip_prefix("data: ") {
            break event.trim_end().to_owned();
        }
    };
    for page in &mut pages {
        assert_eq!(next(page), "{\"kind\":\"state\"}");
    }
    served.hub.send("{\"kind\":\"log\"}");
    for page in &mut pages {
        assert_eq!(next(page), "{\"kind\":\"log\"}");
        page.get_ref().shutdown(Shutdown::Both).unwrap();
    }
}
