//! Access control: rejects requests from pages of other sites, and under unknown host names.

use std::net::IpAddr;

use crate::question::Refusal;

/// The headers that say where a request comes from.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Origin<'a> {
    /// `Host`.
    pub host: Option<&'a str>,
    /// The host of a request target in absolute form.
    pub target_host: Option<&'a str>,
    /// `Origin`: the page that sent a POST or a script's request.
    pub origin: Option<&'a str>,
    /// `Sec-Fetch-Site`: the relation of that page to this server, in the words of a browser.
    pub site: Option<&'a str>,
}

/// Checks the origin of a request.
///
/// The page of another site could make its own name resolve to this machine (DNS rebinding) and
/// then read the responses. Therefore the host must be an IP address, `localhost`, or an allowed
/// name. It could also send requests here whose responses it can't read, but which take time:
/// browsers mark these.
pub(super) fn guard(from: &Origin<'_>, allowed: &[String]) -> Result<(), Refusal> {
    let Some(host) = from.host else {
        return Err(Refusal::new(400, "the header `Host` is missing"));
    };
    for host in [Some(host), from.target_host].into_iter().flatten() {
        if !is_known(name(host), allowed) {
            let why = format!(
                "`{}` is not a name of this server; `--allow-host` adds one",
                name(host)
            );
            return Err(Refusal::new(421, why));
        }
    }
    let same = |origin: &str| {
        origin
            .split_once("://")
            .is_some_and(|(_, of)| of.eq_ignore_ascii_case(host))
    };
    // `none`: the user entered the address.
    if from.origin.is_some_and(|origin| !same(origin))
        || from
            .site
            .is_some_and(|site| !["same-origin", "none"].contains(&site))
    {
        return Err(Refusal::new(
            403,
            "requests from pages of another origin are forbidden",
        ));
    }
    Ok(())
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
            (
                Some("localhost:7878"),
                Some("http://evil.example"),
                Some(403),
            ),
            (Some("localhost:7878"), Some("null"), Some(403)),
            (
                Some("localhost:7878"),
                Some("http://localhost:1"),
                Some(403),
            ),
        ] {
            let from = Origin {
                host,
                origin,
                ..Origin::default()
            };
            let refused = guard(&from, &allowed).err().map(|refusal| refusal.status);
            assert_eq!(refused, status, "{host:?} {origin:?}");
        }
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        for (site, target_host, status) in [
            (None, None, None),
            (Some("none"), None, None),
            (Some("same-origin"), Some("localhost:7878"), None),
            (Some("same-site"), None, Some(403)),
            (Some("cross-site"), None, Some(403)),
            (Some("anything"), None, Some(403)),
            (None, Some("evil.example"), Some(421)),
        ] {
            let from = Origin {
                host: Some("localhost:7878"),
                target_host,
                site,
                ..Origin::default()
            };
            let refused = guard(&from, &[]).err().map(|refusal| refusal.status);
            assert_eq!(refused, status, "{site:?} {target_host:?}");
        }
    }
}
