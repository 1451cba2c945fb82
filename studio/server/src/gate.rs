//! Which requests are answered: those of the page that this server gave out, on this machine.

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, HeaderName, StatusCode};

/// Set by browsers, and not by pages.
const FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// What a request has to show.
#[derive(Clone, Debug)]
pub(crate) struct Gate {
    token: String,
    hosts: [String; 3],
}

impl Gate {
    pub(crate) fn new(token: String, port: u16) -> Self {
        let hosts = ["127.0.0.1", "localhost", "[::1]"];
        Self {
            token,
            hosts: hosts.map(|host| format!("{host}:{port}")),
        }
    }

    /// The rest of the path behind the token.
    ///
    /// # Errors
    /// The status for a request that is refused. A wrong token is no page of this server.
    pub(crate) fn admit<'a>(
        &self,
        path: &'a str,
        headers: &HeaderMap,
    ) -> Result<&'a str, StatusCode> {
        if !self.comes_from_here(headers) {
            return Err(StatusCode::FORBIDDEN);
        }
        let path = path.strip_prefix('/').unwrap_or(path);
        let (token, rest) = path.split_once('/').ok_or(StatusCode::NOT_FOUND)?;
        match self.is_token(token) {
            true => Ok(rest),
            false => Err(StatusCode::NOT_FOUND),
        }
    }

    /// Whether the browser asks this server by its own name, for a page of its own. A name of another site that leads to this
    /// machine is thus refused, and so is a request that a page of another site makes.
    fn comes_from_here(&self, headers: &HeaderMap) -> bool {
        let host = only(headers, &HOST);
        let is_host = |name: &str| self.hosts.iter().any(|known| known == name);
        let is_own = |origin: &str| origin.strip_prefix("http://").is_some_and(is_host);
        let site = only(headers, &FETCH_SITE);
        matches!(host, Given::Once(host) if is_host(host))
            && match only(headers, &ORIGIN) {
                Given::Once(origin) => is_own(origin),
                Given::Not => true,
                Given::Unclear => false,
            }
            && matches!(
                site,
                Given::Not | Given::Once("same-origin") | Given::Once("none")
            )
    }

    /// Takes the same time for every wrong token of this length.
    fn is_token(&self, token: &str) -> bool {
        let pairs = self.token.bytes().zip(token.bytes());
        let differences = pairs.fold(0, |all, (own, given)| all | (own ^ given));
        differences == 0 && token.len() == self.token.len()
    }
}

enum Given<'a> {
    Not,
    Once(&'a str),
    Unclear,
}

fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Given<'a> {
    let mut values = headers.get_all(name).iter();
    match (values.next(), values.next()) {
        (None, _) => Given::Not,
        (Some(value), None) => value.to_str().map_or(Given::Unclear, Given::Once),
        (Some(_), Some(_)) => Given::Unclear,
    }
}
