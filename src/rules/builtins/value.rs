//! Arguments and results of built-ins.

use std::borrow::Cow;

use actcheck_base::Term;

/// An argument or result; borrowed if it is an interned term.
pub(crate) type Value<'a> = Cow<'a, Term>;
