//! The nearest legal word to a mistyped one.

/// Units that no name here has, or few.
const OTHER_UNITS: [&str; 16] = [
    "_rad", "_mrad", "_mm", "_cm", "_km", "_ft", "_ms", "_us", "_ns", "_min", "_kmh", "_km_h",
    "_kn", "_dps", "_g", "_mg",
];

/// The candidate nearest to `word`, if near enough to be what was meant: at most one edit in three
/// letters, or one begins with the other ("rate", "rate_hz"). A name in another unit is none: under the
/// candidate's its values would be wrong. Case is ignored; ties go to the first.
pub(crate) fn nearest<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let near = |candidate: &&str| {
        let candidate = candidate.to_lowercase();
        let edits = strsim::osa_distance(&lower, &candidate);
        let longest = lower.chars().count().max(candidate.chars().count());
        // a part of one letter is an axis or a unit: another letter is another quantity
        let is_letter = |part: &str| part.chars().count() == 1;
        let [own, others] = [&lower, &candidate].map(|name| name.split(['_', '.']));
        let is_other = |(a, b)| a != b && is_letter(a) && is_letter(b);
        let is_in_other = |unit: &&str| lower.ends_with(*unit) && !candidate.ends_with(*unit);
        if OTHER_UNITS.iter().any(is_in_other) {
            return None;
        }
        if own.clone().count() == others.clone().count() && own.zip(others).any(is_other) {
            return None;
        }
        let begins = lower.len().min(candidate.len()) >= 3
            && (candidate.starts_with(&lower) || lower.starts_with(&candidate));
        (begins || edits <= (longest / 3).max(1) && edits < longest).then_some(edits)
    };
    let scored = candidates
        .into_iter()
        .filter_map(|c| near(&c).map(|edits| (edits, c)));
    scored.min_by_key(|(edits, _)| *edits).map(|(_, best)| best)
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
        let names = ["v_d_m_s", "v_n_m_s"];
        assert_eq!(nearest("v_u_m_s", names), None);
        assert_eq!(nearest("vn_m_s", names), Some("v_n_m_s"));
        assert_eq!(nearest("att_sigma_rad", ["att_sigma_deg"]), None);
        assert_eq!(nearest("sd_n_cm", ["sd_n_m"]), None);
    }
}
