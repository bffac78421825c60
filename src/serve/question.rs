//! Parses requests to the endpoint: the three query operations of the SPARQL 1.1 Protocol (2.1).

/// The relevant parts of a request.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Parts<'a> {
    pub method: &'a str,
    /// The part of the request target after `?`.
    pub query: Option<&'a str>,
    pub content_type: Option<&'a str>,
    pub body: &'a [u8],
}

/// An error response: status and reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Refusal {
    pub status: u16,
    pub why: String,
}

impl Refusal {
    pub fn new(status: u16, why: impl Into<String>) -> Self {
        Self {
            status,
            why: why.into(),
        }
    }
}

/// Returns the text of the query.
pub(super) fn question(parts: &Parts<'_>) -> Result<String, Refusal> {
    let in_target = || pairs(parts.query.unwrap_or_default().as_bytes());
    match (parts.method, media_type(parts.content_type).as_str()) {
        ("GET" | "HEAD", _) => only_query(in_target()),
        ("POST", "application/x-www-form-urlencoded") => {
            only_query(in_target().into_iter().chain(pairs(parts.body)).collect())
        }
        ("POST", "application/sparql-query") => {
            unknown(&in_target())?;
            let text = std::str::from_utf8(parts.body)
                .map_err(|_| Refusal::new(400, "the query is not UTF-8"))?;
            Ok(text.to_owned())
        }
        ("POST", "application/sparql-update") => Err(update()),
        ("POST", other) => Err(Refusal::new(
            415,
            format!(
                "send queries as application/x-www-form-urlencoded or application/sparql-query, not as `{other}`"
            ),
        )),
        _ => Err(Refusal::new(405, "send queries by GET or POST")),
    }
}

/// The media type in lower case, without its parameters.
fn media_type(header: Option<&str>) -> String {
    header
        .unwrap_or_default()
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase()
}

fn pairs(encoded: &[u8]) -> Vec<(String, String)> {
    form_urlencoded::parse(encoded).into_owned().collect()
}

fn only_query(pairs: Vec<(String, String)>) -> Result<String, Refusal> {
    unknown(&pairs)?;
    let mut queries = pairs
        .into_iter()
        .filter(|(name, _)| name == "query")
        .map(|(_, value)| value);
    match (queries.next(), queries.next()) {
        (Some(query), None) => Ok(query),
        (None, _) => Err(Refusal::new(400, "the parameter `query` is missing")),
        (Some(_), Some(_)) => Err(Refusal::new(400, "the parameter `query` must occur once")),
    }
}

/// Rejects unsupported parameters that would change the meaning of a query. Others are ignored.
fn unknown(pairs: &[(String, String)]) -> Result<(), Refusal> {
    for (name, _) in pairs {
        match name.as_str() {
            "update" | "using-graph-uri" | "using-named-graph-uri" => return Err(update()),
            "default-graph-uri" | "named-graph-uri" => {
                return Err(Refusal::new(
                    400,
                    format!(
                        "`{name}` is not supported: name graphs in the query, with FROM or GRAPH"
                    ),
                ));
            }
            _ => {}
        }
    }
    Ok(())
}

fn update() -> Refusal {
    Refusal::new(403, "the history is read-only: updates are not supported")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(
        method: &str,
        query: Option<&str>,
        content_type: Option<&str>,
        body: &[u8],
    ) -> Result<String, u16> {
        question(&Parts {
            method,
            query,
            content_type,
            body,
        })
        .map_err(|refusal| refusal.status)
    }

    #[test]
    fn a_query_can_be_sent_in_three_ways() {
        let form = Some("application/x-www-form-urlencoded; charset=UTF-8");
        assert_eq!(
            asked("GET", Some("query=ASK%20%7B%7D&format=json"), None, b""),
            Ok("ASK {}".to_owned())
        );
        assert_eq!(
            asked("POST", None, form, b"query=ASK+%7B%7D"),
            Ok("ASK {}".to_owned())
        );
        assert_eq!(
            asked("POST", None, Some("Application/SPARQL-Query"), b"ASK {}"),
            Ok("ASK {}".to_owned())
        );
    }

    #[test]
    fn everything_else_is_refused() {
        let form = Some("application/x-www-form-urlencoded");
        for (status, method, query, content_type, body) in [
            (400, "GET", None, None, &b""[..]),
            (400, "GET", Some("query=a&query=b"), None, b""),
            (
                400,
                "GET",
                Some("query=a&default-graph-uri=http://a"),
                None,
                b"",
            ),
            (
                400,
                "POST",
                Some("named-graph-uri=x"),
                Some("application/sparql-query"),
                b"ASK {}",
            ),
            (
                400,
                "POST",
                None,
                Some("application/sparql-query"),
                b"\xff\xfe",
            ),
            (403, "POST", None, form, b"update=DROP+ALL"),
            (
                403,
                "POST",
                None,
                Some("application/sparql-update"),
                b"DROP ALL",
            ),
            (405, "PUT", Some("query=a"), None, b""),
            (405, "DELETE", None, None, b""),
            (415, "POST", None, Some("text/plain"), b"ASK {}"),
            (415, "POST", None, None, b"ASK {}"),
        ] {
            assert_eq!(
                asked(method, query, content_type, body),
                Err(status),
                "{method} {query:?} {content_type:?}"
            );
        }
        assert_eq!(
            asked("GET", Some("query=%ff%00%"), None, b""),
            Ok("\u{fffd}\0%".to_owned())
        );
    }
}
