//! What a request comes to.

use crate::failure::Failure;
use crate::report::{Answer, OutputFile, json};
use nav_sim_document::Document;

/// What a request comes to, as its command prints and writes it.
#[derive(Debug)]
#[non_exhaustive]
pub struct Answered {
    /// As JSON.
    pub json: String,
    /// In words, tables and charts.
    pub document: Document,
    /// The files that it makes: name and contents.
    pub files: Vec<(String, String)>,
    /// The bound that is not met, where one was asked for.
    pub unmet: Option<Failure>,
}

impl Answered {
    /// An answer without files and bounds.
    pub(crate) fn of(answer: &impl Answer) -> Self {
        Self { json: json(answer), document: answer.document(), files: Vec::new(), unmet: None }
    }
}

/// Names and contents of files.
pub(crate) fn contents(files: Vec<OutputFile<'_>>) -> Vec<(String, String)> {
    files.into_iter().map(|file| (file.name.to_owned(), file.parts.collect())).collect()
}
