//! Paths of keys, and where in a text they stand.

use serde::de::DeserializeOwned;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A key with the path of its table before it.
pub(crate) fn dotted(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

type Value<'a> = Spanned<DeValue<'a>>;

/// Path of the innermost key of a table that a span lies in.
///
/// The span of a table under a head is the head alone, so every table is searched.
pub(super) fn within(table: &DeTable<'_>, path: &str, span: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let path = dotted(path, key.get_ref());
        let is_key = key.span() == *span;
        if is_key {
            Some(path)
        } else {
            within_value(value, path, span)
        }
    })
}

fn within_value(value: &Value<'_>, path: String, span: &Range<usize>) -> Option<String> {
    let inner = match value.get_ref() {
        DeValue::Table(table) => within(table, &path, span),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
            let is_table = item.get_ref().is_table();
            is_table
                .then(|| within_value(item, format!("{path}[{}]", i + 1), span))
                .flatten()
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
        let (key, entry) = part
            .split_once('[')
            .map_or((part, None), |(key, entry)| (key, Some(entry)));
        let Some(value) = table.and_then(|table| table.get(key)) else {
            return (span, false);
        };
        let entry = entry.and_then(|i| {
            i.trim_end_matches(']')
                .parse::<usize>()
                .ok()?
                .checked_sub(1)
        });
        let value = entry
            .and_then(|i| value.get_ref().as_array()?.get(i))
            .unwrap_or(value);
        (table, span) = (value.get_ref().as_table(), value.span());
    }
    (span, true)
}

/// Keys that tell what the others of their table mean: without them every message is another.
const TAGS: [&str; 4] = ["type", "operation", "kind", "distribution"];

/// Path of the key that serde refuses.
///
/// Of tables that a word tells apart serde knows no places: there it is the entry that is refused alone, and the key without
/// which something else is said.
pub(super) fn culprit<T: DeserializeOwned>(
    table: &Spanned<DeTable<'_>>,
    error: &toml::de::Error,
) -> String {
    let message = error.message();
    let span = error.span().unwrap_or_default();
    let is_same = |changed: DeTable<'_>| {
        let said = T::deserialize(toml::de::Deserializer::from(Spanned::new(
            table.span(),
            changed,
        )));
        said.err().is_some_and(|e| e.message() == message)
    };
    let mut path = match span == table.span() {
        true => String::new(),
        false => within(table.get_ref(), "", &span).unwrap_or_default(),
    };
    if path.ends_with(']') {
        path.truncate(path.rfind('[').unwrap_or_default()); // the head of a list is that of its first entry
    }
    let unknown = message
        .strip_prefix("unknown field `")
        .and_then(|rest| rest.split('`').next());
    loop {
        // the unknown key itself may be a list: nothing inside it is to blame
        if unknown.is_some() && path.rsplit('.').next() == unknown {
            return path;
        }
        let inner = match value_at(table.get_ref(), &path) {
            Some(DeValue::Array(items)) if items.iter().any(|item| item.get_ref().is_table()) => {
                let mut alone = (1..=items.len()).map(|i| (i, only(table.get_ref(), &path, i)));
                alone.find_map(|(i, changed)| is_same(changed).then(|| format!("{path}[{i}]")))
            }
            _ if message.starts_with("missing field") => None,
            value => {
                let own = value.map_or(Some(table.get_ref()), DeValue::as_table);
                let is_tag =
                    |key: &&str| TAGS.contains(key) == message.starts_with("unknown variant");
                let keys = own
                    .into_iter()
                    .flat_map(|own| own.keys().map(|key| key.get_ref().as_ref()));
                let mut paths = keys.filter(is_tag).map(|key| dotted(&path, key));
                paths.find(|path| !is_same(without(table.get_ref(), path)))
            }
        };
        let Some(inner) = inner else { return path };
        path = inner;
    }
}

/// The parts of a path: keys, and the place of an entry of a list.
fn parts(path: &str) -> impl Iterator<Item = (&str, Option<usize>)> {
    path.split('.')
        .filter(|part| !part.is_empty())
        .map(|part| match part.split_once('[') {
            None => (part, None),
            Some((key, entry)) => (
                key,
                entry
                    .trim_end_matches(']')
                    .parse::<usize>()
                    .ok()
                    .and_then(|i| i.checked_sub(1)),
            ),
        })
}

/// The value of a path; none for the file itself.
fn value_at<'a>(table: &'a DeTable<'a>, path: &str) -> Option<&'a DeValue<'a>> {
    let mut value: Option<&DeValue<'_>> = None;
    for (key, entry) in parts(path) {
        let own = value
            .map_or(Some(table), DeValue::as_table)?
            .get(key)?
            .get_ref();
        value = Some(match entry {
            Some(i) => own.as_array()?.get(i)?.get_ref(),
            None => own,
        });
    }
    value
}

/// The same file with another value of a path, or without it.
fn changed<'a>(
    table: &DeTable<'a>,
    path: &str,
    change: &dyn Fn(&mut DeTable<'a>, &str),
) -> DeTable<'a> {
    let mut all = table.clone();
    let (above, key) = path.rsplit_once('.').unwrap_or(("", path));
    let mut own = Some(&mut all);
    for (key, entry) in parts(above) {
        let inner = own.and_then(|own| own.get_mut(key)).map(Spanned::get_mut);
        own = match (inner, entry) {
            (Some(DeValue::Array(items)), Some(i)) => {
                match items.get_mut(i).map(Spanned::get_mut) {
                    Some(DeValue::Table(table)) => Some(table),
                    _ => None,
                }
            }
            (Some(DeValue::Table(table)), None) => Some(table),
            _ => None,
        };
    }
    if let Some(own) = own {
        change(own, key);
    }
    all
}

fn without<'a>(table: &DeTable<'a>, path: &str) -> DeTable<'a> {
    changed(table, path, &|own, key| _ = own.remove(key))
}

/// With one entry alone in a list.
fn only<'a>(table: &DeTable<'a>, path: &str, entry: usize) -> DeTable<'a> {
    changed(table, path, &|own, key| {
        if let Some(DeValue::Array(items)) = own.get_mut(key).map(Spanned::get_mut) {
            *items = items.iter().skip(entry - 1).take(1).cloned().collect();
        }
    })
}
