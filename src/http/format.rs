//! The forms in which a document can be had, and which of them a request takes.

use axum::http::HeaderMap;
use axum::http::header::ACCEPT;

use super::wire::words;

/// A form in which a document can be had.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `application/json`.
    Json,
    /// `application/x-ndjson`: one JSON object per line.
    Ndjson,
    /// `text/csv`: comment lines (`#`), one header row, `,` and `\n`.
    Csv,
    /// `application/x-npz`: an archive of NumPy arrays.
    Npz,
    /// `application/vnd.apache.arrow.file`: an Arrow IPC file, also known as Feather.
    Arrow,
    /// `application/vnd.fretwork.differences+json`: JSON whose matrices take few bytes.
    Differences,
    /// `image/svg+xml`: of figures alone.
    Svg,
}

impl Format {
    /// Every format of tables, the default first.
    pub const ALL: [Self; 6] =
        [Self::Json, Self::Ndjson, Self::Csv, Self::Npz, Self::Arrow, Self::Differences];

    /// The word in `?format=`, and the end of a file's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Json => "json",
            Self::Ndjson => "ndjson",
            Self::Csv => "csv",
            Self::Npz => "npz",
            Self::Arrow => "arrow",
            Self::Differences => "differences",
            Self::Svg => "svg",
        }
    }

    /// The value of `Content-Type`.
    #[must_use]
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Ndjson => "application/x-ndjson",
            Self::Csv => "text/csv; charset=utf-8",
            Self::Npz => "application/x-npz",
            Self::Arrow => "application/vnd.apache.arrow.file",
            Self::Differences => "application/vnd.fretwork.differences+json",
            Self::Svg => "image/svg+xml",
        }
    }

    /// Whether it is made for programs that open files: a browser saves it instead of showing it.
    #[must_use]
    pub fn is_file(self) -> bool {
        matches!(self, Self::Csv | Self::Npz | Self::Arrow)
    }

    /// Chooses among the formats `offered` (the first is the default) by `?format=`, else by
    /// `Accept`. `None`: there is nothing the client would take.
    pub fn choose(asked: Option<Self>, headers: &HeaderMap, offered: &[Self]) -> Option<Self> {
        if let Some(asked) = asked {
            return offered.contains(&asked).then_some(asked);
        }
        let accept: Vec<&str> = words(headers, ACCEPT).filter(|range| !range.is_empty()).collect();
        if accept.is_empty() {
            return offered.first().copied();
        }
        let mut best = (0.0, None);
        for &format in offered {
            let quality = format.quality(&accept);
            if quality > best.0 {
                best = (quality, Some(format));
            }
        }
        best.1
    }

    /// The weight that the most specific matching range gives this format; 0 if none matches.
    fn quality(self, accept: &[&str]) -> f64 {
        let essence = self.media_type().split(';').next().unwrap_or_default();
        let mut best = (0, 0.0);
        for range in accept {
            let mut parts = range.split(';').map(str::trim);
            let name = parts.next().unwrap_or_default().to_ascii_lowercase();
            let specific = match name.strip_suffix("/*") {
                _ if name == essence => 3,
                Some("*") => 1,
                Some(kind) if essence.split('/').next() == Some(kind) => 2,
                _ => continue,
            };
            let weight = parts
                .find_map(|parameter| parameter.strip_prefix("q=")?.parse::<f64>().ok())
                .unwrap_or(1.0);
            if specific > best.0 {
                best = (specific, weight);
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    fn accept(value: &'static str, offered: &[Format]) -> Option<Format> {
        let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(value))]);
        Format::choose(None, &headers, offered)
    }

    #[test]
    fn the_most_specific_range_of_an_accept_header_decides() {
        let both = [Format::Json, Format::Csv];
        assert_eq!(accept("*/*", &both), Some(Format::Json));
        assert_eq!(accept("text/csv", &both), Some(Format::Csv));
        assert_eq!(accept("text/*, application/json;q=0.5", &both), Some(Format::Csv));
        assert_eq!(accept("application/json;q=0, */*", &both), Some(Format::Csv));
        assert_eq!(accept("image/png", &both), None);
        assert_eq!(accept("text/csv", &both[..1]), None);
        assert_eq!(accept("", &both), Some(Format::Json));
    }
}
