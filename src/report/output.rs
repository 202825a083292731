//! Files to be written.

/// A file to be written.
pub(crate) struct OutputFile<'a> {
    /// Name in the directory.
    pub name: &'static str,
    /// Its text, part by part: the table of many runs is never whole in memory.
    pub parts: Box<dyn Iterator<Item = String> + 'a>,
}

impl OutputFile<'_> {
    /// A small file.
    pub(crate) fn whole(name: &'static str, text: String) -> Self {
        Self {
            name,
            parts: Box::new(std::iter::once(text)),
        }
    }
}

/// Indented JSON with a final newline; NaN is null.
pub(crate) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain structs with text keys are always JSON")
        + "\n"
}
