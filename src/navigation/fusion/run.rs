//! A run of the filter through recorded data.

use super::gate::{Gate, GateDecision};
use super::vehicle::{force, rate};
use super::{
    AidRecord, DriveData, FixRecord, FusionError, FusionSettings, Nine, RowError, Solution,
    SolutionRow, Start, VehicleVelocity, check_clocks, spans,
};
use crate::earth::{MAX_LATITUDE, geodetic_to_ecef};
use crate::ekf::covariance::{PSI, R, V};
use crate::ekf::{
    BodyVelocity, Ekf, FilterModel, Fix, Snapshot, advance, apply_pending_earth_step, update,
    update_body_velocity,
};
use crate::frames::{NavState, RollPitchYaw};
use crate::gnss::GnssFix;
use crate::imu::{ImuIncrement, ImuSample, Sensor};
use crate::lanes::{Lanes, Vec3};
use crate::linalg::{Link, median, to_nalgebra};
use crate::sensors::outage::Outage;
use crate::simulation::reported_error;
use crate::strapdown::Strapdown;
use crate::trajectory::reference::Reference;
use crate::units::DEG;
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector, Matrix3, SVector};

/// Runs the filter through recorded data from `start`. A fix or an aid is applied at its own time: the sample it
/// falls into is split there. A sample much longer than the others bridges a gap (`Gap`). `reference` is only
/// compared with.
///
/// # Errors
/// Clocks that do not overlap, a start outside the data, a pole, divergence.
pub fn fuse(
    recorded: &DriveData<'_>,
    filter_model: &FilterModel,
    start: &Start,
    settings: &FusionSettings,
    reference: Option<&Reference>,
) -> Result<Solution, FusionError> {
    check_clocks(recorded)?;
    let imu = spans(recorded).0;
    if !(imu.0 - 1e-6..imu.1).contains(&start.t_s) {
        return Err(FusionError::Start {
            t_s: start.t_s,
            imu,
        });
    }
    check_place(recorded, start, settings)?;
    let mut filter = Filter::new(filter_model, start, settings);
    let tape = match settings.smooth {
        true => Some(SmootherHistory::new(
            &mut filter,
            start.t_s,
            most_marks(recorded, start, settings),
        )?),
        false => None,
    };
    let mut run = FusionPass {
        filter,
        tape,
        settings,
        reference,
        gate: Gate::new(settings.gate, recorded.gnss),
        now: start.t_s,
        next_row: start.t_s,
        solution: Solution::default(),
    };
    let mut bridges = GapFiller::new(recorded.imu);
    let mut fixes = recorded
        .gnss
        .iter()
        .skip_while(|f| f.t_s <= start.t_s)
        .peekable();
    let mut aids = recorded
        .aids
        .iter()
        .skip_while(|a| a.t_s <= start.t_s)
        .peekable();
    run.row()?;
    for sample in recorded.imu.iter().skip_while(|s| s.t_s <= start.t_s) {
        let spread = bridges.spread(sample);
        // a fix that is a millionth of a sample late belongs to its end
        let slack = 1e-6 * sample.dt_s;
        let end_s = sample.t_s + slack;
        loop {
            let fix_s = fixes.peek().map_or(f64::INFINITY, |f| f.t_s);
            if let Some(aid) = aids.next_if(|a| a.t_s <= end_s && a.t_s < fix_s) {
                run.advance(sample, spread, aid.t_s, slack);
                run.aid(aid)?;
            } else if let Some(fix) = fixes.next_if(|f| f.t_s <= end_s) {
                run.advance(sample, spread, fix.t_s, slack);
                run.fix(fix)?;
            } else {
                break;
            }
        }
        run.advance(sample, spread, sample.t_s, 0.0);
        run.solution.samples += 1;
        if sample.t_s + slack >= run.next_row {
            run.row()?;
        }
    }
    Ok(run.end())
}

/// Rows, fixes and aids that there will be at most.
fn most_marks(recorded: &DriveData<'_>, start: &Start, settings: &FusionSettings) -> f64 {
    let samples = recorded.imu.iter().filter(|s| s.t_s > start.t_s).count() as f64;
    let rows = (spans(recorded).0.1 - start.t_s) * settings.rows_hz;
    1.0 + rows.min(samples).ceil() + (recorded.gnss.len() + recorded.aids.len()) as f64
}

/// Refuses a start that its own and the receiver's deviations cannot explain: 10 km or 50 of both, beside
/// the way to the first fix.
fn check_place(
    recorded: &DriveData<'_>,
    start: &Start,
    settings: &FusionSettings,
) -> Result<(), FusionError> {
    const FAR: (f64, f64) = (10_000.0, 50.0);
    let Some(fix) = recorded.gnss.iter().find(|f| f.t_s >= start.t_s) else {
        return Ok(());
    };
    let seconds = fix.t_s - start.t_s;
    let place = geodetic_to_ecef(start.state.lat, start.state.lon, fix.h);
    let metres = geodetic_to_ecef(fix.lat, fix.lon, fix.h).distance(place);
    let [n, e, _] = start.sigma.pos_sigma_m;
    let sigma_m = n.hypot(e).hypot(fix.pos_sigma_n.truncate().length());
    // at twice the speed, accelerating with a gravity
    let way = 2.0 * start.state.v_n.length() * seconds + 5.0 * seconds * seconds;
    let allowed = FAR.0.min(FAR.1 * sigma_m) + way + settings.lever_arm_b.length();
    if metres > allowed {
        Err(FusionError::Place {
            t_s: fix.t_s,
            metres,
            sigma_m,
        })
    } else {
        Ok(())
    }
}

/// The state of a run through the data.
struct FusionPass<'a> {
    filter: Filter,
    tape: Option<SmootherHistory>,
    settings: &'a FusionSettings,
    reference: Option<&'a Reference>,
    gate: Gate,
    now: f64,
    next_row: f64,
    solution: Solution,
}

impl FusionPass<'_> {
    /// Through the sample as far as `to`, which is taken as the sample's end when it is nearly that.
    /// Where it bridges a gap, with the gap's uncertainty.
    fn advance(&mut self, sample: &ImuIncrement, spread: Option<Spread>, to: f64, slack: f64) {
        let to = if to + slack >= sample.t_s {
            sample.t_s
        } else {
            to
        };
        if to > self.now + slack {
            match spread {
                None => self.filter.advance(sample, to - self.now),
                Some(spread) => self.filter.cross(sample, to - self.now, spread),
            }
            self.now = to;
        }
    }

    fn fix(&mut self, fix: &GnssFix) -> Result<(), FusionError> {
        let mut record = self.filter.innovation_of(fix);
        record.error = self.error().map(|e| e.values);
        if Outage::any_withholds(&self.settings.outages, fix.t_s) {
            record.used = false;
        } else {
            match self.gate.pass(fix.t_s, record.nis, record.innovation.len()) {
                GateDecision::Rejected(bound) => {
                    (record.used, record.rejected_above) = (false, Some(bound));
                }
                GateDecision::Reopened => self.solution.gate_reopened_s.push(fix.t_s),
                GateDecision::Used => {}
            }
        }
        if record.used {
            self.record_update(|filter| filter.update(fix));
        }
        let nis = record.nis;
        self.solution.fixes.push(record);
        self.finite(nis)
    }

    /// Refuses to go on with what is not a number.
    fn finite(&self, value: f64) -> Result<(), FusionError> {
        let diverged = FusionError::Diverged { t_s: self.now };
        value.is_finite().then_some(()).ok_or(diverged)
    }

    /// An update of the filter, which a tape records if there is one.
    fn record_update<T>(&mut self, update: impl FnOnce(&mut Filter) -> T) -> T {
        match &mut self.tape {
            Some(tape) => tape.fix(&mut self.filter, self.now, update),
            None => update(&mut self.filter),
        }
    }

    /// Uses what the vehicle knows of its velocity.
    fn aid(&mut self, aid: &VehicleVelocity) -> Result<(), FusionError> {
        apply_pending_earth_step(&mut self.filter.ekf);
        let record = self.record_update(|filter| filter.aid(aid));
        let nis = record.nis();
        self.solution.aids.push(record);
        self.finite(nis)
    }

    fn row(&mut self) -> Result<(), FusionError> {
        self.next_row = (self.next_row + 1.0 / self.settings.rows_hz).max(self.now);
        let mut row = self.filter.row(self.now);
        self.finite(row.sigma.iter().sum::<f64>() + row.state.q_b_n.length())?;
        if row.state.lat.abs() > MAX_LATITUDE {
            return Err(FusionError::Pole {
                t_s: self.now,
                lat_deg: row.state.lat / DEG,
            });
        }
        row.error = self.error();
        self.solution.rows.push(row);
        if let Some(tape) = &mut self.tape {
            tape.row(&mut self.filter, self.now);
        }
        Ok(())
    }

    /// Solution; smoothed if the states were recorded.
    fn end(self) -> Solution {
        let Self {
            mut filter,
            tape,
            mut solution,
            reference,
            ..
        } = self;
        solution.vehicle = filter.ekf.vehicle_estimates();
        solution.smoothed = tape.map(|tape| tape.smoothed(&mut filter, &solution.rows, reference));
        solution
    }

    /// Difference from the reference now, if it reaches here.
    fn error(&mut self) -> Option<RowError> {
        self.filter.error_from(self.reference?, self.now)
    }
}

// The one place where recorded data meet the filter: one run, the same in all lanes.

/// Longest step through a gap (s): the filter is linear within one.
const BRIDGE_STEP_S: f64 = 0.1;

/// The filter in the axes of the IMU.
struct Filter {
    pub ekf: Ekf,
    q_s_b: DQuat,
    mounting_sigma_b: DVec3,
    lever_arm_s: DVec3,
}

impl Filter {
    fn new(filter_model: &FilterModel, start: &Start, settings: &FusionSettings) -> Self {
        let q_s_b = settings.q_s_b;
        let of_imu = NavState {
            q_b_n: start.state.q_b_n * q_s_b,
            ..start.state
        };
        let nominal = Strapdown::new(&of_imu, settings.gravity);
        Self {
            // roll, pitch and yaw are those of the vehicle: their deviations go to n at its attitude
            ekf: Ekf::new(nominal, filter_model, &start.state, &start.sigma),
            q_s_b,
            mounting_sigma_b: settings.mounting_sigma_b,
            lever_arm_s: q_s_b.inverse() * settings.lever_arm_b,
        }
    }

    /// Through `seconds` of a sample.
    fn advance(&mut self, sample: &ImuIncrement, seconds: f64) {
        self.ekf.set_interval(seconds);
        self.step(sample);
    }

    /// Through an interval that was set, with the mean of a sample.
    fn step(&mut self, sample: &ImuIncrement) {
        let mean = ImuSample {
            omega_ib_b: rate(sample),
            f_ib_b: force(sample),
        };
        advance(&mut self.ekf, &[mean], &[[Vec3::ZERO; 2]]);
    }

    /// Through `seconds` of a sample that bridges a gap, in steps, as uncertain as `Gap` says.
    fn cross(&mut self, bridge: &ImuIncrement, seconds: f64, spread: Spread) {
        let steps = (seconds / BRIDGE_STEP_S).ceil().max(1.0);
        let step_s = seconds / steps;
        self.ekf.set_interval(step_s);
        // density σ²T over a step
        self.ekf
            .add_white(spread.map(|sigma| sigma * sigma * (bridge.dt_s / step_s)));
        (0..steps as usize).for_each(|_| self.step(bridge));
    }

    fn fix(&self, fix: &GnssFix) -> Fix {
        Fix {
            lat: Lanes::splat(fix.lat),
            lon: Lanes::splat(fix.lon),
            h: Lanes::splat(fix.h),
            v_n: fix.velocity.map(|velocity| Vec3::splat(velocity.v_n())),
            pos_sigma_m: fix.pos_sigma_n,
            vel_sigma_m_s: fix
                .velocity
                .map_or(DVec3::ONE, |velocity| velocity.sigma_n()),
            lever_arm_b: self.lever_arm_s,
        }
    }

    /// Innovation, its standard deviations and NIS, all measured components together.
    fn innovation_of(&mut self, fix: &GnssFix) -> FixRecord {
        apply_pending_earth_step(&mut self.ekf);
        let measured = self.fix(fix);
        let components = fix.components();
        let (z, s) = self.ekf.innovation(&measured);
        // of this many of the first components
        let nis = |n: usize| {
            let (z, s) = (
                z.rows(0, n).into_owned(),
                s.view((0, 0), (n, n)).into_owned(),
            );
            s.cholesky().map_or(f64::NAN, |c| z.dot(&c.solve(&z)))
        };
        let sigma = s.diagonal().map(f64::sqrt);
        let before = self.ekf.p.variances(R).lane(0);
        FixRecord {
            horizontal_nis: nis(2),
            horizontal_sigma_m: (before.x + before.y).sqrt(),
            t_s: fix.t_s,
            used: true,
            rejected_above: None,
            innovation: z.as_slice()[..components].to_vec(),
            sigma: sigma.as_slice()[..components].to_vec(),
            nis: nis(components),
            error: None,
        }
    }

    /// Uses a velocity along the vehicle's axes.
    fn aid(&mut self, aid: &VehicleVelocity) -> AidRecord {
        let to_imu = self.q_s_b.inverse();
        let axes = aid.aid.axes();
        let measured = BodyVelocity {
            value: Vec3::splat(aid.velocity_b),
            axes,
            variance: aid.sigma_m_s * aid.sigma_m_s,
            lever_arm_b: to_imu * aid.lever_arm_b,
            vehicle_b: DVec3::AXES.map(|axis| to_imu * axis),
        };
        let found = update_body_velocity(&mut self.ekf, &measured);
        let normalised = found[..axes.len()]
            .iter()
            .map(|[z, variance]| z[0] / variance[0].sqrt());
        AidRecord {
            t_s: aid.t_s,
            aid: aid.aid,
            normalised: normalised.collect(),
        }
    }

    fn update(&mut self, fix: &GnssFix) {
        let fix = self.fix(fix);
        let _ = update(&mut self.ekf, &fix);
    }

    /// The vehicle's state.
    fn state(&self) -> NavState {
        let of_imu = self.ekf.nominal.lane(0);
        NavState {
            q_b_n: (of_imu.q_b_n * self.q_s_b.inverse()).normalize(),
            ..of_imu
        }
    }

    /// Covariance of the mounting in the vehicle's attitude error in n (rad²).
    fn of_mounting(&self, q_b_n: DQuat) -> Matrix3<f64> {
        let axes = DVec3::AXES.map(|axis| to_nalgebra(q_b_n * (axis * self.mounting_sigma_b)));
        axes.iter().map(|axis| axis * axis.transpose()).sum()
    }

    fn row(&mut self, t_s: f64) -> SolutionRow {
        apply_pending_earth_step(&mut self.ekf);
        let (state, p) = (self.state(), &self.ekf.p);
        let (r, v) = (p.variances(R).lane(0), p.variances(V).lane(0));
        let full = p.lane(0);
        let psi = full.fixed_view::<3, 3>(3 * PSI, 3 * PSI) + self.of_mounting(state.q_b_n);
        let sigma = flatten(&[
            r.map(f64::sqrt),
            v.map(f64::sqrt),
            angle_sigmas(state.q_b_n, &psi),
        ]);
        let bias = Sensor::ALL.map(|sensor| self.ekf.bias_of(sensor).lane(0));
        let bias_sigma = Sensor::ALL.map(|sensor| self.ekf.bias_sigma(sensor).lane(0));
        SolutionRow {
            t_s,
            state,
            sigma,
            bias,
            bias_sigma,
            error: None,
        }
    }

    /// Difference from a reference, where it is known at this instant.
    fn error_from(&mut self, reference: &Reference, t_s: f64) -> Option<RowError> {
        Some(self.error(&reference.state(t_s)?, reference.velocity_sigma(t_s)?))
    }

    /// Difference from a state whose velocity is known as well as `velocity_sigma` (m/s).
    fn error(&mut self, truth: &NavState, velocity_sigma: f64) -> RowError {
        apply_pending_earth_step(&mut self.ekf);
        let (values, psi_n) = reported_error(&self.state(), truth);
        let mut x = SVector::from(values);
        x.fixed_rows_mut::<3>(3 * PSI)
            .copy_from(&to_nalgebra(psi_n));
        let mut p = self.ekf.p.lane(0).fixed_view::<9, 9>(0, 0).into_owned();
        let mut psi = p.fixed_view_mut::<3, 3>(3 * PSI, 3 * PSI);
        psi += self.of_mounting(truth.q_b_n);
        let angle_sigma = angle_sigmas(truth.q_b_n, &psi.into_owned());
        let mut of_velocity = p.fixed_view_mut::<3, 3>(3 * V, 3 * V);
        of_velocity += Matrix3::from_diagonal_element(velocity_sigma * velocity_sigma);
        let sigma = |block: usize| {
            DVec3::from_array([0, 1, 2].map(|i| p[(3 * block + i, 3 * block + i)].sqrt()))
        };
        let sigma = flatten(&[sigma(R), sigma(V), angle_sigma]);
        let nees = p.cholesky().map_or(f64::NAN, |c| x.dot(&c.solve(&x)));
        RowError {
            values,
            sigma,
            velocity_sigma,
            nees,
        }
    }
}

/// Standard deviations of roll, pitch and yaw (degrees) where the attitude error in n has this covariance.
fn angle_sigmas(q_b_n: DQuat, psi: &Matrix3<f64>) -> DVec3 {
    let jacobian = RollPitchYaw::from_quat(q_b_n)
        .jacobian_of_psi_n()
        .map(to_nalgebra);
    DVec3::from_array(jacobian.map(|row| (row.transpose() * psi * row)[0].sqrt() / DEG))
}

fn flatten(of: &[DVec3; 3]) -> Nine {
    std::array::from_fn(|i| of[i / 3][i % 3])
}

// Gaps in a recording: what is missing is bridged, and the filter is told how little is known of it.
//
// The bridge is the mean of the samples on either side. How wrong its mean specific force and mean angular rate
// are is read from the recording itself: the same bridge laid over windows of the gap's length elsewhere. If the
// error were one constant over the gap (standard deviation σ, length T), it would add σ²T² to the variance of
// velocity (or attitude), σ²T³/2 to its covariance with position and σ²T⁴/4 to position. White noise of density
// σ²T adds the same, the same, and σ²T⁴/3: that is what the filter gets.

/// Longest gap that is bridged (s). Beyond it the heading after a turn is wrong by more than a linear filter finds back
/// from: of nine gaps of 9 s where turns begin, one ended at a NEES of thousands; none of 5 s above 30.
pub const LONGEST_GAP_S: f64 = 5.0;
/// A sample that lasts so many median ones is a bridge.
const LONG: f64 = 1.5;
/// Samples on either side that a bridge is made of.
const BESIDE: usize = 5;
/// Share of the windows that end nearer than σ: drives are mostly straight, and a gap in a turn must not be told to
/// a filter as one in a straight.
const SHARE: f64 = 0.99;
/// σ of a recording with fewer windows than [`FEWEST`]: a car's hard braking (m/s²) and turning (rad/s).
const UNKNOWN: [f64; 2] = [3.0, 0.5];
/// Fewest windows that tell.
const FEWEST: usize = 20;

/// Standard deviations of the means over a gap on each axis: specific force (m/s²), angular rate (rad/s).
type Spread = [DVec3; 2];

/// Fills the holes between samples. `step_s` is how long a sample lasts.
pub fn bridged(samples: &[ImuIncrement], step_s: f64) -> Vec<ImuIncrement> {
    let hole = |k: usize| samples[k].t_s - samples[k].dt_s - samples[k - 1].t_s;
    let holes: Vec<usize> = (1..samples.len())
        .filter(|k| hole(*k) > (LONG - 1.0) * step_s)
        .collect();
    let mut filled = Vec::with_capacity(samples.len() + holes.len());
    let mut done = 0;
    for (i, &k) in holes.iter().enumerate() {
        filled.extend_from_slice(&samples[done..k]);
        // not beyond the next hole
        let end = holes.get(i + 1).copied().unwrap_or(samples.len());
        // A few samples only: further away the motion is no longer that at the edges of the gap.
        let (_, before) = rates(&samples[k.saturating_sub(BESIDE).max(done)..k]);
        let (_, after) = rates(&samples[k..(k + BESIDE).min(end)]);
        let dt_s = hole(k);
        let [dv, dtheta] = [0, 1].map(|i| 0.5 * (before[i] + after[i]) * dt_s);
        filled.push(ImuIncrement {
            t_s: samples[k].t_s - samples[k].dt_s,
            dt_s,
            dtheta,
            dv,
        });
        done = k;
    }
    filled.extend_from_slice(&samples[done..]);
    filled
}

/// Duration of samples (s), their mean specific force (m/s²) and angular rate (rad/s).
pub(super) fn rates(samples: &[ImuIncrement]) -> (f64, [DVec3; 2]) {
    let seconds: f64 = samples.iter().map(|s| s.dt_s).sum();
    let mean = |of: fn(&ImuIncrement) -> DVec3| samples.iter().map(of).sum::<DVec3>() / seconds;
    (seconds, [mean(|s| s.dv), mean(|s| s.dtheta)])
}

/// Interpolated samples of a recording, and how far from the truth.
struct GapFiller<'a> {
    imu: &'a [ImuIncrement],
    step_s: f64,
    /// By length in steps.
    known: Vec<(usize, Spread)>,
}

impl<'a> GapFiller<'a> {
    fn new(imu: &'a [ImuIncrement]) -> Self {
        let step_s = median(imu.iter().map(|s| s.dt_s)).unwrap_or(1.0);
        Self {
            imu,
            step_s,
            known: Vec::new(),
        }
    }

    /// The spread of a sample that is a bridge; none of any other.
    fn spread(&mut self, sample: &ImuIncrement) -> Option<Spread> {
        if sample.dt_s <= LONG * self.step_s {
            return None;
        }
        let steps = (sample.dt_s / self.step_s).round() as usize;
        if let Some((_, spread)) = self.known.iter().find(|(n, _)| *n == steps) {
            return Some(*spread);
        }
        let spread = self.of_windows(steps);
        self.known.push((steps, spread));
        Some(spread)
    }

    /// Distances of the means of windows of this many samples from their bridges.
    fn of_windows(&self, steps: usize) -> Spread {
        let mut off: [Vec<f64>; 6] = Default::default();
        let whole = steps + 2 * BESIDE;
        // Windows overlap by half: nearly all that the recording tells, at twice the cost of windows side by
        // side.
        for first in (0..self.imu.len().saturating_sub(whole)).step_by((steps / 2).max(1)) {
            let part = &self.imu[first..first + whole];
            // A bridge says nothing about the quality of bridges.
            if part.iter().any(|s| s.dt_s > LONG * self.step_s) {
                continue;
            }
            let (before, rest) = part.split_at(BESIDE);
            let (window, after) = rest.split_at(steps);
            let [before, window, after] = [before, window, after].map(|samples| rates(samples).1);
            for sensor in 0..2 {
                let error = window[sensor] - 0.5 * (before[sensor] + after[sensor]);
                (0..3).for_each(|axis| off[3 * sensor + axis].push(error[axis].abs()));
            }
        }
        if off[0].len() < FEWEST {
            return UNKNOWN.map(DVec3::splat);
        }
        let at = ((off[0].len() - 1) as f64 * SHARE) as usize;
        let sigma = off.map(|mut errors| *errors.select_nth_unstable_by(at, f64::total_cmp).1);
        [&sigma[..3], &sigma[3..]].map(DVec3::from_slice)
    }
}

// The fixed-interval smoother: every instant, estimated from what was recorded before and after it.
//
// [Rauch, Tung and Striebel](crate::bibliography::Rauch65)'s backward recursion, in the form of
// [Särkkä](crate::bibliography::Sarkka13), sec. 8.2: given the error at the next instant, that at this one is normal,
// its mean `C` times it and its covariance `D` ([`Link`]). The errors of this filter have mean zero after every
// update, and are those of its own nominal state there. So what is smoothed is the error of the filter: carried back
// through a fix by what that took out of the state, through an interval by its link, and taken out of the nominal
// state where a row is wanted. The filter itself is not changed by a tape that runs along.

/// Most memory that a tape may take (bytes).
const MOST_BYTES: f64 = 2e9;

/// States recorded for the smoother: an instant for every row and every fix that was used.
struct SmootherHistory {
    marks: Vec<SmootherEpoch>,
    /// Covariance at the last mark, after its fix.
    covariance: DMatrix<f64>,
    /// The mark of each row.
    rows: Vec<usize>,
}

/// An instant.
struct SmootherEpoch {
    t_s: f64,
    /// The filter after the fix.
    after: Snapshot,
    /// Correction of the state by fixes.
    correction: Option<DVector<f64>>,
    /// To the next mark.
    link: Option<Link>,
}

impl SmootherEpoch {
    fn of(ekf: &Ekf, t_s: f64) -> Self {
        Self {
            t_s,
            after: ekf.snapshot(),
            correction: None,
            link: None,
        }
    }
}

impl SmootherHistory {
    /// A tape that begins where the filter is, for up to so many marks.
    ///
    /// # Errors
    /// When it would be too large.
    fn new(filter: &mut Filter, t_s: f64, marks: f64) -> Result<Self, FusionError> {
        let states = filter.ekf.p.lane(0).nrows();
        let bytes = marks * bytes_of_mark(states as f64);
        if bytes > MOST_BYTES {
            return Err(FusionError::Memory {
                bytes,
                marks,
                states,
            });
        }
        filter.ekf.keep_transition();
        let covariance = filter.ekf.p.lane(0);
        Ok(Self {
            marks: vec![SmootherEpoch::of(&filter.ekf, t_s)],
            covariance,
            rows: Vec::new(),
        })
    }

    /// Marks where a settled filter is, before a fix or for a row; once for each instant.
    fn mark(&mut self, filter: &mut Filter, t_s: f64) {
        let Some(last) = self.marks.last_mut().filter(|last| last.t_s < t_s) else {
            return;
        };
        let transition = filter.ekf.take_transition();
        let predicted = filter.ekf.p.lane(0);
        last.link = Some(Link::new(&self.covariance, &transition, &predicted));
        self.covariance = predicted;
        self.marks.push(SmootherEpoch::of(&filter.ekf, t_s));
    }

    /// A row is written here.
    fn row(&mut self, filter: &mut Filter, t_s: f64) {
        self.mark(filter, t_s);
        self.rows.push(self.marks.len() - 1);
    }

    /// A fix is used here, by `update`.
    fn fix<T>(
        &mut self,
        filter: &mut Filter,
        t_s: f64,
        update: impl FnOnce(&mut Filter) -> T,
    ) -> T {
        self.mark(filter, t_s);
        let found = update(filter);
        if let Some(last) = self.marks.last_mut() {
            let mut correction = filter.ekf.correction();
            if let Some(earlier) = &last.correction {
                put_back(earlier, &mut correction);
            }
            (last.correction, last.after) = (Some(correction), filter.ekf.snapshot());
        }
        self.covariance = filter.ekf.p.lane(0);
        found
    }

    /// Runs backwards. `filtered` are the rows of the filter, which is used to show the smoothed ones.
    fn smoothed(
        self,
        filter: &mut Filter,
        filtered: &[SolutionRow],
        reference: Option<&Reference>,
    ) -> Vec<SolutionRow> {
        let mut smoothed = filtered.to_vec();
        let mut rows = self.rows.iter().zip(&mut smoothed).rev().peekable();
        let mut p = self.covariance;
        let mut error = DVector::zeros(p.nrows());
        for k in (0..self.marks.len()).rev() {
            let mark = &self.marks[k];
            if let Some(link) = &mark.link {
                if let Some(correction) = &self.marks[k + 1].correction {
                    put_back(correction, &mut error);
                }
                link.back(&mut error, &mut p);
            }
            while let Some((_, row)) = rows.next_if(|(of, _)| **of == k) {
                // at the last mark nothing follows: the filter's own row
                if mark.link.is_some() {
                    filter.ekf.show(&mark.after, &error, &p);
                    *row = filter.row(mark.t_s);
                    row.error = reference.and_then(|r| filter.error_from(r, mark.t_s));
                }
            }
        }
        smoothed
    }
}

/// Bytes of a mark with its link.
fn bytes_of_mark(states: f64) -> f64 {
    8.0 * (states * states + 0.5 * states * (states + 1.0) + 2.0 * states + 32.0)
}

/// The error before a fix took `correction` out of the state, from that after it: rotations compose (to second
/// order), all else adds.
fn put_back(correction: &DVector<f64>, error: &mut DVector<f64>) {
    let psi = |x: &DVector<f64>| DVec3::from_slice(&x.as_slice()[3 * PSI..]);
    let turned = 0.5 * psi(correction).cross(psi(error));
    *error += correction;
    (0..3).for_each(|i| error[3 * PSI + i] += turned[i]);
}

#[cfg(test)]
mod gap_tests {
    use super::*;

    fn sample(k: usize, rate: f64) -> ImuIncrement {
        let dt_s = 0.01;
        ImuIncrement {
            t_s: (k + 1) as f64 * dt_s,
            dt_s,
            dtheta: DVec3::Z * rate * dt_s,
            dv: DVec3::X * dt_s,
        }
    }

    #[test]
    fn a_bridge_lasts_from_the_sample_before_to_the_one_after() {
        let mut imu: Vec<_> = (0..100)
            .map(|k| sample(k, if k < 50 { 0.1 } else { 0.3 }))
            .collect();
        imu.drain(40..60);
        let filled = bridged(&imu, 0.01);
        assert_eq!(filled.len(), 81);
        let bridge = filled[40];
        assert!((bridge.t_s - 0.6).abs() < 1e-12 && (bridge.dt_s - 0.2).abs() < 1e-12);
        assert!((bridge.dtheta.z - 0.2 * 0.2).abs() < 1e-12 && (bridge.dv.x - 0.2).abs() < 1e-12);
        assert_eq!(bridged(&filled, 0.01).len(), 81);
    }

    /// A rate that alternates slowly with amplitude 1: over half a period its mean differs from the ends by up to
    /// 2/π, and a window of the recording's own motion says so.
    #[test]
    fn the_spread_is_that_of_the_recording() {
        let imu: Vec<_> = (0..60_000)
            .map(|k| sample(k, (std::f64::consts::TAU * k as f64 / 1000.0).sin()))
            .collect();
        let mut bridges = GapFiller::new(&imu);
        assert!(bridges.spread(&imu[7]).is_none());
        let [accel, gyro] = bridges
            .spread(&ImuIncrement {
                dt_s: 5.0,
                ..imu[7]
            })
            .unwrap();
        // mean of sin over half a period, 2/π at its extremes, less the samples beside it, 252.5 from its middle;
        // windows a quarter of a period apart meet the extremes
        let beside = (std::f64::consts::TAU * 0.2525).cos();
        assert!(
            (gyro.z - (std::f64::consts::FRAC_2_PI - beside)).abs() < 1e-3,
            "{gyro}"
        );
        assert!(accel.length() < 1e-9 && gyro.x == 0.0);
        let short = GapFiller::new(&imu[..1000]).spread(&ImuIncrement {
            dt_s: 5.0,
            ..imu[7]
        });
        assert_eq!(short, Some(UNKNOWN.map(DVec3::splat)));
    }
}

#[cfg(test)]
mod smoother_tests {
    use super::*;
    use glam::DQuat;

    /// A rotation after another is that of their product; the rest adds. What is left is of third order: 0.03³.
    #[test]
    fn a_correction_is_put_back_before_the_error_after_it() {
        let (first, then) = (
            DVec3::new(0.02, -0.01, 0.03),
            DVec3::new(-0.015, 0.025, 0.01),
        );
        let state = |psi: DVec3, rest: f64| {
            let mut x = DVector::repeat(15, rest);
            (0..3).for_each(|i| x[3 * PSI + i] = psi[i]);
            x
        };
        let mut error = state(then, 2.0);
        put_back(&state(first, 0.5), &mut error);
        let product =
            (DQuat::from_scaled_axis(first) * DQuat::from_scaled_axis(then)).to_scaled_axis();
        for i in 0..15 {
            match (3 * PSI..3 * PSI + 3).contains(&i) {
                true => assert!(
                    (error[i] - product[i - 3 * PSI]).abs() < 2.7e-5,
                    "{error} {product}"
                ),
                false => assert_eq!(error[i], 2.5),
            }
        }
    }

    /// Numbers of 15 states: a transition, half a symmetric matrix, two vectors, and 32 of the navigation state.
    #[test]
    fn a_mark_is_as_large_as_it_is() {
        assert_eq!(bytes_of_mark(15.0), 8.0 * f64::from(225 + 120 + 30 + 32));
    }
}
