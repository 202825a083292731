//! Why a model was chosen, in words.

use super::format::tau_s;
use crate::outcome::Ranking;

/// The reasons of a choice. `rate_hz` turns levels into seconds.
#[must_use]
pub fn reasons(ranking: &Ranking, rate_hz: f64) -> Vec<String> {
    let Ranking { candidates, chosen, too_simple, .. } = ranking;
    let (best, taken) = (&candidates[0], &candidates[*chosen]);
    let mut lines = Vec::new();
    if *chosen == 0 {
        lines.push(format!("{} has the least WVIC, and nothing simpler does as well", best.spec));
    } else {
        lines.push(format!(
            "{} has the least WVIC, {:.4} against {:.4} of {}, but is not needed: where {} is true, so large a gain \
             has a probability of {:.2}",
            best.spec,
            best.wvic(),
            taken.wvic(),
            taken.spec,
            taken.spec,
            taken.p_value.unwrap_or(f64::NAN)
        ));
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
