//! Encryption, in builds that have it.

use std::sync::Arc;

use rustls::crypto::ring;
use ureq::tls::{Certificate, RootCerts, TlsConfig};

/// Trusts the certificates of the system, or those of the file that the environment variable
/// `SSL_CERT_FILE` names.
pub(crate) fn config() -> TlsConfig {
    let known = rustls_native_certs::load_native_certs().certs;
    let certificates: Vec<Certificate<'static>> = known
        .iter()
        .map(|certificate| Certificate::from_der(certificate).to_owned())
        .collect();
    TlsConfig::builder()
        .root_certs(RootCerts::from(certificates))
        .unversioned_rustls_crypto_provider(Arc::new(ring::default_provider()))
        .build()
}
