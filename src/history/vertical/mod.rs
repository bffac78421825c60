//! Statements about outlines by property, and queries that read them so.
//!
//! A store of all statements of a million runs has two hundred million of them, but a query uses a
//! few properties, and joins nearly always stay within one run. So each file of outlines has its
//! statements by property, a query's patterns are evaluated file by file, and only the joined rows,
//! equal ones counted, are given to the evaluator.
//!
//! Never: has an answer of its own; queries that do not fit are left to the store.

mod column;
mod counts;
mod encode;
mod expression;
mod flat;
mod group;
mod join;
mod joined;
mod leaf;
mod need;
mod nodes;
mod plan;
mod reduce;
mod rewrite;
mod scan;
mod sheet;
mod stop;
mod value;
mod walk;

pub(super) use counts::Counts;
pub(super) use encode::encode;
pub(super) use plan::{Plan, plan};
pub(super) use sheet::{CHANGED, Sheet, Source};
pub(super) use stop::Stop;
