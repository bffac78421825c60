//! Content negotiation: the header `Accept` (RFC 9110, 12.5.1).

use actcheck_history::WireSyntax;

/// Returns the offered format with the highest quality; of equal ones, the first. Returns `None` if
/// the client accepts none.
pub(super) fn choose(accept: &str, offered: &[WireSyntax]) -> Option<WireSyntax> {
    let wanted: Vec<(&str, f64)> = accept.split(',').filter_map(range).collect();
    if wanted.is_empty() {
        return offered.first().copied();
    }
    let mut best: Option<(f64, WireSyntax)> = None;
    for syntax in offered {
        let liked = syntax
            .media_types()
            .iter()
            .map(|media_type| quality(media_type, &wanted))
            .fold(0.0, f64::max);
        if liked > 0.0 && best.is_none_or(|(before, _)| liked > before) {
            best = Some((liked, *syntax));
        }
    }
    best.map(|(_, syntax)| syntax)
}

/// Parses a media range and its quality. Returns `None` if it is not a media range.
fn range(item: &str) -> Option<(&str, f64)> {
    let mut parts = item.split(';').map(str::trim);
    let range = parts.next().filter(|range| range.contains('/'))?;
    let quality =
        parts.find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")));
    // An invalid quality is ignored.
    let quality = quality
        .and_then(|text| text.trim().parse::<f64>().ok())
        .filter(|q| (0.0..=1.0).contains(q));
    Some((range, quality.unwrap_or(1.0)))
}

/// The quality of a media type, from the most specific matching range.
fn quality(media_type: &str, wanted: &[(&str, f64)]) -> f64 {
    let (kind, _) = media_type.split_once('/').unwrap_or((media_type, ""));
    let fits = |range: &str| match range.split_once('/') {
        _ if range.eq_ignore_ascii_case(media_type) => 3,
        Some((of, "*")) if of.eq_ignore_ascii_case(kind) => 2,
        Some(("*", "*")) => 1,
        _ => 0,
    };
    let found = wanted
        .iter()
        .map(|(range, quality)| (fits(range), *quality))
        .filter(|(fit, _)| *fit > 0);
    // Of equally specific ranges, the first counts.
    found
        .fold(
            (0, 0.0),
            |best, next| if next.0 > best.0 { next } else { best },
        )
        .1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preferred_media_type_is_sent() {
        for (accept, table, graph) in [
            ("", Some(WireSyntax::Json), Some(WireSyntax::Turtle)),
            ("*/*", Some(WireSyntax::Json), Some(WireSyntax::Turtle)),
            ("text/csv", Some(WireSyntax::Csv), None),
            ("text/*", Some(WireSyntax::Xml), Some(WireSyntax::Turtle)),
            (
                "text/html,application/xml;q=0.9,*/*;q=0.8",
                Some(WireSyntax::Xml),
                Some(WireSyntax::RdfXml),
            ),
            (
                "application/sparql-results+json;q=0.1, TEXT/CSV ; q=0.2",
                Some(WireSyntax::Csv),
                None,
            ),
            (
                "*/*;q=0.5, application/sparql-results+json;q=0",
                Some(WireSyntax::Json),
                Some(WireSyntax::Turtle),
            ),
            (
                "application/n-triples, text/turtle;q=0.5",
                None,
                Some(WireSyntax::NTriples),
            ),
            ("image/png", None, None),
            ("text/csv;q=0", None, None),
            ("nonsense,;;q=,/", None, None),
            ("text/csv;q=NaN", Some(WireSyntax::Csv), None),
        ] {
            assert_eq!(choose(accept, &WireSyntax::TABLES), table, "{accept}");
            assert_eq!(choose(accept, &WireSyntax::GRAPHS), graph, "{accept}");
        }
    }
}
