//! Files to be written.

/// Indented JSON with a final newline; NaN is null.
pub(crate) fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain structs with text keys are always JSON")
        + "\n"
}
