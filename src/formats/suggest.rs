//! The nearest legal word to a mistyped one.

/// The candidate nearest to `word`, if near enough to be what was meant: at most one edit in three
/// letters, or one begins with the other ("rate", "rate_hz"). Case is ignored; ties go to the first.
#[must_use]
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let near = |candidate: &&str| {
        let candidate = candidate.to_lowercase();
        let edits = distance(&lower, &candidate);
        let longest = lower.chars().count().max(candidate.chars().count());
        let begins = lower.len().min(candidate.len()) >= 3
            && (candidate.starts_with(&lower) || lower.starts_with(&candidate));
        (begins || edits <= (longest / 3).max(1) && edits < longest).then_some(edits)
    };
    let scored = candidates.into_iter().filter_map(|c| near(&c).map(|edits| (edits, c)));
    scored.min_by_key(|(edits, _)| *edits).map(|(_, best)| best)
}

/// Damerau-Levenshtein distance (optimal string alignment): insertions, deletions, substitutions and swaps
/// of neighbours.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let change = usize::from(a[i - 1] != b[j - 1]);
            let mut cost = (last[j] + 1).min(row[j - 1] + 1).min(last[j - 1] + change);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                cost = cost.min(before[j - 2] + 1);
            }
            row.push(cost);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances() {
        for (a, b, d) in
            [("", "abc", 3), ("kitten", "sitting", 3), ("gamm2a", "gamma2", 1), ("phi", "phi", 0)]
        {
            assert_eq!(distance(a, b), d, "{a} {b}");
            assert_eq!(distance(b, a), d, "{b} {a}");
        }
    }

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
