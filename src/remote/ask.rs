//! Queries.

use std::io::Read;

use ureq::http::Method;

use crate::Address;
use crate::client::{Client, Request};
use crate::fault::Fault;
use actcheck_base::Diagnostics;

/// The formats that are understood, the best first: tables, then graphs.
const ACCEPTED: &str = "application/sparql-results+json, application/sparql-results+xml;q=0.8, \
                        text/tab-separated-values;q=0.7, application/n-triples;q=0.9, text/turtle;q=0.6, \
                        application/rdf+xml;q=0.5";

/// An answer whose body is read while it arrives.
pub struct Answer {
    /// Its media type in lower case, without parameters.
    pub media_type: String,
    /// Its body.
    pub body: Box<dyn Read + Send>,
}

/// Sends a query to a SPARQL endpoint.
///
/// # Errors
/// `X091`, `X092`, `X093`: there is no answer; the faults of `is_wrong`, which is asked if the
/// server calls the query malformed.
pub fn ask(
    client: &Client,
    address: &Address,
    query: &str,
    is_wrong: impl FnOnce() -> Result<(), Diagnostics>,
) -> Result<Answer, Diagnostics> {
    let form = form_urlencoded::Serializer::new(String::new())
        .append_pair("query", query)
        .finish();
    let request = Request {
        method: Method::POST,
        address,
        target: address.to_string(),
        headers: vec![
            (
                "content-type",
                "application/x-www-form-urlencoded".to_owned(),
            ),
            ("accept", ACCEPTED.to_owned()),
        ],
        content: form.as_bytes(),
    };
    match client.send(&request) {
        Ok(response) => Ok(Answer {
            media_type: response.media_type(),
            body: Box::new(response.into_reader()),
        }),
        Err(fault) => {
            if matches!(fault, Fault::Refused { status: 400, .. }) {
                is_wrong()?;
            }
            Err(fault.into_diagnostics(address, "the query"))
        }
    }
}
