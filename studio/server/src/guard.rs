//! Who may ask: the page that this studio served, and nobody else.
//!
//! A page of another origin can send requests to loopback, by its name or through a name of its own that leads here (DNS
//! rebinding). So a request needs the token, which only the printed address has, the host of this studio, and no other origin.

use tiny_http::{Header, Request};

/// Bytes of the token.
const TOKEN_BYTES: usize = 16;

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// It names another host.
    Host,
    /// A page of another origin sent it.
    Origin,
    /// It does not know the token.
    Token,
}

impl Refused {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Host => "refused: the request names another host than this studio",
            Self::Origin => "refused: the request comes from another page than this studio's",
            Self::Token => {
                "refused: the address needs the token that `formation studio` printed; open the printed address"
            }
        }
    }

    /// The status of the answer.
    pub fn status(self) -> u16 {
        match self {
            Self::Host => 421,
            Self::Origin | Self::Token => 403,
        }
    }
}

/// Knows the token and the names of this studio.
pub struct Guard {
    token: String,
    hosts: [String; 2],
}

impl Guard {
    /// Draws a token.
    pub fn new(port: u16) -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self {
            token: bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
            hosts: ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}")),
        })
    }

    /// The address of the page.
    pub fn address(&self) -> String {
        format!("http://{}/{}/", self.hosts[0], self.token)
    }

    /// What a request asks for below the token, without what follows a question mark, and that.
    ///
    /// # Errors
    /// The request comes from elsewhere.
    pub fn admit(&self, request: &Request) -> Result<(String, String), Refused> {
        let header = |name| values(request.headers(), name);
        self.judge(
            request.url(),
            &header("Host"),
            &header("Origin"),
            &header("Sec-Fetch-Site"),
        )
    }

    fn judge(
        &self,
        url: &str,
        host: &[String],
        origin: &[String],
        site: &[String],
    ) -> Result<(String, String), Refused> {
        let is_ours = |name: &str| self.hosts.iter().any(|host| host == name);
        match host {
            [host] if is_ours(host) => {}
            _ => return Err(Refused::Host),
        }
        let from_here = |origin: &String| origin.strip_prefix("http://").is_some_and(is_ours);
        let site_is_ours = |site: &String| matches!(site.as_str(), "same-origin" | "none");
        if !(origin.iter().all(from_here) && site.iter().all(site_is_ours)) {
            return Err(Refused::Origin);
        }
        let (path, query) = url.split_once('?').unwrap_or((url, ""));
        let below = path.strip_prefix('/').and_then(|path| path.split_once('/'));
        match below {
            Some((token, below)) if is_equal(token, &self.token) => {
                Ok((below.to_owned(), query.to_owned()))
            }
            _ => Err(Refused::Token),
        }
    }
}

fn values(headers: &[Header], name: &'static str) -> Vec<String> {
    let named = headers.iter().filter(|header| header.field.equiv(name));
    named.map(|header| header.value.to_string()).collect()
}

/// Compares in a time that depends on the lengths alone.
fn is_equal(one: &str, other: &str) -> bool {
    let differences = one
        .bytes()
        .zip(other.bytes())
        .fold(0, |all, (a, b)| all | (a ^ b));
    one.len() == other.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_page_of_this_studio_is_admitted() {
        let guard = Guard::new(4000).unwrap();
        let token = guard.token.clone();
        let path = format!("/{token}/api/run?from=3");
        let judge = |url: &str, host: &[&str], origin: &[&str], site: &[&str]| {
            let owned = |list: &[&str]| list.iter().map(|it| (*it).to_owned()).collect::<Vec<_>>();
            guard.judge(url, &owned(host), &owned(origin), &owned(site))
        };
        let ours = ["127.0.0.1:4000"];
        let admitted = Ok(("api/run".to_owned(), "from=3".to_owned()));
        assert_eq!(judge(&path, &ours, &[], &[]), admitted);
        assert_eq!(
            judge(
                &path,
                &["localhost:4000"],
                &["http://localhost:4000"],
                &["same-origin"]
            ),
            admitted
        );
        for host in [
            &[][..],
            &["evil.example:4000"],
            &["127.0.0.1"],
            &["127.0.0.1:4000", "a"],
        ] {
            assert_eq!(judge(&path, host, &[], &[]), Err(Refused::Host), "{host:?}");
        }
        for origin in [
            "http://evil.example",
            "null",
            "https://127.0.0.1:4000",
            "http://127.0.0.1:4001",
        ] {
            assert_eq!(
                judge(&path, &ours, &[origin], &[]),
                Err(Refused::Origin),
                "{origin}"
            );
        }
        assert_eq!(
            judge(&path, &ours, &[], &["cross-site"]),
            Err(Refused::Origin)
        );
        for url in [
            "/",
            "/api/run",
            &format!("/{}/", token.to_uppercase()),
            &format!("/{token}"),
        ] {
            assert_eq!(judge(url, &ours, &[], &[]), Err(Refused::Token), "{url}");
        }
        assert_ne!(Guard::new(4000).unwrap().token, token);
    }
}
