//! Why a model was chosen, in words.

use crate::outcome::{Candidate, Ranking, tau_s};

/// The reasons of a choice. `rate_hz` turns levels into seconds.
#[must_use]
pub fn reasons(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let Ranking { candidates, chosen, too_simple, .. } = ranking;
    let (best, taken) = (&candidates[0], &candidates[*chosen]);
    let mut lines = vec![choice(best, taken)];
    let but_rejected = candidates.iter().filter(|c| c.spec != taken.spec && c.is_rejected());
    lines.extend(but_rejected.map(|c| {
        let p = c.j_p_value.unwrap_or(f64::NAN);
        format!("{} is not taken: the J-test rejects it (p = {p:.3})", c.spec)
    }));
    if taken.is_rejected() {
        lines.push("the J-test rejects every candidate: none of these sums describes the curve".to_owned());
    }
    lines.extend(too_simple.iter().map(|simple| {
        format!(
            "{} is too simple (p ≤ {:.3}): {:.0} % of the difference is at {} s",
            simple.spec,
            simple.p_value,
            100.0 * simple.share,
            tau_s(simple.level, rate_hz)
        )
    }));
    lines
}

/// Why this one.
fn choice(best: &Candidate, taken: &Candidate) -> String {
    let wvic = |c: &Candidate| format!("{:.4}", c.wvic());
    match taken.p_value {
        None if taken.spec == best.spec => {
            format!("{} has the least WVIC, and nothing simpler does as well", best.spec)
        }
        None => format!(
            "{} has the least WVIC that the J-test does not reject, {} against {} of {}",
            taken.spec,
            wvic(taken),
            wvic(best),
            best.spec
        ),
        Some(p) => format!(
            "{} has the least WVIC, {} against {} of {}, but is not needed: where {} is true, so large a gain has a \
             probability of {p:.2}",
            best.spec,
            wvic(best),
            wvic(taken),
            taken.spec,
            taken.spec
        ),
    }
}
