//! Table of the built-ins: name, number of arguments, function.

use crate::builtins::{Value, bits, dates, geometry, hashes, numeric, text, types};
use crate::model::values::text_len;
use crate::watch::Watch;
use actcheck_base::Term;

/// A built-in function.
pub(crate) struct Builtin {
    /// Name as written in messages.
    pub(crate) name: &'static str,
    /// Minimum number of arguments.
    pub(crate) min_args: usize,
    /// Maximum number of arguments.
    pub(crate) max_args: usize,
    apply: Apply,
}

/// A function. Returns `None` if the arguments are outside its domain.
#[derive(Clone, Copy)]
enum Apply {
    /// Takes time linear in the texts.
    Plain(fn(&[Value<'_>]) -> Option<Term>),
    /// May take long, so that it checks the clock; also `None` if the budget is spent.
    Watched(fn(&[Value<'_>], &Watch) -> Option<Term>),
}

/// Shorter texts are not accounted for.
const SHORT: usize = 256;

/// A function makes texts of at most this many times the length of its arguments: a byte becomes
/// `%2F`.
const GROWTH: usize = 3;

impl Builtin {
    /// Computes the function. Returns `None` if the arguments are outside its domain, or if the
    /// budget is spent.
    pub(crate) fn call(&self, args: &[Value<'_>], watch: &Watch) -> Option<Term> {
        let length: usize = args.iter().map(|arg| text_len(arg)).sum();
        if length > SHORT {
            watch.make(length.saturating_mul(GROWTH))?;
        }
        match self.apply {
            Apply::Plain(function) => function(args),
            Apply::Watched(function) => function(args, watch),
        }
    }
}

impl std::fmt::Debug for Builtin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

const MANY: usize = usize::MAX;

const fn entry(
    name: &'static str,
    min_args: usize,
    max_args: usize,
    apply: fn(&[Value<'_>]) -> Option<Term>,
) -> Builtin {
    Builtin {
        name,
        min_args,
        max_args,
        apply: Apply::Plain(apply),
    }
}

const fn watched(
    name: &'static str,
    min_args: usize,
    max_args: usize,
    apply: fn(&[Value<'_>], &Watch) -> Option<Term>,
) -> Builtin {
    Builtin {
        name,
        min_args,
        max_args,
        apply: Apply::Watched(apply),
    }
}

/// Every built-in. The first six are also written as operators.
static BUILTINS: [Builtin; 109] = [
    entry("SUM", 1, MANY, numeric::sum),
    entry("MINUS", 2, 2, numeric::minus),
    entry("PRODUCT", 1, MANY, numeric::product),
    entry("DIVISION", 2, 2, numeric::division),
    entry("INVERSE", 1, 1, numeric::inverse),
    entry("NEGATIVE", 1, 1, numeric::inverse),
    entry("ABS", 1, 1, numeric::abs),
    entry("SQRT", 1, 1, numeric::sqrt),
    entry("POW", 2, 2, numeric::pow),
    entry("LOG", 2, 2, numeric::log),
    entry("SIN", 1, 1, numeric::sin),
    entry("COS", 1, 1, numeric::cos),
    entry("TAN", 1, 1, numeric::tan),
    entry("ASIN", 1, 1, numeric::asin),
    entry("ACOS", 1, 1, numeric::acos),
    entry("ATAN2", 2, 2, numeric::atan2),
    entry("ROUND", 1, 1, numeric::round),
    entry("CEIL", 1, 1, numeric::ceil),
    entry("FLOOR", 1, 1, numeric::floor),
    entry("REM", 2, 2, numeric::rem),
    entry("MIN", 1, MANY, numeric::min),
    entry("MAX", 1, MANY, numeric::max),
    entry("LUKA", 1, MANY, numeric::lukasiewicz),
    entry("NUMGREATER", 2, 2, |a| numeric::ordered(a, |o| o.is_gt())),
    entry("NUMGREATEREQ", 2, 2, |a| numeric::ordered(a, |o| o.is_ge())),
    entry("NUMLESS", 2, 2, |a| numeric::ordered(a, |o| o.is_lt())),
    entry("NUMLESSEQ", 2, 2, |a| numeric::ordered(a, |o| o.is_le())),
    entry("EQUALITY", 2, 2, |a| {
        Some(Term::Boolean(numeric::equal(&a[0], &a[1])))
    }),
    entry("UNEQUALITY", 2, 2, |a| {
        Some(Term::Boolean(!numeric::equal(&a[0], &a[1])))
    }),
    entry("AND", 1, MANY, types::and),
    entry("OR", 1, MANY, types::or),
    entry("NOT", 1, 1, types::not),
    entry("BITAND", 1, MANY, bits::and),
    entry("BITOR", 1, MANY, bits::or),
    entry("BITXOR", 1, MANY, bits::xor),
    entry("BITSHL", 2, 2, bits::shl),
    entry("BITSHR", 2, 2, bits::shr),
    entry("BITSHRU", 2, 2, bits::shru),
    entry("STR", 1, 1, types::str),
    entry("FULLSTR", 1, 1, types::full_str),
    entry("CONCAT", 1, MANY, text::concat),
    entry("CONTAINS", 2, 2, text::contains),
    entry("COMPARE", 2, 2, text::compare),
    entry("SUBSTR", 2, 3, text::substr),
    entry("STRLEN", 1, 1, text::strlen),
    entry("STRREV", 1, 1, text::strrev),
    entry("STRSTARTS", 2, 2, text::starts),
    entry("STRENDS", 2, 2, text::ends),
    entry("STRBEFORE", 2, 2, text::before),
    entry("STRAFTER", 2, 2, text::after),
    watched("REGEX", 2, 3, text::regex),
    watched("LEVENSHTEIN", 2, 2, text::levenshtein),
    entry("UCASE", 1, 1, text::ucase),
    entry("LCASE", 1, 1, text::lcase),
    entry("URIENCODE", 1, 1, text::uri_encode),
    entry("URIDECODE", 1, 1, text::uri_decode),
    entry("INT", 1, 1, types::int),
    entry("DOUBLE", 1, 1, types::double),
    entry("FLOAT", 1, 1, types::float),
    entry("IRI", 1, 1, types::iri),
    entry("DATATYPE", 1, 1, types::datatype),
    entry("CANONICALVALUE", 1, 1, types::canonical),
    entry("LANG", 1, 1, types::lang),
    entry("STRLANG", 2, 2, types::str_lang),
    entry("isNumeric", 1, 1, types::is_numeric),
    entry("isInteger", 1, 1, types::is_integer),
    entry("isFloat", 1, 1, types::is_float),
    entry("isDouble", 1, 1, types::is_double),
    entry("isString", 1, 1, types::is_string),
    entry("isIri", 1, 1, types::is_iri),
    entry("isNull", 1, 1, types::is_null),
    entry("isBlank", 1, 1, types::is_null),
    entry("isBoolean", 1, 1, types::is_boolean),
    entry("isLiteral", 1, 1, types::is_literal),
    entry("isOfDatatype", 2, 2, types::is_of_datatype),
    entry("geo3d:distance", 6, 6, geometry::distance),
    entry("geo3d:distance2d", 4, 4, geometry::distance2d),
    entry("geo3d:norm", 3, 3, geometry::norm),
    entry("geo3d:dot", 6, 6, geometry::dot),
    entry("geo3d:angle", 6, 6, geometry::angle),
    entry("geo3d:angleDifference", 2, 2, geometry::angle_difference),
    entry("geo3d:rotation", 8, 8, geometry::rotation),
    entry("geo3d:yaw", 4, 4, geometry::yaw),
    entry("geo3d:tilt", 4, 4, geometry::tilt),
    entry("geo3d:insideBox", 9, 9, geometry::inside_box),
    entry("geo3d:boxDistance", 12, 12, geometry::box_distance),
    entry("geo3d:boxesOverlap", 12, 12, geometry::boxes_overlap),
    entry("geo3d:overlapArea", 8, 8, geometry::overlap_area),
    entry("geo3d:degrees", 1, 1, geometry::degrees),
    watched("REPLACE", 3, 4, text::replace),
    entry("TRIM", 1, 1, text::trim),
    entry("LTRIM", 1, 1, text::ltrim),
    entry("RTRIM", 1, 1, text::rtrim),
    entry("STRDT", 2, 2, types::str_dt),
    entry("LANGMATCHES", 2, 2, types::lang_matches),
    entry("YEAR", 1, 1, dates::year),
    entry("MONTH", 1, 1, dates::month),
    entry("DAY", 1, 1, dates::day),
    entry("HOURS", 1, 1, dates::hours),
    entry("MINUTES", 1, 1, dates::minutes),
    entry("SECONDS", 1, 1, dates::seconds),
    entry("TIMEZONE", 1, 1, dates::timezone),
    entry("TZ", 1, 1, dates::tz),
    entry("MD5", 1, 1, hashes::md5),
    entry("SHA1", 1, 1, hashes::sha1),
    entry("SHA256", 1, 1, hashes::sha256),
    entry("SHA384", 1, 1, hashes::sha384),
    entry("SHA512", 1, 1, hashes::sha512),
    entry("SAMETERM", 2, 2, |a| {
        Some(Term::Boolean(numeric::equal(&a[0], &a[1])))
    }),
];

/// Other names of built-ins, which Nemo uses.
const ALIASES: [(&str, &str); 2] = [("INVERTSIGN", "INVERSE"), ("SUBTRACTION", "MINUS")];

/// The names of these functions are common words, so that predicates may have them in another case.
const COMMON: [&str; 9] = [
    "REPLACE", "TRIM", "YEAR", "MONTH", "DAY", "HOURS", "MINUTES", "SECONDS", "TIMEZONE",
];

/// Finds a built-in by name, ignoring case; geometry functions by their full IRI. Returns `None` if
/// it is unknown.
pub(crate) fn builtin(name: &str) -> Option<&'static Builtin> {
    if let Some(local) = name.strip_prefix(geometry::GEO3D) {
        return BUILTINS
            .iter()
            .find(|b| b.name.strip_prefix("geo3d:") == Some(local));
    }
    let alias = ALIASES
        .iter()
        .find(|(alias, _)| alias.eq_ignore_ascii_case(name));
    let name = alias.map_or(name, |(_, name)| name);
    BUILTINS
        .iter()
        .find(|b| b.name.eq_ignore_ascii_case(name) && !b.name.contains(':'))
}

/// Returns whether no predicate of a property may have a name, because a built-in has it.
pub(crate) fn is_reserved(name: &str) -> bool {
    builtin(name).is_some_and(|builtin| builtin.name == name || !COMMON.contains(&builtin.name))
}

/// Returns whether a built-in compares two values as `=` does.
pub(crate) fn is_equality(builtin: &Builtin) -> bool {
    matches!(builtin.name, "EQUALITY" | "SAMETERM")
}

/// Returns all names, for "did you mean".
pub(crate) fn builtin_names() -> impl Iterator<Item = &'static str> + Clone {
    BUILTINS.iter().map(|b| b.name)
}

/// Finds a built-in by the exact name that [`builtin_names`] returns. Returns `None` if it is
/// unknown.
#[cfg(feature = "sparql")]
pub(crate) fn builtin_by_exact_name(name: &str) -> Option<&'static Builtin> {
    BUILTINS.iter().find(|b| b.name == name)
}
