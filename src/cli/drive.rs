//! Runs a command on a terminal: claims outputs, runs, shows, writes.

use super::Session;
use crate::app::{Answer, Asked, Command, Result};

/// Does a command.
pub(super) fn drive<C: Command>(asked: &Asked<C>, session: &Session) -> Result<()> {
    let mut manifest = asked.manifest(session.common.seed)?;
    manifest.command.clone_from(&session.given);
    let _claims = asked.claim(&manifest, session.common.force)?;
    let context = session.context().reading(manifest.inputs.clone());
    let answer = asked.request.run(&context)?;
    let document = answer.document();
    let file = || match asked.out {
        Some(_) => None,
        None => answer.files().into_iter().next(),
    };
    let file = C::PRINTS_FILE.then(|| file().map_or_else(String::new, |f| f.parts.collect()));
    session.show(&answer, &document, answer.text().or(file));
    let written = asked.write(&answer, &document, manifest, &context)?;
    if !written.is_empty() {
        let names: Vec<_> = written.iter().map(|path| path.to_string_lossy()).collect();
        session.say(format!("wrote {}", names.join(", ")));
    }
    answer.unmet().map_or(Ok(()), Err)
}
