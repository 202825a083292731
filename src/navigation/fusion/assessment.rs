//! Whether a solution is to be believed: by its own innovations, and by a reference where there is one.

use super::{FixRecord, IN_WORDS, Outcome, Recorded, Solution, Use, clocks_apart};

/// NIS per component that is doubtful, and that is not to be believed: innovations 1.4 times and twice as large
/// as stated. Receivers state their standard deviations to a factor like that; right solutions of real drives
/// have a NIS below 1.5, most of them far below 1.
const NIS_LIMITS: (f64, f64) = (2.0, 4.0);
/// NIS per component below which the standard deviations are far too large, four times those of the innovations.
const NIS_CAUTIOUS: f64 = 1.0 / 16.0;
/// Mean NEES of nine states against a reference beyond which the errors are twice as large as stated.
const NEES_LIMIT: f64 = 36.0;
/// A stretch in which the NIS is looked at by itself (s), and the share of bad ones that is too much.
const STRETCH_S: f64 = 60.0;
const BAD_STRETCHES: f64 = 0.1;
/// Share of rejected fixes that is doubtful, and that leaves nothing to believe.
const REJECTED: (f64, f64) = (0.1, 0.5);

/// What a solution is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// As good as it states.
    Ok,
    /// The fixes agree with it far better than stated.
    Underconfident,
    /// Something speaks against it.
    Doubtful,
    /// Worse than it states: not to be believed.
    Overconfident,
}

impl Verdict {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Underconfident => "underconfident",
            Self::Doubtful => "doubtful",
            Self::Overconfident => "overconfident",
        }
    }
}

/// A verdict and its reasons.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assessment {
    /// The worst of the reasons.
    pub verdict: Verdict,
    /// What speaks against the solution, each with its weight.
    pub reasons: Vec<(Verdict, String)>,
}

impl Assessment {
    fn of(mut reasons: Vec<(Verdict, String)>) -> Self {
        let verdict = reasons.iter().map(|(v, _)| *v).max().unwrap_or(Verdict::Ok);
        // caution is no comfort beside a doubt
        reasons.retain(|(v, _)| *v >= verdict.min(Verdict::Doubtful));
        // what weighs most first
        reasons.sort_by_key(|(v, _)| std::cmp::Reverse(*v));
        Self { verdict, reasons }
    }

    /// The same, beginning with what the recorded data themselves show to be the cause: clocks that are apart, or
    /// what else is found, in words.
    #[must_use]
    pub fn explained(mut self, recorded: &Recorded<'_>, found: impl FnOnce() -> Option<String>) -> Self {
        if self.verdict >= Verdict::Doubtful {
            let clocks = clocks_apart(recorded).map(|apart| apart.to_string());
            let cause = clocks.or_else(found);
            self.reasons.splice(0..0, cause.map(|text| (Verdict::Doubtful, text)));
        }
        self
    }
}

/// The largest mean NIS per component that is `limit` or chance: five standard deviations of the mean of
/// chi-squares.
fn bound(limit: f64, components: usize) -> f64 {
    limit.max(1.0 + 5.0 * (2.0 / components.max(1) as f64).sqrt())
}

/// Mean NIS per component above which a solution is not to be believed.
pub(super) fn nis_bound(components: usize) -> f64 {
    bound(NIS_LIMITS.1, components)
}

/// Judges a solution. `of_start` is what speaks against the start, as the alignment found it.
#[must_use]
pub fn assess(solution: &Solution, outcome: &Outcome, of_start: &[(Verdict, String)]) -> Assessment {
    let mut reasons = of_start.to_vec();
    reasons.extend(nis(solution, outcome));
    reasons.extend(stretches(solution));
    reasons.extend(rejected(outcome));
    reasons.extend(nees(outcome));
    Assessment::of(reasons)
}

fn used(solution: &Solution) -> impl Iterator<Item = &FixRecord> {
    solution.fixes.iter().filter(|f| f.used == Use::Used)
}

fn nis(solution: &Solution, outcome: &Outcome) -> Option<(Verdict, String)> {
    let components: usize = used(solution).map(|f| f.innovation.len()).sum();
    let nis = outcome.nis_per_component;
    let verdict = match nis {
        _ if components == 0 => return Some((Verdict::Doubtful, "no fix was used".to_owned())),
        nis if nis > nis_bound(components) => Verdict::Overconfident,
        nis if nis > bound(NIS_LIMITS.0, components) => Verdict::Doubtful,
        // sixty components have a mean below 1/16 by chance once in 10^50
        nis if nis < NIS_CAUTIOUS && components >= 60 => {
            let text = format!(
                "NIS {nis:.2} per component, where 1 is right: the fixes agree {:.0} times better than their \
                 standard deviations say, as when their errors hardly change from one to the next; the stated \
                 position errors mean little while there are fixes",
                1.0 / nis.sqrt()
            );
            return Some((Verdict::Underconfident, text));
        }
        _ => return None,
    };
    let text = format!(
        "NIS {nis:.1} per component, where 1 is right: the fixes are {:.1} times as far from the solution as it states",
        nis.sqrt()
    );
    Some((verdict, text))
}

/// Minutes in which most fixes are far from what is stated. The farthest tenth of them is left out: single
/// wild fixes are the receiver's.
fn stretches(solution: &Solution) -> Option<(Verdict, String)> {
    let begin_s = used(solution).next()?.t_s;
    let mut minutes: Vec<Vec<&FixRecord>> = Vec::new();
    for fix in used(solution) {
        let minute = ((fix.t_s - begin_s) / STRETCH_S) as usize;
        minutes.resize(minutes.len().max(minute + 1), Vec::new());
        minutes[minute].push(fix);
    }
    let all = minutes.iter().filter(|m| !m.is_empty()).count();
    let bad: Vec<(usize, f64)> =
        minutes.iter().enumerate().filter_map(|(k, fixes)| Some((k, far(fixes)?))).collect();
    let (worst, nis) = *bad.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let share = bad.len() as f64 / all as f64;
    let verdict = if share > BAD_STRETCHES { Verdict::Overconfident } else { Verdict::Doubtful };
    let from = begin_s + STRETCH_S * worst as f64;
    let text = format!(
        "in {} of {all} minutes the NIS is far above 1: {nis:.1} per component from {from:.0} to {:.0} s",
        bad.len(),
        from + STRETCH_S
    );
    Some((verdict, text))
}

/// The mean NIS per component of the nearest nine tenths of these fixes, where it is not to be believed.
fn far(fixes: &[&FixRecord]) -> Option<f64> {
    let mut sorted: Vec<(f64, usize)> = fixes.iter().map(|f| (f.nis, f.innovation.len())).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let kept = &sorted[..sorted.len() * 9 / 10];
    let components: usize = kept.iter().map(|(_, n)| n).sum();
    let nis = kept.iter().map(|(nis, _)| nis).sum::<f64>() / components.max(1) as f64;
    (components > 0 && nis > nis_bound(components)).then_some(nis)
}

fn rejected(outcome: &Outcome) -> Option<(Verdict, String)> {
    let [used, _, rejected] = outcome.fixes;
    let share = rejected as f64 / (used + rejected).max(1) as f64;
    let verdict = match share {
        share if share > REJECTED.1 => Verdict::Overconfident,
        // three of a short recording are no share
        share if share > REJECTED.0 && rejected > 3 => Verdict::Doubtful,
        _ => return None,
    };
    let text = format!(
        "{rejected} of {} fixes were rejected: the solution departed from the fixes",
        used + rejected
    );
    Some((verdict, text))
}

fn nees(outcome: &Outcome) -> Option<(Verdict, String)> {
    let reference = outcome.reference.filter(|r| r.nees_mean > NEES_LIMIT)?;
    let nees = reference.nees_mean;
    let worst = reference.over_sigma.iter().zip(IN_WORDS).max_by(|a, b| a.0.total_cmp(b.0));
    let most = worst.map_or(String::new(), |(ratio, name)| format!(", most in {name} ({ratio:.1} times)"));
    let coloured = if outcome.nis_per_component < 1.0 {
        "; the innovations do not show it, as when the errors of the fixes hardly change from one to the next"
    } else {
        ""
    };
    let text = format!(
        "NEES {nees:.0} against the reference, where 9 is right: the errors are {:.1} times as large as stated{most}{coloured}",
        (nees / 9.0).sqrt()
    );
    Some((Verdict::Overconfident, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::{FromReference, outcome};
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// A fix a second of three components with this NIS per component.
    fn solution(nis: impl Fn(usize) -> f64, seconds: usize) -> Solution {
        let fix = |k: usize| FixRecord {
            t_s: k as f64,
            used: Use::Used,
            innovation: vec![0.0; 3],
            sigma: vec![1.0; 3],
            nis: 3.0 * nis(k),
            horizontal_sigma_m: 1.0,
            error: None,
        };
        Solution { fixes: (0..seconds).map(fix).collect(), ..Solution::default() }
    }

    fn judged(solution: &Solution) -> Assessment {
        assess(solution, &outcome(solution, &[]), &[])
    }

    #[test]
    fn innovations_as_large_as_stated_are_ok_twice_as_large_are_not_believed() {
        let verdict = |nis: f64| judged(&solution(|_| nis, 600)).verdict;
        assert_eq!([0.2, 1.0, 1.6].map(verdict), [Verdict::Ok; 3]);
        assert_eq!(
            [0.03, 2.5, 5.0].map(verdict),
            [Verdict::Underconfident, Verdict::Doubtful, Verdict::Overconfident]
        );
    }

    /// Bad minutes count although the mean over the drive hides them; one wild fix is no bad minute.
    #[test]
    fn bad_minutes_count_and_wild_fixes_do_not() {
        let bad = |minutes: usize| judged(&solution(move |k| if k < 60 * minutes { 9.0 } else { 0.3 }, 1800));
        assert_eq!(bad(1).verdict, Verdict::Doubtful);
        assert!(bad(1).reasons[0].1.starts_with("in 1 of 30 minutes"), "{:?}", bad(1));
        assert_eq!(bad(4).verdict, Verdict::Overconfident);
        assert_eq!(judged(&solution(|k| if k == 77 { 200.0 } else { 0.5 }, 600)).verdict, Verdict::Ok);
    }

    #[test]
    fn a_solution_that_rejects_its_fixes_is_not_believed() {
        let mut all = solution(|_| 1.0, 600);
        all.fixes[..90].iter_mut().for_each(|f| f.used = Use::Rejected);
        assert_eq!(judged(&all).verdict, Verdict::Doubtful);
        all.fixes[..400].iter_mut().for_each(|f| f.used = Use::Rejected);
        assert_eq!(judged(&all).verdict, Verdict::Overconfident);
    }

    #[test]
    fn a_reference_that_is_three_sigma_off_in_every_state_is_not_believed() {
        let all = solution(|_| 1.0, 600);
        let verdict = |nees| {
            let reference =
                FromReference { nees_mean: nees, over_sigma: [3.0; 9], ..FromReference::default() };
            let outcome = Outcome { reference: Some(reference), ..outcome(&all, &[]) };
            assess(&all, &outcome, &[]).verdict
        };
        assert_eq!([9.0, 20.0, 81.0].map(verdict), [Verdict::Ok, Verdict::Ok, Verdict::Overconfident]);
    }

    /// What is as believed is doubted once in 500 at most, however few its fixes.
    #[test]
    fn chance_is_no_doubt() {
        for components in [3, 6, 12, 30, 100, 1000] {
            let n = f64::from(components);
            let p = ChiSquared::new(n).unwrap().sf(n * bound(NIS_LIMITS.0, components as usize));
            assert!(p < 2e-3, "{components}: {p}");
        }
    }
}
