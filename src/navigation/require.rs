//! The IMU that keeps the errors at the end of an outage within a limit, and the margin of a given IMU.
//!
//! Everything here is linear covariance analysis of a filter that knows its IMU: a state for every process, with the
//! gains that follow. Errors grow with every noise intensity, so each answer is the zero of a monotone function.
//!
//! ```
//! use nav_sim_navigation::require::{HardestLimit, Limit, LimitQuantity};
//!
//! let limit = Limit { quantity: LimitQuantity::P95, most: 5.0 };
//! let found = HardestLimit { limit, value: 10.0, place: 0 };
//! // Twice the error allowed.
//! assert!((found.margin() + 2_f64.ln()).abs() < 1e-15);
//! ```

use crate::ekf::{FilterModel, FilterModelError};
use crate::imu::Sensor;
use crate::metrics::{QuadraticForm, name_and_limit};
use crate::noise::{Composite, Flicker, Model, Process, ProcessKind, continuous};
use crate::scenario::Scenario;
use crate::sensors::imu::Truth;
use crate::sensors::outage::Outage;
use crate::simulation::ExperimentError;
use crate::simulation::lincov::{
    Instant, Moments, NamedSource, RootSearch, Track, TruthModel, errors_in_outages,
};
use crate::trajectory::Trajectory;
use crate::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use std::str::FromStr;

/// Quantity with a limit at the end of an outage.
#[derive(Debug, Clone, Copy)]
pub enum LimitQuantity {
    /// 95 % quantile of the horizontal error (m).
    P95,
    /// Its median (m).
    P50,
    /// Its root mean square (m).
    Rmse,
    /// RMSE of roll (degrees).
    Roll,
    /// RMSE of pitch (degrees).
    Pitch,
    /// RMSE of yaw (degrees).
    Yaw,
}

nav_sim_signal::named!(LimitQuantity {
    P95 = "p95_m",
    P50 = "p50_m",
    Rmse = "rmse_m",
    Roll = "roll_deg",
    Pitch = "pitch_deg",
    Yaw = "yaw_deg",
}, in files);

impl LimitQuantity {
    /// Roll, pitch or yaw, from 0.
    fn angle(self) -> Option<usize> {
        (self as usize).checked_sub(Self::Roll as usize)
    }

    /// A value with its unit, to a thousandth; a larger one, or a smaller, in powers of ten.
    pub fn shown(self, value: f64) -> String {
        let unit = if self.angle().is_some() { "deg" } else { "m" };
        let rounded = (value * 1e3).round() / 1e3;
        if (1e-3..1e6).contains(&value) {
            format!("{rounded} {unit}")
        } else {
            format!("{value:.2e} {unit}")
        }
    }
}

/// A quantity and the most it may be.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Limit {
    /// The quantity.
    pub quantity: LimitQuantity,
    /// Its largest value allowed (m or degrees).
    #[serde(rename = "limit")]
    pub most: f64,
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (name, most) = name_and_limit(text)?;
            let quantity = name.parse().ok()?;
            Some(Self { quantity, most })
        };
        let names = LimitQuantity::NAMES.join(", ");
        let expected = "expected NAME<=LIMIT with a positive limit, NAME one of";
        read().ok_or_else(|| format!("{expected} {names}"))
    }
}

/// The limit that is the hardest to keep, and where.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct HardestLimit {
    /// The limit.
    #[serde(flatten)]
    pub limit: Limit,
    /// The error there.
    pub value: f64,
    /// At which place of the outage, counted from 0.
    pub place: usize,
}

impl HardestLimit {
    /// Logarithm of limit over error: above 0 there is a reserve.
    pub fn margin(&self) -> f64 {
        // In logarithms limits of different units compare, and the margin is nearly linear in the logarithm
        // of an intensity.
        (self.limit.most / self.value).ln()
    }

    /// The hardest of some limits for the errors at several places; none without limits or places.
    pub fn of(limits: &[Limit], drifts: &[Drift]) -> Option<Self> {
        let worst_of_limit = |limit: &Limit| {
            let (place, value) = Drift::largest(drifts, limit.quantity)?;
            Some(Self {
                limit: *limit,
                value,
                place,
            })
        };
        // what is not a number is the hardest
        let margin = |worst: &Self| Some(worst.margin()).filter(|margin| !margin.is_nan());
        let key = |worst: &Self| margin(worst).unwrap_or(f64::NEG_INFINITY);
        limits
            .iter()
            .filter_map(worst_of_limit)
            .min_by(|a, b| key(a).total_cmp(&key(b)))
    }
}

/// Reason that there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum RequireError {
    /// Not even an IMU without errors keeps a limit.
    #[error("no IMU keeps {} ≤ {}: without IMU noise the error is {}, from GNSS, start and the rest of the scenario", limit.quantity.name(), limit.quantity.shown(limit.most), limit.quantity.shown(*value))]
    Floor {
        /// The limit.
        limit: Limit,
        /// The error with a perfect IMU.
        value: f64,
    },
    /// The poorest IMU that is sought keeps every limit.
    #[error("every IMU keeps {} ≤ {}: with the poorest of the search the error is {}", limit.quantity.name(), limit.quantity.shown(limit.most), limit.quantity.shown(*value))]
    Loose {
        /// The hardest limit.
        limit: Limit,
        /// The error with the poorest IMU.
        value: f64,
    },
    /// The model has no filter.
    #[error(transparent)]
    FilterModel(#[from] FilterModelError),
    /// Trajectory, rates and fixes do not fit together.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
}

// The places of an outage along a trajectory, and the errors at its end.

/// True errors at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Time since the start of the outage (s).
    pub after_s: f64,
    /// Mean of the position error, north and east (m).
    pub mean_m: [f64; 2],
    /// Its covariance (m²).
    pub covariance_m2: [[f64; 2]; 2],
    /// RMSE of roll, pitch, yaw (degrees).
    pub angles_deg: [f64; 3],
}

impl Drift {
    fn of(instant: &Instant, after_s: f64) -> Self {
        let p = &instant.covariance;
        let rmse = instant.rmse();
        Self {
            after_s,
            mean_m: [instant.mean[0], instant.mean[1]],
            covariance_m2: [[p[0][0], p[0][1]], [p[1][0], p[1][1]]],
            angles_deg: [rmse[6], rmse[7], rmse[8]],
        }
    }

    /// The value of a quantity (m or degrees).
    pub fn value(&self, quantity: LimitQuantity) -> f64 {
        match quantity {
            LimitQuantity::P50 => self.quantile(0.5),
            LimitQuantity::P95 => self.quantile(0.95),
            LimitQuantity::Rmse => self.square(quantity).sqrt(),
            LimitQuantity::Roll => self.angles_deg[0],
            LimitQuantity::Pitch => self.angles_deg[1],
            LimitQuantity::Yaw => self.angles_deg[2],
        }
    }

    /// The mean square behind a quantity (m² or degrees²), in which the parts of independent sources add.
    fn square(&self, quantity: LimitQuantity) -> f64 {
        match quantity.angle() {
            Some(i) => self.angles_deg[i].powi(2),
            // The quantiles have no sum over sources: shares are of the mean square whatever quantile is
            // limited.
            None => (0..2)
                .map(|i| self.covariance_m2[i][i] + self.mean_m[i].powi(2))
                .sum(),
        }
    }

    /// Upper bound of a value, at next to no cost.
    fn bound(&self, quantity: LimitQuantity) -> f64 {
        match quantity {
            LimitQuantity::P50 => self.quantile_bound(0.5),
            LimitQuantity::P95 => self.quantile_bound(0.95),
            _ => self.value(quantity),
        }
    }

    /// The mean, and the quantile of a circular error whose variance on every axis is the largest of this one's.
    fn quantile_bound(&self, probability: f64) -> f64 {
        let [[north, both], [_, east]] = self.covariance_m2;
        let largest = 0.5 * (north + east + (north - east).hypot(2.0 * both));
        self.mean_m[0].hypot(self.mean_m[1]) + (-2.0 * (1.0 - probability).ln() * largest).sqrt()
    }

    /// Returns true if a limit is exceeded, or the value is not a number.
    pub fn exceeds(&self, limit: &Limit) -> bool {
        let is_within = |value: f64| value <= limit.most;
        !is_within(self.bound(limit.quantity)) && !is_within(self.value(limit.quantity))
    }

    /// The largest value of a quantity and where it is; what is not a number is the largest.
    pub fn largest(drifts: &[Self], quantity: LimitQuantity) -> Option<(usize, f64)> {
        let bound = |drift: &Self| {
            Some(drift.bound(quantity))
                .filter(|b| !b.is_nan())
                .unwrap_or(f64::INFINITY)
        };
        let mut bounds: Vec<(usize, f64)> = drifts.iter().map(bound).enumerate().collect();
        bounds.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut largest: Option<(usize, f64)> = None;
        // A quantile is an integral: only those are computed that may be the largest.
        for (place, bound) in bounds {
            if largest.is_some_and(|(_, value)| bound <= value || value.is_nan()) {
                break;
            }
            let value = drifts[place].value(quantity);
            if largest.is_none_or(|(_, largest)| value > largest || value.is_nan()) {
                largest = Some((place, value));
            }
        }
        largest
    }

    fn quantile(&self, probability: f64) -> f64 {
        let covariance = DMatrix::from_fn(2, 2, |i, j| self.covariance_m2[j][i]);
        // North and east have unequal variances and are correlated: the horizontal error is neither Rayleigh
        // nor normal.
        QuadraticForm::of_square(&covariance, &self.mean_m)
            .quantile(probability)
            .sqrt()
    }
}

/// A trajectory with an outage at several places, each alone.
pub struct OutagePlacements<'a> {
    trajectory: &'a Trajectory,
    track: Track,
    outages: Vec<Outage>,
}

impl<'a> OutagePlacements<'a> {
    /// Linearises along the trajectory; of the scenario, receiver, barometer and start count. Outages may overlap.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn new(
        scenario: &Scenario,
        trajectory: &'a Trajectory,
        outages: &[Outage],
    ) -> Result<Self, ExperimentError> {
        let track = Self::track(scenario, trajectory)?;
        Ok(Self::along(&track, trajectory, outages))
    }

    /// Track of the reference alone: the noise that is sought or judged comes later, many times over the same track.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn track(scenario: &Scenario, trajectory: &Trajectory) -> Result<Track, ExperimentError> {
        let silent = Model {
            rate_hz: scenario.imu.rate_hz,
            axes: Default::default(),
        };
        scenario.track(trajectory, &silent, &[])
    }

    /// Along a track of the trajectory without outages.
    pub fn along(track: &Track, trajectory: &'a Trajectory, outages: &[Outage]) -> Self {
        Self {
            trajectory,
            track: track.merged_for(outages),
            outages: outages.to_vec(),
        }
    }

    /// The places of the outage.
    pub fn outages(&self) -> &[Outage] {
        &self.outages
    }

    /// Errors at the outage's end, at each place, of the filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn drifts(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Drift>, FilterModelError> {
        self.drifts_in(&self.outages, scenario, model)
    }

    /// Errors at every whole second of the outage, every fifth after the first minute where nothing is measured, at each place.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn curves(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Vec<Drift>>, FilterModelError> {
        let filter_model = self.filter_model(scenario, model)?;
        let all = TruthModel::together(&self.sources(scenario, model));
        let laws = errors_in_outages(
            &self.track,
            &filter_model,
            &all,
            &self.outages,
            Moments::Reports,
        );
        let curve = |(instants, outage): (Vec<Instant>, &Outage)| {
            // A report within the outage is what an outage would leave that ended there.
            let drift = |instant: &Instant| Drift::of(instant, instant.t_s - outage.start_s);
            let mut curve: Vec<Drift> = instants
                .iter()
                .map(drift)
                .filter(|d| d.after_s > 0.0)
                .collect();
            if let Some(end) = curve.last_mut() {
                end.after_s = outage.end_s - outage.start_s;
            }
            curve
        };
        Ok(laws.into_iter().zip(&self.outages).map(curve).collect())
    }

    /// The hardest limit of a filter that knows the model.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn worst(
        &self,
        scenario: &Scenario,
        model: &Model,
        limits: &[Limit],
    ) -> Result<HardestLimit, FilterModelError> {
        Ok(hardest(limits, &self.drifts(scenario, model)?))
    }

    /// Drifts in other outages.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn drifts_in(
        &self,
        outages: &[Outage],
        scenario: &Scenario,
        model: &Model,
    ) -> Result<Vec<Drift>, FilterModelError> {
        let all = TruthModel::together(&self.sources(scenario, model));
        Ok(self.ends(outages, &self.filter_model(scenario, model)?, &all))
    }

    fn ends(
        &self,
        outages: &[Outage],
        filter_model: &FilterModel,
        truth: &TruthModel,
    ) -> Vec<Drift> {
        let ends = errors_in_outages(&self.track, filter_model, truth, outages, Moments::End);
        let drift = |(instants, outage): (Vec<Instant>, &Outage)| {
            Drift::of(
                instants.last().expect("ends"),
                outage.end_s - outage.start_s,
            )
        };
        ends.into_iter().zip(outages).map(drift).collect()
    }

    /// The filter that knows every process: the best that this IMU allows, whatever reduction is chosen later.
    fn filter_model(
        &self,
        scenario: &Scenario,
        model: &Model,
    ) -> Result<FilterModel, FilterModelError> {
        scenario
            .with_full_noise()
            .filter_model(model, &self.outages, &self.track)
    }

    fn sources(&self, scenario: &Scenario, model: &Model) -> Vec<NamedSource> {
        let truth = Truth::Model(model);
        TruthModel::sources(
            &scenario.experiment(self.trajectory, truth, &[], &self.outages, 0),
            model,
        )
    }
}

fn hardest(limits: &[Limit], drifts: &[Drift]) -> HardestLimit {
    HardestLimit::of(limits, drifts).expect("limits")
}

/// Outages of one length at `places` times, the first at `first_s`, evenly to the end of a trajectory that lasts from
/// `span_s.0` to `span_s.1`.
pub fn evenly(span_s: (f64, f64), first_s: f64, length_s: f64, places: u32) -> Vec<Outage> {
    let last_s = span_s.1 - length_s;
    let step = if places > 1 {
        (last_s - first_s).max(0.0) / f64::from(places - 1)
    } else {
        0.0
    };
    let mut outages: Vec<Outage> = (0..places)
        // Reports come every second from the start: only from one of them are the errors within the outage those
        // after 1, 2, 3 … s.
        .map(|k| span_s.0 + (first_s - span_s.0 + f64::from(k) * step + 1e-6).floor())
        .map(|start_s| Outage {
            start_s,
            end_s: start_s + length_s,
        })
        .collect();
    outages.dedup();
    outages
}

// The IMU that a limit needs: white noise and bias instability of each sensor, each with a quarter of the budget.

/// Number of noise intensities of an IMU.
pub const IMU_PARAMETERS: usize = 4;

/// Intensities of an IMU, all axes alike.
#[derive(Debug, Clone, Copy)]
pub struct ImuParameters {
    /// Velocity random walk (m/s/√s), bias instability of the accelerometer (m/s²), angle random walk (rad/√s), bias
    /// instability of the gyroscope (rad/s).
    pub values: [f64; IMU_PARAMETERS],
    /// Longest correlation time of the biases (s).
    pub t_corr_s: f64,
}

const HOUR_S: f64 = 3600.0;

/// A consumer IMU, from which searches start.
const START: [f64; IMU_PARAMETERS] = [1e-3, 3e-4, 5e-5, 1e-5];
/// The poorest IMU that is sought has this times the intensities of the start (18 m/s/√h, 9.2 mg, 52 deg/√h, 620 deg/h):
/// poorer than any that is sold. Beyond, errors are no longer small and the linear analysis means nothing.
const POOREST: f64 = 300.0;
/// An intensity times this is as good as none.
const NONE: f64 = 1e-5;
/// Searched range of the logarithm of an intensity about the start: beyond, any value will do.
const RANGE: f64 = 9.0;
/// A logarithm of limit over error that is left: the search ends on either side of what it aims at, within [`EXACT`], its
/// steps of up to a second leave up to 0.12 % less than those of `run` (biases, in outages of 5 s; 0.01 % from 10 s on, in the
/// drive of `tests/truth/require.rs`), and the IMU that is named is to keep the limit in both.
const RESERVE: f64 = 1.5e-3;
/// A logarithm of limit over error this close to the one sought counts as it.
const EXACT: f64 = 1e-4;
/// Rounds of the allocation, the share of a correction that is applied, and when it is done.
const ROUNDS: usize = 25;
const DAMPING: f64 = 0.35;
const EVEN: f64 = 0.02;

impl ImuParameters {
    /// The processes.
    const PROCESSES: [(Sensor, ProcessKind); IMU_PARAMETERS] = [
        (Sensor::Accel, ProcessKind::White),
        (Sensor::Accel, ProcessKind::GaussMarkov),
        (Sensor::Gyro, ProcessKind::White),
        (Sensor::Gyro, ProcessKind::GaussMarkov),
    ];

    /// The noise model.
    pub fn model(&self, rate_hz: f64) -> Model {
        let [accel_white, accel_bias, gyro_white, gyro_bias] = self.values;
        let axis = |density: f64, bias: f64| {
            let white = Process::white(continuous::white_sigma2(density, rate_hz));
            let bias = Flicker {
                floor: bias,
                t_corr_s: self.t_corr_s,
            }
            .processes(rate_hz);
            let mut processes = vec![white.expect("finite")];
            processes.extend(bias.expect("finite"));
            Composite::new(processes)
        };
        Model::pooled(
            rate_hz,
            &axis(accel_white, accel_bias),
            &axis(gyro_white, gyro_bias),
        )
    }

    /// An intensity in the unit of datasheets.
    pub fn in_datasheets(which: usize, value: f64) -> f64 {
        match which {
            0 => value * HOUR_S.sqrt(),
            1 => value / STANDARD_GRAVITY * 1e6,
            2 => value / DEG * HOUR_S.sqrt(),
            _ => value / DEG_PER_HOUR,
        }
    }

    /// Names and units of the intensities.
    pub const NAMES: [&'static str; IMU_PARAMETERS] = [
        "velocity random walk (m/s/√h)",
        "accelerometer bias instability (µg)",
        "angle random walk (deg/√h)",
        "gyroscope bias instability (deg/h)",
    ];

    /// An IMU with practically no noise.
    fn perfect(t_corr_s: f64) -> Self {
        // 1e-5 of a consumer IMU, not zero: intensities are sought as logarithms.
        Self {
            values: START,
            t_corr_s,
        }
        .times([NONE; IMU_PARAMETERS])
    }

    fn times(&self, factors: [f64; IMU_PARAMETERS]) -> Self {
        Self {
            values: std::array::from_fn(|i| self.values[i] * factors[i]),
            ..*self
        }
    }
}

/// An intensity that keeps the limits, or none that matters.
#[derive(Debug, Clone, Copy)]
pub enum IntensityBound {
    /// At most this.
    AtMost(f64),
    /// Any value will do.
    Any,
    /// Not even zero is enough.
    Never,
}

/// Requirements on an IMU.
pub struct ImuSearch<'a> {
    /// The trajectory and the places of the outage.
    pub course: &'a OutagePlacements<'a>,
    /// Receiver, start and IMU rate.
    pub scenario: &'a Scenario,
    /// At least one.
    pub limits: &'a [Limit],
    /// Longest correlation time of the biases (s).
    pub t_corr_s: f64,
}

impl ImuSearch<'_> {
    /// The IMU that meets the limits with 1.5 thousandths in reserve, its four intensities with equal shares in the
    /// variance that GNSS and start leave; and the places, counted from 0, where the limits were the hardest.
    ///
    /// # Errors
    /// When not even a perfect IMU meets them, or the poorest that is sought does.
    pub fn allocated(&self) -> Result<(ImuParameters, Vec<usize>), RequireError> {
        let start = ImuParameters {
            values: START,
            t_corr_s: self.t_corr_s,
        };
        let perfect = self.worst(&ImuParameters::perfect(self.t_corr_s))?;
        if perfect.margin() <= RESERVE {
            return Err(RequireError::Floor {
                limit: perfect.limit,
                value: perfect.value,
            });
        }
        let worst = self.worst(&start.times([POOREST; IMU_PARAMETERS]))?;
        if worst.margin() >= RESERVE {
            return Err(RequireError::Loose {
                limit: worst.limit,
                value: worst.value,
            });
        }
        let mut places = vec![worst.place];
        let mut imu = self.at_limit(&start, [1.0; IMU_PARAMETERS], &mut places)?.1;
        loop {
            let known = places.len();
            // The rounds end near the limit; one factor common to all then meets it exactly and leaves the shares
            // as they are.
            imu = self.evened(imu, &places)?;
            imu = self.at_limit(&imu, [1.0; IMU_PARAMETERS], &mut places)?.1;
            if places.len() == known {
                return Ok((imu, places));
            }
        }
    }

    /// An IMU near the limit at the hardest of some places, its four intensities with equal shares.
    fn evened(
        &self,
        mut imu: ImuParameters,
        places: &[usize],
    ) -> Result<ImuParameters, FilterModelError> {
        for _ in 0..ROUNDS {
            let (worst, squares) = self.squares(&imu, places)?;
            let total: f64 = squares.iter().sum();
            // what the limit leaves when GNSS and start have taken their part
            // The margin is ln(limit/error): squared, exp(2 margin) is what the mean square may grow by.
            let allowed =
                total * (2.0 * (worst.margin() - RESERVE)).exp() - squares[IMU_PARAMETERS];
            // Where GNSS and start alone exceed the limit at this iterate the rest is negative: five per cent
            // keep the logarithm finite until it is not.
            let quarter = allowed.max(0.05 * total) / IMU_PARAMETERS as f64;
            let off: [f64; IMU_PARAMETERS] = std::array::from_fn(|i| (quarter / squares[i]).ln());
            if off.iter().all(|x| x.abs() < EVEN) {
                break;
            }
            // Half of the logarithm of the squares would be the exact step of a source alone; less, since the
            // filter's gains, and with them all four parts, change with every intensity.
            imu = imu.times(off.map(|x| (DAMPING * x).clamp(-1.0, 1.0).exp()));
        }
        Ok(imu)
    }

    /// Largest value of an intensity when the others are multiplied by `others`; the search begins at the hardest of some places.
    ///
    /// # Errors
    /// When the model has no filter.
    pub fn limit_of(
        &self,
        imu: &ImuParameters,
        which: usize,
        others: f64,
        places: &[usize],
    ) -> Result<IntensityBound, FilterModelError> {
        let base = imu.times(std::array::from_fn(
            |i| if i == which { 1.0 } else { others },
        ));
        let mut varied = [0.0; IMU_PARAMETERS];
        varied[which] = 1.0;
        let (margin, found) = self.at_limit(&base, varied, &mut places.to_vec())?;
        Ok(match margin {
            // Regula falsi may end at a bracket without the last digit: ten times the tolerance is still a
            // crossing.
            m if m.abs() <= 10.0 * EXACT => IntensityBound::AtMost(found.values[which]),
            m if m > 0.0 => IntensityBound::Any,
            _ => IntensityBound::Never,
        })
    }

    /// Largest value of an intensity when the others are practically zero.
    ///
    /// # Errors
    /// When the model has no filter.
    pub fn limit_with_others_perfect(
        &self,
        imu: &ImuParameters,
        which: usize,
        places: &[usize],
    ) -> Result<IntensityBound, FilterModelError> {
        self.limit_of(imu, which, NONE, places)
    }

    fn worst(&self, imu: &ImuParameters) -> Result<HardestLimit, FilterModelError> {
        let all: Vec<usize> = (0..self.course.outages.len()).collect();
        self.worst_of(imu, &all)
    }

    fn worst_of(
        &self,
        imu: &ImuParameters,
        places: &[usize],
    ) -> Result<HardestLimit, FilterModelError> {
        let model = imu.model(self.scenario.imu.rate_hz);
        let outages: Vec<Outage> = places.iter().map(|at| self.course.outages[*at]).collect();
        let drifts = self.course.drifts_in(&outages, self.scenario, &model)?;
        let worst = hardest(self.limits, &drifts);
        Ok(HardestLimit {
            place: places[worst.place],
            ..worst
        })
    }

    /// The IMU whose intensities with a weight are multiplied until the hardest limit is met with its reserve, and the
    /// margin beyond that which is left: not zero where no factor within the range meets it. Adds to the hardest places.
    fn at_limit(
        &self,
        imu: &ImuParameters,
        weights: [f64; IMU_PARAMETERS],
        places: &mut Vec<usize>,
    ) -> Result<(f64, ImuParameters), FilterModelError> {
        let crossing = RootSearch {
            bounds: (-RANGE, RANGE),
            step: 0.7,
            exact: EXACT,
        };
        let scaled = |ln: f64| imu.times(weights.map(|w| (w * ln).exp()));
        // The search is at the places that were the worst so far; what it finds is held against all, and it goes on
        // where another is worse. The answer is that of all places, at the cost of a few.
        let mut start = 0.0;
        loop {
            let margin_there = |ln: f64| {
                Ok::<_, FilterModelError>(self.worst_of(&scaled(ln), places)?.margin() - RESERVE)
            };
            let (ln, there) = crossing.from(start, margin_there)?;
            let worst = self.worst(&scaled(ln))?;
            let everywhere = worst.margin() - RESERVE;
            if everywhere >= there - EXACT || places.contains(&worst.place) {
                return Ok((everywhere, scaled(ln)));
            }
            places.push(worst.place);
            start = ln;
        }
    }

    /// Mean squares of the four sources and of everything else in what is limited the hardest.
    fn squares(
        &self,
        imu: &ImuParameters,
        places: &[usize],
    ) -> Result<(HardestLimit, [f64; IMU_PARAMETERS + 1]), FilterModelError> {
        let worst = self.worst_of(imu, places)?;
        let (course, model) = (self.course, imu.model(self.scenario.imu.rate_hz));
        let filter_model = course.filter_model(self.scenario, &model)?;
        let sources = course.sources(self.scenario, &model);
        let outage = &course.outages[worst.place..=worst.place];
        // each group of sources alone, under the gains of the filter that knows them all
        let square = |group: usize| {
            let is_own = |source: &&NamedSource| {
                let mut processes = ImuParameters::PROCESSES.iter();
                let own = processes.position(|process| source.process == Some(*process));
                own.unwrap_or(IMU_PARAMETERS) == group
            };
            let own: Vec<NamedSource> = sources.iter().filter(is_own).cloned().collect();
            let drift = course.ends(outage, &filter_model, &TruthModel::together(&own))[0];
            drift.square(worst.limit.quantity)
        };
        let groups = (0..=IMU_PARAMETERS).into_par_iter();
        let squares: Vec<f64> = groups.map(square).collect();
        Ok((worst, std::array::from_fn(|i| squares[i])))
    }
}

// How far a given IMU is from its limits, and what one without errors would leave.

/// Margins of an IMU to its limits.
#[derive(Debug, Clone, Serialize)]
pub struct Margins {
    /// True if the limits are kept.
    pub met: bool,
    /// The hardest limit.
    #[serde(flatten)]
    pub worst: HardestLimit,
    /// Hardest limit of an IMU without errors: what GNSS and start leave.
    pub without_imu_errors: HardestLimit,
}

/// Correlation time of the negligible biases of the error-free IMU (s); its value has no effect.
const ERROR_FREE_T_CORR_S: f64 = 300.0;

impl Margins {
    /// The margins of an IMU, beside that of one without errors.
    pub fn new(worst: HardestLimit, without_imu_errors: HardestLimit) -> Self {
        Self {
            met: worst.margin() >= 0.0,
            worst,
            without_imu_errors,
        }
    }
}

/// The hardest limit of an IMU without errors.
///
/// # Errors
/// When its noise at the rate of the scenario has no filter.
pub fn worst_without_imu_errors(
    course: &OutagePlacements<'_>,
    scenario: &Scenario,
    limits: &[Limit],
) -> Result<HardestLimit, FilterModelError> {
    let perfect = ImuParameters::perfect(ERROR_FREE_T_CORR_S).model(scenario.imu.rate_hz);
    course.worst(&without_imu_errors(scenario), &perfect, limits)
}

/// The scenario without constant IMU errors, in truth and filter.
fn without_imu_errors(scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    let (imu, initial) = (&mut scenario.imu, &mut scenario.initial);
    for sigma in [
        &mut imu.turn_on_bias_accel_m_s2,
        &mut imu.turn_on_bias_gyro_rad_s,
        &mut initial.accel_bias_sigma_m_s2,
        &mut initial.gyro_bias_sigma_rad_s,
        &mut initial.accel_scale_sigma_ppm,
        &mut initial.gyro_scale_sigma_ppm,
    ] {
        *sigma = sigma.map(|_| 0.0);
    }
    for size in [
        &mut imu.scale_ppm_accel,
        &mut imu.scale_ppm_gyro,
        &mut imu.misalignment_rad,
        &mut imu.g_sensitivity_rad_s_per_m_s2,
    ] {
        *size = 0.0;
    }
    imu.vibration
        .iter_mut()
        .for_each(|v| v.rectification_s2_m = 0.0);
    imu.temperature.iter_mut().for_each(|t| t.multiply(0.0));
    scenario
}
