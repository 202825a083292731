//! Keys of a TOML file by their path, `outage[2].end_s`: where a path is written, and the path of what is
//! written somewhere. Entries of lists of tables are counted from 1.

use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

type Value<'a> = Spanned<DeValue<'a>>;

/// Path of the key, or of the table, that a span lies in; empty for the file itself.
pub(super) fn path_at(table: &DeTable<'_>, span: &Range<usize>) -> String {
    within(table, "", span).unwrap_or_default()
}

/// Path of the innermost key of a table that a span lies in.
///
/// The span of a table under a head is the head alone, so every table is searched.
fn within(table: &DeTable<'_>, path: &str, span: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let path = dotted(path, key.get_ref());
        let is_key = key.span() == *span;
        if is_key { Some(path) } else { within_value(value, path, span) }
    })
}

fn within_value(value: &Value<'_>, path: String, span: &Range<usize>) -> Option<String> {
    let inner = match value.get_ref() {
        DeValue::Table(table) => within(table, &path, span),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
            let is_table = item.get_ref().is_table();
            is_table.then(|| within_value(item, format!("{path}[{}]", i + 1), span)).flatten()
        }),
        _ => None,
    };
    let extent = value.span();
    inner.or_else(|| (extent.start <= span.start && span.end <= extent.end).then_some(path))
}

/// Where the value of a path is written, and whether it is: if not, the span of the innermost table around it.
pub(super) fn span_of(table: &DeTable<'_>, path: &str) -> (Range<usize>, bool) {
    let (mut table, mut span) = (Some(table), 0..0);
    for part in path.split('.') {
        let (key, entry) = part.split_once('[').map_or((part, None), |(key, entry)| (key, Some(entry)));
        let Some(value) = table.and_then(|table| table.get(key)) else { return (span, false) };
        let entry = entry.and_then(|i| i.trim_end_matches(']').parse::<usize>().ok()?.checked_sub(1));
        let value = entry.and_then(|i| value.get_ref().as_array()?.get(i)).unwrap_or(value);
        (table, span) = (value.get_ref().as_table(), value.span());
    }
    (span, true)
}

/// A key with the path of its table before it.
pub(super) fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "runs = 3\n[gnss]\nsigma = [1,\n 2]\n[[outage]]\nend_s = 1\n[[outage]]\nend_s = 2\n\
                        [[scenario]]\nsettings.gnss.rate_hz = -1\n[[scenario]]\nsettings = { gnss = { rate_hz = -2 } }\n";

    #[test]
    fn path_and_span_are_inverse() {
        let table = DeTable::parse(TEXT).unwrap();
        for (path, written) in [
            ("runs", "3"),
            ("gnss", "[gnss]"),
            ("gnss.sigma", "[1,\n 2]"),
            ("outage[1].end_s", "1"),
            ("outage[2].end_s", "2"),
            ("outage[2]", "[[outage]]"),
            ("scenario[1].settings.gnss.rate_hz", "-1"),
            ("scenario[2].settings.gnss.rate_hz", "-2"),
            ("scenario[2].settings.gnss", "{ rate_hz = -2 }"),
        ] {
            let (span, is_set) = span_of(table.get_ref(), path);
            assert_eq!((&TEXT[span.clone()], is_set), (written, true), "{path}");
            assert_eq!(path_at(table.get_ref(), &span), path);
        }
    }

    #[test]
    fn what_is_not_set_lies_in_the_innermost_table_that_is() {
        let table = DeTable::parse(TEXT).unwrap();
        for (path, written) in
            [("imu.rate_hz", ""), ("gnss.rate_hz", "[gnss]"), ("outage[2].start_s", "[[outage]]")]
        {
            let (span, is_set) = span_of(table.get_ref(), path);
            assert_eq!((&TEXT[span], is_set), (written, false), "{path}");
        }
    }
}
