//! Size limits of rule texts, so that the stages after the parser stay fast and their recursion
//! shallow on any input.
//!
//! Each limit is far above realistic rules. Exceeding one is reported as an error that names the
//! limit.

/// Maximum size of a text. Unit: bytes. (The largest rule file we know of is a hundredth of it.)
pub(crate) const SIZE_LIMIT: usize = 32 << 20;
/// Maximum number of errors reported per file by each stage; more would not help.
pub(crate) const FAULT_LIMIT: usize = 50;
/// Maximum number of warnings in total.
pub(crate) const WARNING_LIMIT: usize = 200;
/// Maximum number of prefixes in one file.
pub(crate) const PREFIX_LIMIT: usize = 1_000;
/// Maximum number of rules in a property's file or a library; standalone programs may have more.
pub(crate) const RULE_LIMIT: usize = 20_000;
/// Maximum number of conditions in one rule.
pub(crate) const LITERAL_LIMIT: usize = 256;
/// Maximum number of variables in one rule, including generated ones.
pub(crate) const VARIABLE_LIMIT: usize = 1_024;
/// Maximum number of arguments of one function or atom, as written.
pub(crate) const ARGUMENT_LIMIT: usize = 1_024;
/// Maximum number of predicates shown in a cycle.
pub(crate) const CYCLE_SHOWN: usize = 12;
