//! Hashes of texts in hexadecimal digits: <https://www.w3.org/TR/sparql11-query/#func-hash>.

use std::fmt::Write as _;

use md5::Md5;
use sha1::Sha1;
use sha2::digest::Digest;
use sha2::{Sha256, Sha384, Sha512};

use crate::builtins::Value;
use actcheck_base::Term;

fn hash<D: Digest>(args: &[Value<'_>]) -> Option<Term> {
    let Term::String(text) = args[0].as_ref() else {
        return None;
    };
    let digits = D::digest(text.as_bytes())
        .iter()
        .fold(String::new(), |mut digits, byte| {
            // Writing to a string never fails.
            let _ = write!(digits, "{byte:02x}");
            digits
        });
    Some(Term::string(digits))
}

pub(super) fn md5(args: &[Value<'_>]) -> Option<Term> {
    hash::<Md5>(args)
}

pub(super) fn sha1(args: &[Value<'_>]) -> Option<Term> {
    hash::<Sha1>(args)
}

pub(super) fn sha256(args: &[Value<'_>]) -> Option<Term> {
    hash::<Sha256>(args)
}

pub(super) fn sha384(args: &[Value<'_>]) -> Option<Term> {
    hash::<Sha384>(args)
}

pub(super) fn sha512(args: &[Value<'_>]) -> Option<Term> {
    hash::<Sha512>(args)
}
