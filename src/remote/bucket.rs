//! A bucket of an object storage with the interface of S3.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use rusty_s3::actions::ListObjectsV2;
use rusty_s3::{Bucket as Signer, Credentials, S3Action, UrlStyle};
use ureq::http::Method;
use url::Url;

use crate::Address;
use crate::client::{Client, Content, Request};
use crate::fault::Fault;
use crate::place::BucketSettings;
use crate::response::Response;
use actcheck_base::{Diagnostic, Diagnostics};

/// Time for which a signature is valid: longer than a request with all its tries.
const VALID: Duration = Duration::from_secs(3600);
/// Longest answer that is read into memory. Unit: bytes.
const MOST_READ: u64 = 64 << 20;
/// The region that storages of others usually expect, and Amazon's default.
const USUAL_REGION: &str = "us-east-1";

/// The part of a bucket below a prefix.
pub(crate) struct Bucket {
    client: Client,
    signer: Signer,
    credentials: Option<Credentials>,
    address: Address,
    /// Empty, or ends with `/`.
    prefix: String,
    /// Its name in messages.
    shown: String,
}

impl Bucket {
    /// Opens `BUCKET/PREFIX`.
    pub fn open(
        name: &str,
        settings: &BucketSettings,
        client: Client,
    ) -> Result<Self, Diagnostics> {
        let shown = format!("s3://{name}");
        let wrong = |why: &str| {
            Diagnostic::error("X090", format!("`{shown}` can't be used: {why}"))
                .help("write it as in `s3://BUCKET/PREFIX`, and set AWS_ENDPOINT_URL for storages of others")
        };
        let (bucket, prefix) = name.split_once('/').unwrap_or((name, ""));
        let region = settings
            .region
            .clone()
            .unwrap_or_else(|| USUAL_REGION.to_owned());
        // Storages of others seldom have a name for each bucket.
        let (endpoint, style) = match &settings.endpoint {
            Some(endpoint) => (endpoint.clone(), UrlStyle::Path),
            None => (
                format!("https://s3.{region}.amazonaws.com"),
                UrlStyle::VirtualHost,
            ),
        };
        let address = Address::parse(&endpoint)?;
        let url = Url::parse(&endpoint).map_err(|error| wrong(&format!("{endpoint}: {error}")))?;
        if bucket.is_empty() {
            return Err(wrong("it names no bucket").into());
        }
        let signer = Signer::new(url, style, bucket.to_owned(), region)
            .map_err(|error| wrong(&format!("{endpoint}: {error}")))?;
        let credentials = settings
            .keys
            .as_ref()
            .map(|(key, secret)| match &settings.token {
                Some(token) => Credentials::new_with_token(key, secret, token),
                None => Credentials::new(key, secret),
            });
        let prefix = prefix.trim_matches('/');
        let prefix = if prefix.is_empty() {
            String::new()
        } else {
            format!("{prefix}/")
        };
        Ok(Self {
            client,
            signer,
            credentials,
            address,
            prefix,
            shown,
        })
    }

    pub fn list(&self) -> Result<BTreeMap<String, u64>, Diagnostics> {
        let (mut found, mut next) = (BTreeMap::new(), None);
        loop {
            let mut action = self.signer.list_objects_v2(self.credentials.as_ref());
            action.with_prefix(self.prefix.as_str());
            if let Some(next) = next.take() {
                action.with_continuation_token(String::from(next));
            }
            let target = action.sign(VALID).into();
            let body = self
                .body(target)
                .map_err(|fault| self.fault(fault, "listing"))?;
            let text = String::from_utf8_lossy(&body);
            let page = ListObjectsV2::parse_response(&text)
                .map_err(|error| self.malformed(&error.to_string()))?;
            for object in page.contents {
                if let Some(name) = object
                    .key
                    .strip_prefix(&self.prefix)
                    .filter(|name| !name.is_empty())
                {
                    found.insert(name.to_owned(), object.size.unwrap_or_default());
                }
            }
            next = page.next_continuation_token;
            if next.is_none() {
                return Ok(found);
            }
        }
    }

    pub fn put_file(&self, name: &str, from: &Path) -> Result<(), Diagnostics> {
        self.put_content(name, Content::File(from))
    }

    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), Diagnostics> {
        self.put_content(name, Content::Bytes(bytes))
    }

    fn put_content(&self, name: &str, content: Content<'_>) -> Result<(), Diagnostics> {
        let key = self.key(name);
        let target = self
            .signer
            .put_object(self.credentials.as_ref(), &key)
            .sign(VALID)
            .into();
        let sent = self
            .send(Method::PUT, target, content)
            .map(Response::finish);
        sent.map_err(|fault| self.fault(fault, &format!("writing {name}")))
    }

    pub fn get(&self, name: &str) -> Result<Option<Vec<u8>>, Diagnostics> {
        let key = self.key(name);
        let target = self
            .signer
            .get_object(self.credentials.as_ref(), &key)
            .sign(VALID)
            .into();
        match self.body(target) {
            Ok(body) => Ok(Some(body)),
            // Without the right to list, a missing object is 403; then writing fails, too, with its
            // reason.
            Err(Fault::Refused {
                status: 404, words, ..
            }) if !words.contains("NoSuchBucket") => Ok(None),
            Err(fault) => Err(self.fault(fault, &format!("reading {name}"))),
        }
    }

    pub fn remove(&self, name: &str) -> Result<(), Diagnostics> {
        let key = self.key(name);
        let target = self
            .signer
            .delete_object(self.credentials.as_ref(), &key)
            .sign(VALID)
            .into();
        match self
            .send(Method::DELETE, target, Content::None)
            .map(Response::finish)
        {
            Ok(()) | Err(Fault::Refused { status: 404, .. }) => Ok(()),
            Err(fault) => Err(self.fault(fault, &format!("removing {name}"))),
        }
    }

    fn key(&self, name: &str) -> String {
        format!("{}{name}", self.prefix)
    }

    fn send(
        &self,
        method: Method,
        target: String,
        content: Content<'_>,
    ) -> Result<Response, Fault> {
        self.client.send(&Request {
            method,
            address: &self.address,
            target,
            headers: Vec::new(),
            content,
        })
    }

    fn body(&self, target: String) -> Result<Vec<u8>, Fault> {
        let (method, headers) = (Method::GET, Vec::new());
        let request = Request {
            method,
            address: &self.address,
            target,
            headers,
            content: Content::None,
        };
        self.client.body(&request, MOST_READ)
    }

    fn malformed(&self, why: &str) -> Diagnostics {
        Diagnostic::error(
            "X097",
            format!("the answer of {} can't be read: {why}", self.shown),
        )
        .help("check AWS_ENDPOINT_URL: the storage must have the interface of S3")
        .into()
    }

    fn fault(&self, fault: Fault, doing: &str) -> Diagnostics {
        match fault {
            Fault::Refused { status, words, .. } => {
                let words = if words.is_empty() {
                    String::new()
                } else {
                    format!(":\n{words}")
                };
                let message = format!("{} refused {doing} with status {status}{words}", self.shown);
                Diagnostic::error("X097", message)
                    .help("check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL and the rights of the key; then give the same command again: files that are there already are skipped")
                    .into()
            }
            other => other.into_diagnostics(&self.address, doing),
        }
    }
}
