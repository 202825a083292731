//! Runs a command on a terminal: claims outputs, runs, shows, writes.

use super::Session;
use crate::app::{Answer, Asked, Command, Result};
use crate::report::{WIDTH, json};
use nav_sim_document::{Document, Importance};

/// Does a command; its answer, if no stated bound is missed.
pub(super) fn drive<C: Command>(asked: &Asked<C>, session: &Session) -> Result<C::Answer> {
    let mut manifest = asked.manifest(session.asked_seed())?;
    manifest.command = super::given();
    let _claims = asked.claim(&manifest, session.force())?;
    let context = session.context().reading(manifest.inputs.clone());
    let answer = asked.request.run(&context)?;
    let document = show(asked, &answer, session);
    let written = asked.write(&answer, &document, manifest, &context)?;
    if !written.is_empty() {
        let names: Vec<String> = written
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        session.say(format!("wrote {}", names.join(", ")));
    }
    answer.unmet().map_or(Ok(answer), Err)
}

/// Puts an answer to stdout, as JSON or in words, and its notes to stderr; its document, for page and picture.
fn show<C: Command>(asked: &Asked<C>, answer: &C::Answer, session: &Session) -> Document {
    let document = answer.document();
    let shown = match answer.text() {
        _ if session.json() => json(answer),
        Some(text) => text,
        None if C::PRINTS_FILE && asked.out.is_some() => String::new(),
        None if C::PRINTS_FILE => {
            let file = answer.files().into_iter().next();
            file.map_or_else(String::new, |file| file.parts.collect())
        }
        None if session.csv() => answer.csv().unwrap_or_default(),
        None if session.verbose() => document.verbose(WIDTH),
        None => document.terminal(WIDTH),
    };
    tell(&document, &shown, session);
    document
}

/// Puts a text to stdout and the notes of a document to stderr.
pub(super) fn tell(document: &Document, shown: &str, session: &Session) {
    if !shown.is_empty() {
        session.result(shown.trim_end());
    }
    for note in document.spoken(session.verbose()) {
        match note.importance {
            Importance::Warning => session.printer.warn(&note.text),
            _ => session.say(format!("note: {}", note.text)),
        }
    }
}
