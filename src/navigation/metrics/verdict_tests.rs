use super::VerdictKind::{Consistent, Diverged, Overconfident, Undecided, Underconfident};
use super::*;
use crate::simulation::OutageRecord;
use crate::tests::*;

/// Runs of one outage whose errors are `scale` times what the filter believes in each state; `epochs`
/// independent ones a run.
fn runs(count: u64, epochs: usize, seed: u64, scale: [f64; REPORTED]) -> Vec<RunRecord> {
    let mut normal = normals(seed);
    let mut errors = || -> [f64; REPORTED] { std::array::from_fn(|i| scale[i] * normal()) };
    let nees = |e: &[f64; REPORTED]| e.iter().map(|x| x * x).sum::<f64>();
    let mut record = |run| {
        let all: Vec<[f64; REPORTED]> = (0..epochs).map(|_| errors()).collect();
        let mean = |value: &dyn Fn(&[f64; REPORTED]) -> f64| {
            all.iter().map(value).sum::<f64>() / epochs as f64
        };
        let end = errors();
        let see = [2.0; REPORTED];
        let outage = OutageRecord {
            see_end: see,
            error_end: end.map(|e| 2.0 * e),
            nees_end: nees(&end),
            ..OutageRecord::default()
        };
        RunRecord {
            run,
            outages: vec![outage],
            nees_mean: mean(&nees),
            covered: 0.95,
            normalised_sq: std::array::from_fn(|i| mean(&|e| e[i] * e[i])),
            ..RunRecord::default()
        }
    };
    (0..count).map(&mut record).collect()
}

/// 1500 experiments of a right filter, with one epoch a run (the worst correlation there can be) and 30 or 8
/// runs: false alarms are at most 1 %, by more than three deviations of a binomial share (0.26 %) never 1.8 %.
#[test]
fn a_right_filter_is_rarely_called_wrong() {
    for count in [8, 30] {
        let wrong =
            |seed: &u64| Verdict::of(&runs(count, 1, *seed, [1.0; 9]), 1, None).kind > Undecided;
        let alarms = (0..1500).filter(wrong).count();
        assert!(alarms <= 27, "{alarms} of 1500 with {count} runs");
    }
}

/// Runs whose first state of attitude is 1.5 times as far off as believed.
fn roll_off(count: u64, epochs: usize, seed: u64) -> Vec<RunRecord> {
    let mut scale = [1.0; REPORTED];
    scale[6] = 1.5;
    runs(count, epochs, seed, scale)
}

/// Errors that hang together as the filter does not believe: each state is as far off as it should be, all together are
/// not. They are named, with √(NEES/9), known to half of √(2/(9·200)), within five standard errors.
#[test]
fn states_that_are_wrong_together_only_are_named_together() {
    let mut all = runs(200, 20, 3, [1.0; 9]);
    all.iter_mut()
        .for_each(|run| run.outages[0].nees_end *= 1.7);
    let verdict = Verdict::of(&all, 1, None);
    let found = (verdict.kind, verdict.worst_state, verdict.worst_outage);
    assert_eq!(found, (Overconfident, ALL_STATES, Some(0)));
    assert_relative_eq!(
        verdict.ratio,
        1.7_f64.sqrt(),
        max_relative = 5.0 * 0.5 * (2.0_f64 / 1800.0).sqrt()
    );
}

#[test]
fn too_little_confidence_is_told_and_too_much_comes_first() {
    let large = Verdict::of(&runs(200, 20, 3, [0.7; 9]), 1, None);
    assert_eq!(large.kind, Underconfident);
    assert!(large.ratio < 0.8, "{large:?}");
    let mut scale = [0.7; 9];
    scale[8] = 2.0;
    let both = Verdict::of(&runs(200, 20, 3, scale), 1, None);
    assert_eq!((both.kind, both.worst_state), (Overconfident, "yaw_deg"));
}

/// Each outage has its own: a filter that is right at the end of the one, and at that of the other has a state that is 1.5 times
/// as far off: told by name, with its ratio within five standard errors, 1.5/√400.
#[test]
fn each_outage_has_a_verdict_of_its_own() {
    let mut all = runs(200, 20, 3, [1.0; 9]);
    for (run, wrong) in all.iter_mut().zip(roll_off(200, 20, 4)) {
        run.outages.extend(wrong.outages);
    }
    let found = verdicts(&all, 2, None).1;
    assert_eq!(found[0].kind, Consistent);
    assert_eq!(
        (found[1].kind, found[1].worst_state),
        (Overconfident, "roll_deg")
    );
    assert_abs_diff_eq!(found[1].ratio, 1.5, epsilon = 5.0 * 1.5 / 20.0);
    assert_eq!(Verdict::of(&all, 2, None).worst_outage, Some(1));
    all[7].diverged = true;
    assert!(verdicts(&all, 2, None).1.iter().all(|v| v.kind == Diverged));
}

/// What is significant and small is let pass: 5 % with 20 000 runs.
#[test]
fn a_small_difference_is_no_verdict() {
    let verdict = Verdict::of(&runs(20_000, 1, 3, [1.05; 9]), 1, None);
    assert_eq!(verdict.kind, Consistent);
    assert_abs_diff_eq!(verdict.nees / 9.0, 1.05 * 1.05, epsilon = 0.02);
}

/// The same hundred runs, worth 3 of them: nothing can be told any more from a state 1.5 times off.
#[test]
fn runs_that_share_their_noise_tell_less() {
    let records = roll_off(100, 1, 3);
    assert_eq!(Verdict::of(&records, 1, None).kind, Overconfident);
    let shared = Verdict::of(&records, 1, Some(3.0));
    assert_eq!((shared.kind, shared.independent_samples), (Undecided, 3.0));
    assert!(
        shared.detectable_state_ratio > 2.0 && shared.ratio_std_error > 0.2,
        "{shared:?}"
    );
}

#[test]
fn a_lost_filter_and_a_diverged_run_are_told() {
    let far = Verdict::of(&runs(1, 20, 3, [11.0; 9]), 1, None);
    assert!(far.is_far_off() && far.kind == Overconfident && far.nees_std_error.is_nan());
    let mut records = runs(8, 20, 3, [1.0; 9]);
    records[3] = RunRecord {
        diverged: true,
        nees_mean: f64::NAN,
        ..records[3].clone()
    };
    let verdict = Verdict::of(&records, 1, None);
    assert!(verdict.kind == Diverged && verdict.nees.is_finite());
    records.iter_mut().for_each(|r| r.diverged = true);
    let none = Verdict::of(&records, 1, None);
    assert!(none.kind == Diverged && none.nees.is_nan());
}

/// 8 runs with one outage would miss errors of 50 % in one state; the number that decides is the first that finds them, and
/// faults that 8 runs find stay faults.
#[test]
fn too_few_runs_leave_a_right_filter_undecided() {
    let verdict = |count: u64, scale: f64| Verdict::of(&runs(count, 1, 3, [scale; 9]), 1, None);
    let few = verdict(8, 1.0);
    assert_eq!(few.kind, Undecided);
    assert!(few.detectable_state_ratio > 1.5, "{few:?}");
    let enough = (8.0 * few.times_to_decide.unwrap() - 1e-6).ceil() as u64;
    let [one_less, decided] = [enough - 1, enough].map(|count| verdict(count, 1.0));
    assert_eq!((one_less.kind, decided.kind), (Undecided, Consistent));
    assert!(
        decided.detectable_state_ratio <= 1.5 && decided.detectable_ratio <= 1.25,
        "{decided:?}"
    );
    assert!(one_less.detectable_state_ratio > 1.5 && decided.times_to_decide.is_none());
    assert!(verdicts(&runs(8, 1, 3, [1.0; 9]), 1, None).1[0].kind == Undecided);
    assert_eq!(verdict(8, 2.5).kind, Overconfident);
}

/// Errors of first-order Gauss-Markov processes of nine states, `scale` times their standard deviations, over so many
/// correlation times of 20 rows.
fn drive(seed: u64, times: usize, scale: f64) -> Vec<NormalisedErrors> {
    let mut normal = normals(seed);
    let phi = (-1.0 / 20.0_f64).exp();
    let mut z: [f64; REPORTED] = std::array::from_fn(|_| normal());
    let mut row = |k: usize| {
        z = z.map(|z| phi * z + (1.0 - phi * phi).sqrt() * normal());
        let over_sigma = z.map(|z| scale * z);
        NormalisedErrors {
            t_s: k as f64,
            over_sigma,
            nees: Some(over_sigma.iter().map(|z| z * z).sum()),
        }
    };
    (0..20 * times).map(&mut row).collect()
}

fn of_drive(seed: u64, times: usize, scale: f64) -> Verdict {
    Verdict::of_drive(&drive(seed, times, scale), &[])
        .unwrap()
        .verdict
}

/// A mean square of n independent errors varies by 2/n. Of a first-order process over 400 correlation times τ that is
/// n = T/τ·(1 − φ²)/(1 + φ²)·20 to 0.1 %: 400. Over 200 drives the variance is known to 10 %, three of which are allowed.
#[test]
fn the_samples_of_a_drive_are_those_of_its_scatter() {
    let (mut squares, mut worth) = (Vec::new(), Vec::new());
    for seed in 0..200 {
        let z: Vec<f64> = drive(seed, 400, 1.0)
            .iter()
            .map(|e| e.over_sigma[3])
            .collect();
        squares.push(z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64);
        worth.push(SampleSize::of_series([z.into_iter()].into_iter()).independent);
    }
    let n = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let variance = squares.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let worth = worth.iter().sum::<f64>() / n;
    assert!(
        (worth * variance / 2.0 - 1.0).abs() < 0.3,
        "{worth} {}",
        2.0 / variance
    );
}

/// White errors are all independent, one that never changes is one sample, and two states count as the mean of both.
#[test]
fn what_never_changes_is_one_sample() {
    let constant = || std::iter::repeat_n(0.7, 1000);
    let size =
        |all: Vec<Vec<f64>>| SampleSize::of_series(all.into_iter().map(Vec::into_iter)).independent;
    assert_abs_diff_eq!(size(vec![constant().collect()]), 1.0, epsilon = 1e-9);
    let white: Vec<f64> = (0..1024)
        .map(|k| if k % 2 == 0 { 1.0 } else { -1.0 })
        .collect();
    // all of its energy is at the finest scale, which has half as many coefficients
    assert_abs_diff_eq!(size(vec![white.clone()]), 512.0, epsilon = 1e-9);
    assert_abs_diff_eq!(size(vec![white.clone(), white]), 512.0, epsilon = 1e-9);
}

/// Drives of 400 correlation times tell errors 1.0, 1.25 and 0.8 times the stated ones: at most two of 40 wrong, and the same
/// word as 100 runs with these errors.
#[test]
fn a_long_drive_decides() {
    for (scale, kind) in [
        (1.0, Consistent),
        (1.25, Overconfident),
        (0.8, Underconfident),
    ] {
        let count = (0..40)
            .filter(|seed| of_drive(*seed, 400, scale).kind == kind)
            .count();
        assert!(count >= 38, "{count} of 40 at {scale}");
        assert_eq!(
            Verdict::of(&runs(100, 20, 3, [scale; 9]), 1, None).kind,
            kind
        );
    }
}

/// A right filter on drives of one to thirty correlation times: an alarm in 1 % of them. Of 600 at most 6, by four
/// deviations of a binomial share 16.
#[test]
fn a_short_drive_is_rarely_called_wrong() {
    for times in [1, 3, 10, 30] {
        let wrong = |seed: &u64| of_drive(*seed, times, 1.0).kind > Undecided;
        let count = (0..600).filter(wrong).count();
        assert!(count <= 16, "{count} of 600 at {times}");
    }
    let short = of_drive(1, 10, 1.0);
    assert_eq!((short.kind, short.basis), (Undecided, Basis::Drive));
    let longer = short.times_to_decide.unwrap();
    assert!(longer > 1.0, "{longer}");
    let enough = of_drive(1, (10.0 * longer * 1.5) as usize, 1.0);
    assert_eq!(enough.kind, Consistent);
}

/// Without a covariance, and with states whose errors are the same, the sum of squares has fewer degrees of freedom; a state
/// that is not known is not counted.
#[test]
fn states_whose_errors_are_the_same_are_one() {
    let alike: Vec<NormalisedErrors> = drive(5, 100, 1.0)
        .into_iter()
        .map(|e| NormalisedErrors {
            over_sigma: std::array::from_fn(|i| if i < 3 { e.over_sigma[0] } else { f64::NAN }),
            nees: None,
            ..e
        })
        .collect();
    let verdict = Verdict::of_drive(&alike, &[]).unwrap().verdict;
    let one = SampleSize::of_series([alike.iter().map(|e| e.over_sigma[0])].into_iter());
    assert_relative_eq!(
        verdict.independent_samples * 3.0,
        one.independent,
        max_relative = 1e-9
    );
    assert!(Verdict::of_drive(&[], &[]).is_none());
}

/// Rows at 1 Hz and a fix at 100 s: the row at 99 s is the last without it, and its errors are the outage's.
#[test]
fn an_outage_ends_before_its_fix() {
    let mut errors = drive(1, 10, 1.0);
    errors[99].over_sigma = [3.0; REPORTED];
    errors[100].over_sigma = [0.1; REPORTED];
    let outage = Outage {
        start_s: 50.0,
        end_s: 100.0,
    };
    let found = Verdict::of_drive(&errors, &[outage]).unwrap();
    assert_eq!(found.outages[0].ratio, 3.0);
}
