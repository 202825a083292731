//! Eight runs through the schedule: noise, prediction, fixes, and what is kept of them.

use super::gains::{GainsUsed, SharedFilter};
use super::plan::{Event, Plan};
use super::source::{LaneMeasurements, LaneSource};
use super::{BIASES, COVERAGE_DOF, EpochSums, NEES_DOF, OutageRecord, REPORTED, RunRecord};
use crate::earth::ned_difference;
use crate::ekf::covariance::{PSI, R, V};
use crate::ekf::{
    BodyVelocity, Ekf, FilterModel, GainSource, advance, apply_pending_earth_step, update,
    update_body_velocity, update_height, update_yaw,
};
use crate::frames::{NavState, RollPitchYaw};
use crate::imu::Sensor;
use crate::lanes::{LANES, Lanes, Real, Vec3};
use crate::linalg::mean;
use crate::sensors::aiding::Aid;
use crate::strapdown::Strapdown;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// The errors of one candidate in up to eight runs.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Sums over the runs that did not diverge, one an epoch.
    pub epochs: Vec<EpochSums>,
    /// One record a run.
    pub runs: Vec<RunRecord>,
    /// The gains of the filter.
    pub gains: GainsUsed,
}

/// A filter, and the same along the reference where runs share its gains.
pub(super) type BatchFilter<'a> = (&'a FilterModel, Option<&'a SharedFilter>);

/// Runs `first..first + live` (at most [`LANES`]) through filters: the noise is drawn once.
pub(super) fn run_candidates(
    plan: &Plan<'_>,
    first: u64,
    live: usize,
    filters: &[BatchFilter<'_>],
) -> Vec<Batch> {
    let mut source = LaneSource::new(plan, first, live);
    let starts = source.starts(plan);
    let mut candidates: Vec<LaneFilter<'_>> = filters
        .iter()
        .map(|filter| LaneFilter::new(plan, *filter, &starts, live))
        .collect();
    let mut done = 0;
    for (index, event) in plan.events.iter().enumerate() {
        let samples = &plan.ideal[done..event.sample];
        let measured = source.measured(plan, event);
        // Drawn once for all candidates: their errors are paired, and ratios between them scatter far less
        // than each.
        let errors = source.errors(plan, done..event.sample);
        for candidate in &mut candidates {
            advance(&mut candidate.ekf, samples, errors);
            candidate.at_event(plan, index, event, &measured);
        }
        done = event.sample;
    }
    candidates.into_iter().map(|c| c.finish(first)).collect()
}

/// Uses all measurements of an instant; returns the NIS of the fix.
fn measure(ekf: &mut Ekf, plan: &Plan<'_>, measured: &LaneMeasurements) -> Option<Lanes> {
    let nis = measured.fix.as_ref().map(|fix| update(ekf, fix));
    if let (Some(h), Some(baro)) = (&measured.height, plan.experiment.baro) {
        let _ = update_height(ekf, h, baro.sigma_m);
    }
    for (aid, value) in &measured.aids {
        use_aid(ekf, plan, *aid, value);
    }
    nis
}

fn use_aid(ekf: &mut Ekf, plan: &Plan<'_>, aid: Aid, value: &Vec3) {
    let aiding = plan.experiment.aiding;
    let variance = aiding.sigmas(aid)[0].powi(2);
    if aid == Aid::Heading {
        let _ = update_yaw(ekf, &value[0], variance);
        return;
    }
    let lever_arm_b = aiding.lever_arm_b(aid);
    let velocity = BodyVelocity {
        value: *value,
        axes: aid.axes(),
        variance,
        lever_arm_b,
        vehicle_b: DVec3::AXES,
    };
    let _ = update_body_velocity(ekf, &velocity);
}

/// One filter on eight runs, and what is kept of it.
struct LaneFilter<'a> {
    ekf: Ekf,
    /// The filter along the reference, if runs share its gains.
    shared: Option<&'a SharedFilter>,
    live: usize,
    trace: Vec<EpochLanes>,
    /// A record for each outage and run.
    outages: Vec<[OutageRecord; LANES]>,
    /// Sum of the NIS of the fixes, and their number.
    nis: (Lanes, u64),
}

impl<'a> LaneFilter<'a> {
    fn new(
        plan: &Plan<'_>,
        (filter_model, shared): BatchFilter<'a>,
        starts: &[NavState],
        live: usize,
    ) -> Self {
        let mut nominal = Strapdown::new(&plan.start, plan.experiment.gravity);
        for (lane, start) in starts.iter().enumerate() {
            nominal.set_lane(lane, start);
        }
        let outage = |(reports, _): &(f64, usize)| {
            std::array::from_fn(|_| OutageRecord {
                // NaN without a report
                see_mean: [0.0 / reports; REPORTED],
                reconvergence_s: f64::NAN,
                ..Default::default()
            })
        };
        let mut ekf = Ekf::new(nominal, filter_model, &plan.start, plan.experiment.initial)
            .with_update(plan.experiment.update);
        if shared.is_some() {
            ekf.gains = GainSource::Given(Arc::default(), 0);
        }
        Self {
            ekf,
            shared,
            live,
            trace: Vec::with_capacity(plan.events.len()),
            outages: plan.outages.iter().map(outage).collect(),
            nis: (Lanes::ZERO, 0),
        }
    }

    /// Outage ends, the fix if one is used, the report if one is due.
    fn at_event(
        &mut self,
        plan: &Plan<'_>,
        index: usize,
        event: &Event,
        measured: &LaneMeasurements,
    ) {
        let shared = self.shared.map(|shared| &shared[index]);
        if let Some(shared) = shared {
            shared
                .before
                .iter()
                .for_each(|p| self.ekf.p.set_navigation(p));
            self.ekf.gains = GainSource::Given(shared.updates.clone(), 0);
        }
        // Before the fix of the same instant: the end of an outage is where the error is largest.
        self.end_outages(plan, index, event);
        if let Some(nis) = measure(&mut self.ekf, plan, measured) {
            self.nis.0 += nis;
            self.nis.1 += 1;
        }
        if event.report {
            let mut biases = None;
            if let Some((p, shared)) = shared.and_then(|shared| shared.after.as_ref()) {
                self.ekf.p.set_navigation(p);
                biases = Some(shared.map(Lanes::splat));
            }
            apply_pending_earth_step(&mut self.ekf);
            let epoch = EpochLanes::of(&self.ekf, biases, self.live, plan, event);
            self.follow_outages(plan, event, &epoch);
            self.trace.push(epoch);
        }
    }

    /// Error and belief just before the first fix after an outage, or at the trajectory's end.
    fn end_outages(&mut self, plan: &Plan<'_>, index: usize, event: &Event) {
        if !plan.ends_outage(index) {
            return;
        }
        apply_pending_earth_step(&mut self.ekf);
        let found = LaneAssessment::of(&self.ekf, self.live, &event.reference);
        let log_density = found.log_density(&self.ekf);
        for (_, records) in plan
            .outages
            .iter()
            .zip(&mut self.outages)
            .filter(|((_, end), _)| *end == index)
        {
            for (lane, record) in records.iter_mut().enumerate().take(self.live) {
                record.see_end = found.see.map(|s| s[lane]);
                record.error_end = found.error.map(|e| e[lane]);
                record.nees_end = found.nees[lane];
                record.log_density_end = log_density[lane];
                record.horizontal_error_end_m = record.error_end[0].hypot(record.error_end[1]);
            }
        }
    }

    /// Means over outages, and when the horizontal error is back within the receiver's own.
    fn follow_outages(&mut self, plan: &Plan<'_>, event: &Event, epoch: &EpochLanes) {
        let [n, e, _] = plan.experiment.gnss.pos_sigma_m;
        // The deviation of a single fix: an error below it can no longer be told from the receiver's.
        let receiver = n.hypot(e);
        let outages = plan.experiment.outages.iter().zip(&plan.outages);
        for ((outage, (reports, _)), records) in outages.zip(&mut self.outages) {
            let inside = outage.withholds(event.t_s);
            let after = outage.is_over(event.t_s);
            for lane in 0..self.live {
                let record = &mut records[lane];
                if inside {
                    for i in 0..REPORTED {
                        record.see_mean[i] += epoch.see[i][lane] / reports;
                    }
                }
                let horizontal = epoch.error[0][lane].hypot(epoch.error[1][lane]);
                if after && record.reconvergence_s.is_nan() && horizontal <= receiver {
                    record.reconvergence_s = event.t_s - outage.end_s;
                }
            }
        }
    }

    /// Sums over the runs that did not diverge, and a record of each run.
    fn finish(self, first: u64) -> Batch {
        // Looked for at the reports alone: what has become NaN stays NaN, so that a divergence between two
        // reports is seen at the next.
        let diverged: [bool; LANES] = std::array::from_fn(|lane| {
            let finite = |e: &EpochLanes| {
                e.nees[lane].is_finite()
                    && e.see
                        .iter()
                        .chain(&e.error)
                        .all(|value| value[lane].is_finite())
            };
            !self.trace.iter().all(finite)
        });
        let kept: Vec<usize> = (0..self.live).filter(|lane| !diverged[*lane]).collect();
        let has_first = first == 0 && kept.first() == Some(&0);
        let sum = |e: &EpochLanes| EpochSums {
            first_error: has_first.then(|| e.error.map(|error| error[0])),
            ..e.sum(&kept)
        };
        let epochs = self.trace.iter().map(sum).collect();
        let mean = |value: &dyn Fn(&EpochLanes) -> f64| mean(self.trace.iter().map(value));
        let record = |lane: usize| RunRecord {
            run: first + lane as u64,
            diverged: diverged[lane],
            outages: self
                .outages
                .iter()
                .map(|records| records[lane].clone())
                .collect(),
            nis: (self.nis.0[lane] / self.nis.1.max(1) as f64, self.nis.1),
            nees_mean: mean(&|e| e.nees[lane]),
            covered: mean(&|e| f64::from(u8::from(e.covered[lane]))),
            normalised_sq: std::array::from_fn(|i| {
                mean(&|e| (e.error[i][lane] / e.see[i][lane]).powi(2))
            }),
        };
        Batch {
            epochs,
            runs: (0..self.live).map(record).collect(),
            gains: GainsUsed {
                is_shared: self.shared.is_some(),
                largest_difference: None,
            },
        }
    }
}

/// Standard deviations of the reported states: metres, m/s, degrees of roll, pitch, yaw through the
/// Jacobian at the true attitude.
fn standard_deviations(ekf: &Ekf, jacobian: &[DVec3; 3]) -> [Lanes; REPORTED] {
    let (r, v) = (ekf.p.variances(R), ekf.p.variances(V));

    std::array::from_fn(|i| match i {
        0..3 => r[i].sqrt(),
        3..6 => v[i - 3].sqrt(),
        _ => {
            let j = jacobian[i - 6];
            let variance = (0..9).fold(Lanes::ZERO, |sum, k| {
                let covariance: Lanes = ekf.p.get(3 * PSI + k / 3, 3 * PSI + k % 3);
                sum + covariance * (j[k / 3] * j[k % 3])
            });
            variance.sqrt() * (1.0 / DEG)
        }
    })
}

// How far eight runs are from the reference, and how far their filters believe they are.

/// Errors and beliefs of eight runs at one instant; the covariance must be settled.
struct LaneAssessment {
    /// The filter's own standard deviation of each reported state (m, m/s, degrees).
    see: [Lanes; REPORTED],
    /// Error of each reported state, estimate − truth (m, m/s, degrees).
    error: [Lanes; REPORTED],
    /// Rotation from the true to the estimated attitude (degrees).
    att_error_deg: Lanes,
    /// Position (m), velocity (m/s) and attitude error (rad), in the order of the filter's states.
    navigation: [Lanes; NEES_DOF],
    /// Normalised estimation error squared of position, velocity and attitude.
    nees: Lanes,
}

impl LaneAssessment {
    /// Logarithm of the density of the errors under the filter's belief.
    fn log_density(&self, ekf: &Ekf) -> Lanes {
        ekf.p
            .log_density(std::array::from_fn(|i| i), self.navigation)
    }

    /// The assessment of the first `live` lanes against the reference; the other lanes are zero.
    fn of(ekf: &Ekf, live: usize, reference: &NavState) -> Self {
        let jacobian = RollPitchYaw::from_quat(reference.q_b_n).jacobian_of_psi_n();
        let mut found = Self {
            see: standard_deviations(ekf, &jacobian),
            error: [Lanes::ZERO; REPORTED],
            att_error_deg: Lanes::ZERO,
            navigation: [Lanes::ZERO; NEES_DOF],
            nees: Lanes::ZERO,
        };
        for lane in 0..live {
            let (values, psi_n) = reported_error(&ekf.nominal.lane(lane), reference);
            for i in 0..REPORTED {
                found.error[i][lane] = values[i];
                found.navigation[i][lane] = if i < 6 { values[i] } else { psi_n[i - 6] };
            }
            found.att_error_deg[lane] = psi_n.length() / DEG;
        }
        // With psi_n (rad), not with roll, pitch, yaw: NEES is invariant under the Jacobian, which is
        // singular at pitch ±90°.
        found.nees = ekf
            .p
            .normalised_square(std::array::from_fn(|i| i), found.navigation);
        found
    }
}

/// Reported values of eight runs at one epoch.
struct EpochLanes {
    t_s: f64,
    gnss: bool,
    see: [Lanes; REPORTED],
    /// The filter's own standard deviation of each sensor's bias (m/s², rad/s).
    bias_see: [Lanes; BIASES],
    error: [Lanes; REPORTED],
    att_error_deg: Lanes,
    nees: Lanes,
    covered: [bool; LANES],
}

impl EpochLanes {
    /// Reported values of the first `live` lanes at an event.
    fn of(
        ekf: &Ekf,
        shared_biases: Option<[Lanes; BIASES]>,
        live: usize,
        plan: &Plan<'_>,
        event: &Event,
    ) -> Self {
        let found = LaneAssessment::of(ekf, live, &event.reference);
        let states: [usize; COVERAGE_DOF] =
            std::array::from_fn(|i| if i < 3 { 3 * R + i } else { 3 * PSI + i - 3 });
        let coverage = ekf
            .p
            .normalised_square(states, states.map(|s| found.navigation[s]));
        let own = || {
            let [accel, gyro] = Sensor::ALL.map(|sensor| ekf.bias_sigma(sensor).0);
            std::array::from_fn(|i| if i < 3 { accel[i] } else { gyro[i - 3] })
        };
        Self {
            t_s: event.t_s,
            gnss: event.fix,
            see: found.see,
            bias_see: shared_biases.unwrap_or_else(own),
            error: found.error,
            att_error_deg: found.att_error_deg,
            nees: found.nees,
            // The filter's own ellipsoid at the level: eᵀ P⁻¹ e below the χ² quantile of six degrees of
            // freedom.
            covered: std::array::from_fn(|lane| coverage[lane] <= plan.coverage_quantile),
        }
    }

    fn sum(&self, kept: &[usize]) -> EpochSums {
        let mut sums = EpochSums {
            t_s: self.t_s,
            gnss: self.gnss,
            ..EpochSums::default()
        };
        for &lane in kept {
            sums.count += 1;
            for i in 0..REPORTED {
                let (see, error) = (self.see[i][lane], self.error[i][lane]);
                sums.see[i] += see;
                sums.see_sq[i] += see * see;
                sums.error[i] += error;
                sums.error_sq[i] += error * error;
                sums.error_4[i] += error.powi(4);
            }
            for (sum, see) in sums.bias_see.iter_mut().zip(&self.bias_see) {
                *sum += see[lane];
            }
            let position = DVec3::new(
                self.error[0][lane],
                self.error[1][lane],
                self.error[2][lane],
            )
            .length();
            for (sum, value) in [
                (&mut sums.pos_error, position),
                (&mut sums.att_error, self.att_error_deg[lane]),
                (&mut sums.nees, self.nees[lane]),
            ] {
                sum[0] += value;
                sum[1] += value * value;
            }
            sums.covered += u64::from(self.covered[lane]);
        }
        sums
    }
}

/// Errors of a run in the reported states (m, m/s, degrees) and the attitude error vector (rad).
pub(crate) fn reported_error(estimate: &NavState, truth: &NavState) -> ([f64; REPORTED], DVec3) {
    let r = ned_difference(truth.place(), estimate.place());
    let v = estimate.v_n - truth.v_n;
    // C_est = (I + [psi×]) C_true, hence the estimate on the left: the same error vector as the filter's PSI
    // block.
    let psi_n = rotation_vector(estimate.q_b_n * truth.q_b_n.inverse());
    let jacobian = RollPitchYaw::from_quat(truth.q_b_n).jacobian_of_psi_n();
    // Through the Jacobian, not as a difference of Euler angles: linear as the filter's own deviation is, and
    // no angle wraps at ±180°.
    let angles = jacobian.map(|row| row.dot(psi_n) / DEG);
    let of = [r.to_array(), v.to_array(), angles];
    (std::array::from_fn(|i| of[i / 3][i % 3]), psi_n)
}

/// The rotation vector of a rotation (rad), the logarithm, exact for small ones too.
fn rotation_vector(q: DQuat) -> DVec3 {
    // q and −q are the same rotation: the one with w ≥ 0 is the shorter way.
    let (v, w) = (q.xyz() * 1.0_f64.copysign(q.w), q.w.abs());
    let sine = v.length();
    // Below it atan2(s, w)/s is 1 to rounding, and 0/0 is avoided.
    if sine < 1e-12 {
        v * 2.0
    } else {
        v * (2.0 * sine.atan2(w) / sine)
    }
}
