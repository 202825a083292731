//! The numbers of a unit file, eight bytes each: integers and floating point, little-endian.

use nav_sim_navigation::metrics::{
    EpochMetrics, Estimate, Expected, OutageMetrics, PerState, Quantile, Reconvergence,
};
use nav_sim_navigation::simulation::{BIASES, EpochSums, OutageRecord, REPORTED, RunRecord};

/// Numbers of an outage record, an epoch, and a run without its outages.
pub(super) const OUTAGE: usize = 3 * REPORTED + 4;
pub(super) const EPOCH: usize = 4 + 5 * REPORTED + BIASES + 6;
pub(super) const RUN: usize = 7 + REPORTED;
/// Numbers of an outage and an epoch of a covariance analysis.
pub(super) const EXPECTED_OUTAGE: usize = 4 * REPORTED + 6;
pub(super) const EXPECTED_EPOCH: usize = 3 * REPORTED + BIASES + 6;

fn put(bytes: &mut Vec<u8>, values: &[f64]) {
    values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
}

pub(super) fn put_run(bytes: &mut Vec<u8>, run: &RunRecord) {
    for word in [run.run, u64::from(run.diverged), run.nis.1, run.rejected] {
        bytes.extend(word.to_le_bytes());
    }
    put(bytes, &[run.nis.0, run.nees_mean, run.covered]);
    put(bytes, &run.normalised_sq);
    for o in &run.outages {
        put(bytes, &o.see_mean);
        put(bytes, &o.see_end);
        put(bytes, &o.error_end);
        put(bytes, &[o.nees_end, o.log_density_end, o.horizontal_error_end_m, o.reconvergence_s]);
    }
}

pub(super) fn put_epoch(bytes: &mut Vec<u8>, e: &EpochSums) {
    for word in [u64::from(e.gnss), e.count, e.covered] {
        bytes.extend(word.to_le_bytes());
    }
    put(bytes, &[e.t_s]);
    for sums in [&e.see, &e.see_sq, &e.error, &e.error_sq, &e.error_4] {
        put(bytes, sums);
    }
    put(bytes, &e.bias_see);
    for sums in [&e.pos_error, &e.att_error, &e.nees] {
        put(bytes, sums);
    }
}

/// What is expected; its outages by their own numbers, since their record has not all of them.
pub(super) fn put_expected(bytes: &mut Vec<u8>, expected: &Expected) {
    put_run(bytes, &expected.record);
    for o in &expected.outages {
        for states in [&o.asee_mean, &o.rmse_mean, &o.asee_end, &o.rmse_end] {
            put(bytes, &states.0.map(|e| e.value));
        }
        let p999 = o.horizontal_p999_m.unwrap_or(f64::NAN);
        put(bytes, &[o.nees_end.value, o.log_density_end.value]);
        put(bytes, &[o.horizontal_p50_m.value, o.horizontal_p95_m.value, p999]);
        bytes.extend(u64::from(o.beyond_linear).to_le_bytes());
    }
    for e in &expected.epochs {
        put(bytes, &[e.t_s]);
        bytes.extend(u64::from(e.gnss).to_le_bytes());
        for states in [&e.asee, &e.rmse, &e.bias] {
            put(bytes, &states.0.map(|e| e.value));
        }
        put(bytes, &e.bias_asee);
        put(bytes, &[e.mean_pos_err_m.value, e.mean_att_err_deg.value, e.nees.value, e.coverage]);
    }
}

/// Eight bytes at a time; the length was checked before.
pub(super) struct Words<'a>(pub(super) &'a [u8]);

impl Words<'_> {
    fn int(&mut self) -> u64 {
        let Some((word, rest)) = self.0.split_first_chunk::<8>() else { return 0 };
        self.0 = rest;
        u64::from_le_bytes(*word)
    }

    fn float(&mut self) -> f64 {
        f64::from_bits(self.int())
    }

    fn exact(&mut self) -> Estimate {
        Estimate { value: self.float(), std_error: 0.0 }
    }

    fn states(&mut self) -> PerState<Estimate> {
        PerState(std::array::from_fn(|_| self.exact()))
    }

    fn quantile(&mut self) -> Quantile {
        Quantile { value: self.float(), ci95: (None, None) }
    }

    fn floats<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.float())
    }
}

pub(super) fn run(outages: usize, words: &mut Words<'_>) -> RunRecord {
    let (run, diverged, fixes, rejected) = (words.int(), words.int() != 0, words.int(), words.int());
    let nis = (words.float(), fixes);
    let (nees_mean, covered, normalised_sq) = (words.float(), words.float(), words.floats());
    let outage = |_| OutageRecord {
        see_mean: words.floats(),
        see_end: words.floats(),
        error_end: words.floats(),
        nees_end: words.float(),
        log_density_end: words.float(),
        horizontal_error_end_m: words.float(),
        reconvergence_s: words.float(),
    };
    let outages = (0..outages).map(outage).collect();
    RunRecord {
        run,
        diverged,
        outages,
        nis,
        rejected,
        nees_mean,
        covered,
        normalised_sq,
        horizontal_m: Vec::new(),
    }
}

pub(super) fn epoch(words: &mut Words<'_>) -> EpochSums {
    let (gnss, count, covered) = (words.int() != 0, words.int(), words.int());
    EpochSums {
        gnss,
        count,
        covered,
        t_s: words.float(),
        see: words.floats(),
        see_sq: words.floats(),
        error: words.floats(),
        error_sq: words.floats(),
        error_4: words.floats(),
        bias_see: words.floats(),
        pos_error: words.floats(),
        att_error: words.floats(),
        nees: words.floats(),
    }
}

/// An outage of a covariance analysis.
pub(super) fn expected_outage((start_s, end_s): (f64, f64), words: &mut Words<'_>) -> OutageMetrics {
    let unknown = Quantile { value: f64::NAN, ci95: (None, None) };
    OutageMetrics {
        start_s,
        end_s,
        asee_mean: words.states(),
        rmse_mean: words.states(),
        asee_end: words.states(),
        rmse_end: words.states(),
        nees_end: words.exact(),
        log_density_end: words.exact(),
        horizontal_p50_m: words.quantile(),
        horizontal_p95_m: words.quantile(),
        horizontal_p999_m: Some(words.float()),
        horizontal_max_m: f64::NAN,
        beyond_linear: words.int() != 0,
        reconvergence: Reconvergence { p50_s: unknown, p95_s: unknown, never: None },
    }
}

/// An epoch of a covariance analysis.
pub(super) fn expected_epoch(words: &mut Words<'_>) -> EpochMetrics {
    EpochMetrics {
        t_s: words.float(),
        gnss: words.int() != 0,
        count: 0,
        asee: words.states(),
        rmse: words.states(),
        bias: words.states(),
        bias_asee: words.floats(),
        mean_pos_err_m: words.exact(),
        mean_att_err_deg: words.exact(),
        nees: words.exact(),
        coverage: words.float(),
    }
}
