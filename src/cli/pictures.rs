//! Outputs of commands that write files themselves.

use super::{Failure, Session};
use crate::io::atomic::{self, Claim, Written};
use std::path::Path;

/// Claims an output of that kind, if one is asked for.
pub(super) fn claim_output(
    path: Option<&Path>,
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    kind: Written,
    session: &Session,
) -> Result<Option<Claim>, Failure> {
    let inputs: Vec<_> = inputs.into_iter().collect();
    let inputs = || inputs.iter().map(AsRef::as_ref);
    let claim = |path| atomic::claim_result(path, inputs(), kind, session.existing());
    path.map(claim).transpose()
}
