//! The errors of the specific force that the filters of runs take, as a few functions of time.
//!
//! A filter turns what its accelerometers measure, off by δb, by an attitude that is off by ψ: it takes f + δf with δf = ψ × f + C δb. The
//! two belong together: what a constant bias does and the tilt that the filter has for it cancel, as positions never tell them
//! apart. Along a track δf is a normal process, δf(t) = Σ ξ_k φ_k(t), with ξ_k independent of variance 1 and φ_k the eigenfunctions of its
//! covariance between instants (Karhunen-Loève, [Loève](crate::bibliography::Loeve78)). White noise of single samples, which the next does not
//! know of, is not in it.
//!
//! The mean of a quadratic function of δf is the sum of its values at the φ_k, of which there are hundreds, or the mean of its values at
//! N sums Σ ±φ_k, the signs those of the rows of a Hadamard matrix: products of two φ cancel in it, but for those whose numbers differ by a
//! multiple of N (a two-level design, [Plackett and Burman](crate::bibliography::PlackettBurman46)). The eigenfunctions are in the order of their
//! size, so that the large ones are not among those.

use super::branch::Pass;
use super::input::Sources;
use super::mean::Mean;
use super::sides::Sides;
use super::track::Track;
use super::truth::TruthSide;
use crate::ekf::Belief;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// The time between the instants at which the error is looked at (s), at the start; it stays as it is between them.
const INTERVAL_S: f64 = 1.0;
/// The same later, as a share of the time from the start: errors change ever more slowly as they settle.
const INTERVAL: f64 = 1.0 / 30.0;

/// `count` functions of time (m/s for a sample; a power of two of them) over the legs to the first `marks` marks of a track, as above; none
/// without marks.
pub(super) fn paths(
    track: &Track,
    belief: &Belief,
    truth: &TruthSide,
    marks: usize,
    count: usize,
) -> Vec<Vec<DVec3>> {
    let believed = Sources::of_belief(belief);
    let sides = Sides::of_errors(&believed, &truth.inertial, track);
    let own = Sides::of_filter(believed, track);
    let mut pass = Pass::new(track, &own, &sides, truth);
    // Of every instant so far, axis after axis: covariances of the present with the error of then.
    let mut past: Vec<Mean<'_>> = Vec::new();
    // Rows of the lower triangle of the covariance between instants, the diagonal blocks whole.
    let mut rows: Vec<Vec<f64>> = Vec::new();
    // The instant that each leg belongs to, and how long each instant lasts.
    let (mut instants, mut lasting) = (Vec::with_capacity(marks), Vec::<f64>::new());
    let (mut now_s, mut next_s) = (0.0, 0.0);
    for (steps, mark) in track.legs(0..marks) {
        if let Some(step) = steps.first().filter(|_| now_s >= next_s) {
            let errors = [0, 1, 2].map(|axis| pass.errors.joint.force_error(axis, step));
            past.extend(errors.iter().map(|error| pass.errors.joint.correlated(error)));
            rows.extend(errors.map(|error| past.iter().map(|then| error.dot(&then.values)).collect()));
            next_s = now_s + f64::max(INTERVAL_S, INTERVAL * now_s);
            lasting.push(0.0);
        }
        instants.push(lasting.len().saturating_sub(1));
        lasting.last_mut().into_iter().for_each(|time| *time += mark.after_s - now_s);
        pass.follow(steps);
        steps.iter().for_each(|step| past.iter_mut().for_each(|then| then.step(step)));
        for row in &mark.rows {
            let (gain, _) = pass.filter.measure(row);
            let measured = pass.errors.joint.measured(row);
            pass.errors.measure(row, &gain);
            past.iter_mut().for_each(|then| then.correct(measured.dot(&then.values), &gain));
        }
        now_s = mark.after_s;
    }
    if rows.is_empty() {
        return Vec::new();
    }
    // Eigenfunctions of the integral over time: each instant has the weight of the time that it lasts, half of it on either side.
    let weights: Vec<f64> = (0..rows.len()).map(|i| lasting[i / 3].sqrt()).collect();
    let weighted = |i: usize, j: usize| weights[i] * weights[j] * rows[i.max(j)][i.min(j)];
    let eigen = DMatrix::from_fn(rows.len(), rows.len(), weighted).symmetric_eigen();
    let mut order: Vec<usize> = (0..rows.len()).filter(|k| eigen.eigenvalues[*k] > 0.0).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let path = |row: usize| {
        // Sylvester's matrix: the parity of the digits that the numbers of row and column share.
        let signed = order.iter().enumerate().map(|(k, mode)| {
            let sign = if (k & row).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * eigen.eigenvalues[*mode].sqrt() * eigen.eigenvectors.column(*mode)
        });
        let error: DVector<f64> = signed.sum();
        let at = |instant: usize| DVec3::from_slice(&error.as_slice()[3 * instant..]) / weights[3 * instant];
        instants.iter().map(|instant| at(*instant)).collect()
    };
    (0..count).map(path).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::{Ar1, Composite, Model, Process, White};
    use crate::scenario::Scenario;
    use crate::sensors::imu::Truth;
    use crate::sensors::outage::Outage;
    use crate::trajectory::Trajectory;
    use crate::trajectory::profile::{Bank, Kind, Length, Profile, Segment, Start};
    use glam::DMat3;

    const SECONDS: usize = 100;
    const RATE_HZ: f64 = 100.0;

    fn standing() -> Trajectory {
        let start = Start { t_s: 0.0, lat: 0.8, lon: 0.1, h: 300.0, heading: 0.7, speed: 0.0 };
        let length = Length::Duration(SECONDS as f64 + 1.0);
        let segments = vec![Segment { kind: Kind::Straight(length), climb_m: 0.0, ramp_s: None }];
        Profile { start, bank: Bank::None, ramp_s: 1.0, segments }.build().unwrap()
    }

    /// An IMU whose own noise is far below what the tests look at.
    fn quiet() -> Model {
        let axis = |sigma2: f64, innovation: f64| {
            let bias = Process::Ar1(Ar1::new(0.9999, innovation).unwrap());
            Composite::new(vec![Process::White(White::new(sigma2).unwrap()), bias])
        };
        Model::pooled(RATE_HZ, &axis(5.4e-7, 1e-13), &axis(2e-10, 4e-18))
    }

    /// Errors of the full filter at rest (m/s²), for a true IMU that is quiet.
    fn at_rest(settings: &str, outages: &[Outage]) -> Vec<Vec<DVec3>> {
        let scenario = toml::from_str::<Scenario>(settings).unwrap().with_full_noise();
        let (path, model) = (standing(), quiet());
        let track = scenario.track(&path, &model, outages).unwrap().merged();
        let beliefs = [scenario.belief(&model, outages, &track).unwrap()];
        let experiment = scenario.experiment(&path, Truth::Model(&model), &beliefs, outages, 1);
        let truth = TruthSide::together(&TruthSide::sources(&experiment, &model));
        let mut paths = paths(&track, &beliefs[0], &truth, SECONDS + 1, 8);
        paths.iter_mut().flatten().for_each(|error| *error *= RATE_HZ);
        paths
    }

    /// Mean product of the errors in two legs.
    fn covariance(paths: &[Vec<DVec3>], leg: usize, other: usize) -> DMat3 {
        let product = |path: &Vec<DVec3>| {
            let (a, b) = (path[leg], path[other]);
            DMat3::from_cols(a * b.x, a * b.y, a * b.z)
        };
        paths.iter().map(product).sum::<DMat3>() * (1.0 / paths.len() as f64)
    }

    /// Without fixes a tilt of 0.5° about each level axis stands still: the errors have the covariance (gσ)² north and east, in any two
    /// legs. The Earth turns a tilt by ωT = 0.7 % into one that gravity does not show.
    #[test]
    fn tilts_alone_stand_still() {
        let outage = Outage { start_s: 0.0, end_s: SECONDS as f64 };
        let paths = at_rest("initial.att_sigma_deg = [0.5, 0.5, 0.01]", &[outage]);
        let square = (9.808 * 0.5_f64.to_radians()).powi(2);
        let closed = DMat3::from_diagonal(DVec3::new(square, square, 0.0));
        for (leg, other) in [(1, 1), (1, SECONDS), (SECONDS / 2, SECONDS / 3), (SECONDS, SECONDS)] {
            let off = covariance(&paths, leg, other) - closed;
            assert!(off.abs_diff_eq(DMat3::ZERO, 0.02 * square), "{leg}, {other}: {off} of {square}");
        }
    }

    /// A turn-on bias of the accelerometers and the tilt that the filter takes for it cancel: what is left of the horizontal force is
    /// no less than fixes of 1.5 m can tell of a constant within 99 s, √720 σ / (T² √n) = 4e-4 m/s² for the curvature of n positions over T, and
    /// not twice as much; the bias alone is 0.2 m/s².
    #[test]
    fn a_bias_and_the_tilt_that_stands_for_it_cancel() {
        let settings = "imu = { turn_on_bias_accel_m_s2 = 0.2, turn_on_bias_gyro_rad_s = 0 }
            gnss.pos_sigma_m = [1.5, 1.5, 1.5]";
        let left = covariance(&at_rest(settings, &[]), SECONDS, SECONDS);
        let told = 720.0_f64.sqrt() * 1.5 / (99.0 * 99.0 * 99.0_f64.sqrt());
        for (axis, square) in [left.x_axis.x, left.y_axis.y].into_iter().enumerate() {
            assert!((1.0..2.0).contains(&(square.sqrt() / told)), "axis {axis}: {} of {told}", square.sqrt());
        }
    }
}
