//! The most that a rule text may hold, so that everything behind the parser stays fast and shallow on any input.
//!
//! Each is far out of a sound rule's way; what is above it gets a fault that names it.

/// Larger texts are refused. Unit: bytes. (The largest rule file we know of is a hundredth of it.)
pub(crate) const SIZE_LIMIT: usize = 32 << 20;
/// Faults noted per file by each stage; more help nobody.
pub(crate) const FAULT_LIMIT: usize = 50;
/// Warnings noted in all.
pub(crate) const WARNING_LIMIT: usize = 200;
/// Prefixes of one file.
pub(crate) const PREFIX_LIMIT: usize = 1_000;
/// Rules of a property's file or a library; programs of their own may have more.
pub(crate) const RULE_LIMIT: usize = 20_000;
/// Conditions of one rule.
pub(crate) const LITERAL_LIMIT: usize = 256;
/// Variables of one rule, those among them that stand for a computed argument.
pub(crate) const VARIABLE_LIMIT: usize = 1_024;
/// Arguments of one function or atom, as they are written.
pub(crate) const ARGUMENT_LIMIT: usize = 1_024;
/// Predicates shown of a cycle.
pub(crate) const CYCLE_SHOWN: usize = 12;
