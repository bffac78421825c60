//! Access control: rejects requests from pages of other sites, and under unknown host names.

use std::net::IpAddr;

use crate::question::Refusal;

/// Checks the headers `Host` and `Origin`.
///
/// The page of another site could make its own name resolve to this machine (DNS rebinding) and then read the
/// responses. Therefore the host must be an IP address, `localhost`, or an allowed name.
pub(super) fn guard(host: Option<&str>, origin: Option<&str>, allowed: &[String]) -> Result<(), Refusal> {
    let Some(host) = host else { return Err(Refusal::new(400, "the header `Host` is missing")) };
    if !is_known(name(host), allowed) {
        let why = format!("`{}` is not a name of this server; `--allow-host` adds one", name(host));
        return Err(Refusal::new(421, why));
    }
    match origin {
        None => Ok(()),
        Some(origin) if origin.split_once("://").is_some_and(|(_, of)| of.eq_ignore_ascii_case(host)) => Ok(()),
        Some(_) => Err(Refusal::new(403, "requests from pages of another origin are forbidden")),
    }
}

/// The host without its port.
fn name(host: &str) -> &str {
    if let Some((address, _)) = host.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        return address;
    }
    host.rsplit_once(':').map_or(host, |(name, _)| name)
}

fn is_known(name: &str, allowed: &[String]) -> bool {
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok()
        || allowed.iter().any(|known| known.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_host_names_are_refused() {
        let allowed = ["robot.lab".to_owned()];
        for (host, origin, status) in [
            (Some("localhost:7878"), None, None),
            (Some("127.0.0.1"), None, None),
            (Some("[::1]:80"), Some("http://[::1]:80"), None),
            (Some("Robot.Lab:1"), Some("http://robot.lab:1"), None),
            (Some("evil.example:7878"), None, Some(421)),
            (Some("localhost.evil.example"), None, Some(421)),
            (Some("127.0.0.1.evil.example"), None, Some(421)),
            (Some(""), None, Some(421)),
            (None, None, Some(400)),
            (Some("localhost:7878"), Some("http://evil.example"), Some(403)),
            (Some("localhost:7878"), Some("null"), Some(403)),
            (Some("localhost:7878"), Some("http://localhost:1"), Some(403)),
        ] {
            let refused = guard(host, origin, &allowed).err().map(|refusal| refusal.status);
            assert_eq!(refused, status, "{host:?} {origin:?}");
        }
    }
}
