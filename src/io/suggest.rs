//! The nearest legal word to a mistyped one.

use nav_sim_calibration::SpecError;

/// The candidate nearest to `word`, if near enough to be what was meant: at most one edit in three
/// letters, or one begins with the other ("rate", "rate_hz"). Case is ignored; ties go to the first.
pub(crate) fn nearest<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let near = |candidate: &&str| {
        let candidate = candidate.to_lowercase();
        let edits = strsim::osa_distance(&lower, &candidate);
        let longest = lower.chars().count().max(candidate.chars().count());
        let begins = lower.len().min(candidate.len()) >= 3
            && (candidate.starts_with(&lower) || lower.starts_with(&candidate));
        (begins || edits <= (longest / 3).max(1) && edits < longest).then_some(edits)
    };
    let scored = candidates
        .into_iter()
        .filter_map(|c| near(&c).map(|edits| (edits, c)));
    scored.min_by_key(|(edits, _)| *edits).map(|(_, best)| best)
}

/// What to write in the place of what is not a model; `legal`: processes and models.
pub(crate) fn model<'a>(e: &SpecError, legal: impl Iterator<Item = &'a str>) -> String {
    let legal: Vec<&str> = legal.collect();
    let Some(term) = &e.term else {
        return "a model is a sum such as 2*AR1+RW+WN+QN".into();
    };
    match nearest(term, legal.iter().copied()) {
        Some(meant) => format!("did you mean \"{meant}\"?"),
        None => format!("processes and models: {}", legal.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_meant_and_what_was_not() {
        let keys = ["sigma2", "gamma2", "phi", "q2"];
        assert_eq!(nearest("sigma", keys), Some("sigma2"));
        assert_eq!(nearest("SIGMA2", keys), Some("sigma2"));
        assert_eq!(nearest("hpi", keys), Some("phi"));
        assert_eq!(nearest("rate", ["rate_hz", "gyro"]), Some("rate_hz"));
        assert_eq!(nearest("temperature", keys), None);
        assert_eq!(nearest("x", keys), None);
        assert_eq!(nearest("q", []), None);
    }
}
