//! Files of a test, and what readers answer to them.

use super::Failure;
use std::fmt::{Display, Write};
use std::path::PathBuf;

/// Files of a directory of their own.
pub(crate) struct Files(tempfile::TempDir);

impl Files {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn with(name: &str, contents: impl AsRef<[u8]>) -> (Self, PathBuf) {
        let files = Self::new();
        let path = files.add(name, contents);
        (files, path)
    }

    pub(crate) fn add(&self, name: &str, contents: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, contents).unwrap();
        path
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.0.path().to_owned()
    }

    /// A message and its hint, without the directory; the fault is one of input.
    pub(crate) fn told(&self, e: &Failure) -> String {
        let directory = format!("{}/", self.path().display());
        told(e).replace(&directory, "")
    }
}

/// A message and its hint; the fault is one of input.
pub(crate) fn told(e: &Failure) -> String {
    assert_eq!(e.code(), 2, "{e}");
    match e.advice() {
        Some(hint) => format!("{e}\nhint: {hint}"),
        None => e.to_string(),
    }
}

/// Inputs with what is answered to each, for a snapshot.
pub(crate) fn answers<T>(
    all: impl IntoIterator<Item = (impl Display, Result<T, String>)>,
) -> String {
    let mut text = String::new();
    for (input, answer) in all {
        let answer = answer.err().unwrap_or_else(|| "accepted".to_owned());
        writeln!(text, "{input}\n=> {answer}\n").unwrap();
    }
    text
}
