//! Content negotiation: which format and which coding the client prefers.

use axum::http::header::ACCEPT;
use axum::http::{HeaderMap, HeaderName};

use super::words;

/// The items of a list header with their weights (RFC 9110, 12.4.2).
pub fn weighted(headers: &HeaderMap, name: HeaderName) -> Vec<(&str, f64)> {
    let item = |word| {
        let Some((item, parameters)) = str::split_once(word, ';') else { return (word, 1.0) };
        let mut parameters = parameters.split(';').filter_map(|text| text.split_once('='));
        let weight = parameters.find(|(name, _)| name.trim().eq_ignore_ascii_case("q"));
        let weight = weight.and_then(|(_, weight)| weight.trim().parse().ok()).unwrap_or(1.0);
        (item.trim(), weight)
    };
    words(headers, name).filter(|word| !word.is_empty()).map(item).collect()
}

/// The first of the offered items with the largest weight; none if all weights are 0.
pub fn preferred<T: Copy>(offered: &[T], weight: impl Fn(T) -> f64) -> Option<T> {
    let weighted = offered.iter().rev().map(|item| (*item, weight(*item)));
    let accepted = weighted.filter(|(_, weight)| *weight > 0.0);
    accepted.max_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(item, _)| item)
}

/// Chooses one of the offered items by the header `Accept` and their media types; the first is the default.
pub fn choose<T: Copy>(
    headers: &HeaderMap,
    offered: &[T],
    essence: impl Fn(T) -> &'static str,
) -> Option<T> {
    let ranges = weighted(headers, ACCEPT);
    if ranges.is_empty() {
        return offered.first().copied();
    }
    preferred(offered, |item| weight(essence(item), &ranges))
}

/// The weight of a media type: that of the most specific range that contains it.
fn weight(essence: &str, ranges: &[(&str, f64)]) -> f64 {
    let kind = essence.split_once('/').map_or(essence, |(kind, _)| kind);
    let specificity = |(range, _): &&(&str, f64)| match range.strip_suffix("/*") {
        _ if range.eq_ignore_ascii_case(essence) => 3,
        Some("*") => 1,
        Some(range) if range.eq_ignore_ascii_case(kind) => 2,
        _ => 0,
    };
    let best = ranges.iter().rev().max_by_key(specificity);
    best.filter(|range| specificity(range) > 0).map_or(0.0, |(_, weight)| *weight)
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;
    use fretwork_format::Format;

    fn accept(value: &'static str, offered: &[Format]) -> Option<Format> {
        let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(value))]);
        choose(&headers, offered, Format::essence)
    }

    #[test]
    fn the_most_specific_media_range_of_accept_has_priority() {
        let both = [Format::Json, Format::Csv];
        assert_eq!(accept("*/*", &both), Some(Format::Json));
        assert_eq!(accept("text/csv", &both), Some(Format::Csv));
        assert_eq!(accept("text/*, application/json;q=0.5", &both), Some(Format::Csv));
        assert_eq!(accept("application/json;q=0, */*", &both), Some(Format::Csv));
        assert_eq!(accept("image/png", &both), None);
        assert_eq!(accept("text/csv", &both[..1]), None);
        assert_eq!(accept("", &both), Some(Format::Json));
    }

    #[test]
    fn a_media_type_is_chosen_only_if_the_client_prefers_it_to_the_default() {
        let chosen = |value| {
            let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(value))]);
            choose(&headers, &["text/plain", "text/csv"], |it| it).unwrap_or("text/plain")
        };
        for value in ["", "*/*", "text/*", "image/png", "text/csv;q=0.4, text/plain;q=0.5"] {
            assert_eq!(chosen(value), "text/plain", "{value}");
        }
        for value in ["text/csv", "text/csv;version=2,text/csv;version=1;q=0.7,*/*;q=0.1"] {
            assert_eq!(chosen(value), "text/csv", "{value}");
        }
    }
}
