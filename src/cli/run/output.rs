//! The run directory that is claimed.

use crate::cli::{Failure, Session};
use crate::formats::atomic::{Claim, Found, claim_directory};
use crate::report::Manifest;
use crate::run::RUN_FILES;
use std::cell::Cell;
use std::path::Path;

/// Whether a run directory can be made, found out before the long computation.
pub(super) fn claim(path: &Path, manifest: &Manifest, session: &Session) -> Result<Claim, Failure> {
    let inputs = manifest.inputs.iter().map(|i| Path::new(&i.path));
    let first_seed = Cell::new(None);
    let recognise = |text: &str| {
        let Ok(present) = serde_json::from_str::<Manifest>(text) else {
            return Ok(Found::Foreign);
        };
        first_seed.set(
            manifest
                .differs_in_seed(&present)
                .then_some(present.seed)
                .flatten(),
        );
        Ok(Found::result(manifest.is_same_run(&present)))
    };
    let claimed = claim_directory(path, &RUN_FILES, inputs, session.existing(), recognise);
    claimed.map_err(|e| match first_seed.get() {
        Some(seed) => {
            let hint = format!(
                "make that run again with --seed {seed}, name another directory with -o, or replace it with --force"
            );
            Failure::from(e).hint(hint)
        }
        None => e.into(),
    })
}
