//! The scenario file: everything of a run in one TOML.
