//! The scenario file: all settings of a run in one TOML file. Every key is optional; the defaults are those of
//! [Minaretzis et al.](crate::bibliography::Minaretzis24), Section V.

use crate::earth::GravityModel;
use crate::ekf::{FilterModel, FilterModelError, FilterStates, FixUpdate, InitialSettings};
use crate::imu::Sensor;
use crate::noise::Model;
use crate::noise::reduction::{self, ReductionError};
use crate::sensors::aiding::AidingSettings;
use crate::sensors::check_bounds;
use crate::sensors::defects::ImuSettings;
use crate::sensors::gnss::{BaroSettings, GnssSettings};
use crate::sensors::imu::Truth;
use crate::sensors::outage::{
    FixedData, Fixes, Outage, OutageError, OutagePlan, PeriodicOutages, PlacedOutages,
    RandomOutages,
};
use crate::simulation::lincov::{AxisGrouping, Track, reduced_belief};
use crate::simulation::{Experiment, ExperimentError, Gains, samples_per};
use crate::trajectory::Trajectory;
use crate::units::{Probability, SettingError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// All settings of a run except the trajectory and the models.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// Number of runs, seed, method.
    pub run: RunSettings,
    /// The filter.
    pub filter: FilterSettings,
    /// The true IMU.
    pub imu: ImuSettings,
    /// The GNSS receiver.
    pub gnss: GnssSettings,
    /// A barometer, if there is one.
    pub baro: Option<BaroSettings>,
    /// Vehicle constraints and sensors.
    #[serde(skip_serializing_if = "AidingSettings::is_none")]
    pub aiding: AidingSettings,
    /// The start.
    pub initial: InitialSettings,
    /// Windows without fixes. Without this key and the two below: the two of the paper. An empty list: none.
    pub outage: Option<Vec<Outage>>,
    /// Regular outages.
    pub outage_periodic: Option<PeriodicOutages>,
    /// Random outages.
    pub outage_random: Option<RandomOutages>,
}

/// Most runs of one job: days of computation, and a record of each in memory.
pub const MAX_RUNS: u64 = 10_000_000;

/// `[run]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RunSettings {
    /// Monte-Carlo runs.
    #[schemars(range(min = 1, max = MAX_RUNS))]
    pub runs: u64,
    /// Seed of all random numbers; without it 1.
    pub seed: Option<u64>,
    /// Source of the statistics.
    pub method: Method,
    /// Level of the coverage statistic.
    #[schemars(with = "Probability")]
    pub coverage_level: f64,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            runs: 100,
            seed: None,
            method: Method::MonteCarlo,
            coverage_level: 0.95,
        }
    }
}

/// Source of the statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Sampled runs.
    #[default]
    MonteCarlo,
    /// Linear covariance analysis.
    Lincov,
    /// Sampled runs beside linear covariance analysis.
    Both,
}

nav_sim_signal::named!(Method { MonteCarlo = "monte-carlo", Lincov = "lincov", Both = "both" });

/// `[filter]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSettings {
    /// Representation of the noise model in the filter.
    pub states: FilterStates,
    /// Criterion that reduces a larger model to 15 states.
    pub reduction: Reduction,
    /// Decrease of gravity with height, for truth and filter alike.
    pub gravity: GravityModel,
    /// Measurement update with a fix: standard or iterated.
    pub update: FixUpdate,
    /// Source of the filter gains in sampled runs.
    pub gains: Gains,
}

/// Criterion of the reduction of a noise model to white noise and one Gauss-Markov bias per axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reduction {
    /// So that the filter's covariance is closest to that of its true errors along the trajectory, mostly at the
    /// ends of the outages.
    #[default]
    Covariance,
    /// The closest Haar wavelet variance. It knows nothing of the filter, which becomes overconfident.
    Wavelet,
}

impl Scenario {
    /// The experiment that this scenario describes: a trajectory, what makes the inertial errors, the
    /// candidates, and the outages and the seed, which have been drawn.
    pub fn experiment<'a>(
        &'a self,
        trajectory: &'a Trajectory,
        truth: Truth<'a>,
        filter_models: &'a [FilterModel],
        outages: &'a [Outage],
        seed: u64,
    ) -> Experiment<'a> {
        Experiment {
            trajectory,
            rate_hz: self.imu.rate_hz,
            gravity: self.filter.gravity,
            truth,
            filter_models,
            gnss: &self.gnss,
            initial: &self.initial,
            defects: &self.imu,
            baro: self.baro.as_ref(),
            aiding: &self.aiding,
            update: self.filter.update,
            gains: self.filter.gains,
            outages,
            seed,
            coverage_level: self.run.coverage_level,
        }
    }

    /// Checks every value, and refuses what is not simulated rather than ignore it.
    ///
    /// # Errors
    /// The first key whose value is refused, with its section.
    pub fn validate(&self) -> Result<(), SettingError> {
        check_bounds(self)?;
        self.imu.validate().map_err(|e| e.in_section("imu"))?;
        self.outages().validate()?;
        if let Some(baro) = &self.baro {
            self.meets_imu_samples("baro.rate_hz", baro.rate_hz)?;
        }
        for (aid, rate_hz) in self.aiding.rates() {
            self.meets_imu_samples(&format!("aiding.{}.rate_hz", aid.name()), rate_hz)?;
        }
        self.meets_imu_samples("gnss.rate_hz", self.gnss.rate_hz)
    }

    /// A measurement must fall on an IMU sample: one that does not would be used late or never.
    fn meets_imu_samples(&self, key: &str, rate_hz: f64) -> Result<(), SettingError> {
        if samples_per(self.imu.rate_hz, rate_hz).is_some() {
            return Ok(());
        }
        let requirement = format!(
            "imu.rate_hz = {} must be a whole multiple of it",
            self.imu.rate_hz
        );
        Err(SettingError::new(key, rate_hz, requirement))
    }

    /// The reference and the fixes as a covariance analysis needs them; `model` is at the IMU's rate.
    ///
    /// # Errors
    /// When trajectory, rates and fixes do not fit together.
    pub fn track(
        &self,
        trajectory: &Trajectory,
        model: &Model,
        outages: &[Outage],
    ) -> Result<Track, ExperimentError> {
        Track::along(&self.experiment(trajectory, Truth::Model(model), &[], outages, 0))
    }

    /// Filter model of a noise model at the IMU's rate, reduced for these outages along the track.
    ///
    /// # Errors
    /// When the model has no such filter.
    pub fn filter_model(
        &self,
        model: &Model,
        outages: &[Outage],
        track: &Track,
    ) -> Result<FilterModel, FilterModelError> {
        let longest = outages
            .iter()
            .map(|o| o.end_s - o.start_s)
            .fold(0.0, f64::max);
        // The scales over which the reduction has to agree: from one fix, below which the filter sees none of
        // them, to several times the longest outage.
        let (interval_s, window_s) = (1.0 / self.gnss.rate_hz, reduction::window_s(longest));
        let mut filter_model = FilterModel::new(model, self.filter.states, interval_s, window_s)
            .map_err(|e| self.blame(e))?;
        if self.filter.states.is_reduced() && self.filter.reduction == Reduction::Covariance {
            // The wavelet reduction is where this search starts, hence made in either case.
            filter_model = reduced_belief(model, filter_model, track, AxisGrouping::Level);
        }
        Ok(filter_model
            .with_initial(&self.initial)
            .with_vehicle(self.aiding.state_sigmas()))
    }

    /// Names the key at fault where fixes are too rare for a reduction.
    fn blame(&self, error: FilterModelError) -> FilterModelError {
        match error {
            FilterModelError::Reduction {
                source: source @ ReductionError::TooFewScales { .. },
                ..
            } => SettingError::new("gnss.rate_hz", self.gnss.rate_hz, source.to_string()).into(),
            other => other,
        }
    }

    /// The scenario with `--filter full`; initial sigmas are kept.
    pub fn with_full_noise(&self) -> Self {
        let mut full = self.clone();
        full.filter.states = FilterStates::Full;
        let ppm = self.filter.states.scale_sigma() * 1e6;
        if ppm > 0.0 {
            // The default scale factors of the filter of 21 states go with its name: kept here, since they
            // are no part of the model.
            full.initial.accel_scale_sigma_ppm.get_or_insert(ppm);
            full.initial.gyro_scale_sigma_ppm.get_or_insert(ppm);
        }
        full
    }

    /// The outages on a trajectory that lasts from `span_s.0` to `span_s.1`.
    ///
    /// # Errors
    /// One requested that does not begin on the trajectory, or withholds no fix.
    pub fn outages_on(&self, span_s: (f64, f64), seed: u64) -> Result<PlacedOutages, OutageError> {
        let fixes = Fixes::Every {
            interval_s: 1.0 / self.gnss.rate_hz,
        };
        self.outages().on(&FixedData { span_s, fixes }, seed)
    }

    /// The outages requested: the paper's two when nothing is said.
    fn outages(&self) -> OutagePlan {
        let said =
            self.outage.is_some() || self.outage_periodic.is_some() || self.outage_random.is_some();
        OutagePlan {
            fixed: self.outage.clone().unwrap_or_default(),
            default: if said {
                Vec::new()
            } else {
                Outage::PAPER.to_vec()
            },
            periodic: self.outage_periodic,
            random: self.outage_random,
        }
    }
}

// What is true and the filter does not expect.

impl Scenario {
    /// Returns true if the scenario states no error of the true IMU, receiver or aiding.
    pub fn has_no_errors(&self) -> bool {
        self.imu.is_ideal() && self.aiding.errors().is_empty() && self.unexpected().is_empty()
    }

    /// Errors of the true IMU and receiver that the filter does not model, each with its remedy; they make the filter
    /// overconfident.
    pub fn unexpected(&self) -> Vec<String> {
        let mut found = Vec::new();
        for sensor in Sensor::ALL {
            let (bias, ppm) = self.imu.deviations(sensor);
            let [bias_key, scale_key] = [
                InitialSettings::bias_key(sensor),
                InitialSettings::scale_key(sensor),
            ];
            let by_default = self.filter.states.scale_sigma() * 1e6;
            let bias_remedy = format!("initial.{bias_key}");
            let scale_remedy = format!("--scale-ppm (initial.{scale_key})");
            for (what, is, unit, expected, remedy) in [
                (
                    "turn-on bias",
                    bias,
                    sensor.unit(),
                    self.initial.bias_sigma(sensor).unwrap_or(0.0),
                    bias_remedy,
                ),
                (
                    "scale-factor error",
                    ppm,
                    "ppm",
                    self.initial.scale_sigma_ppm(sensor).unwrap_or(by_default),
                    scale_remedy,
                ),
            ] {
                // below half the true sigma the errors may be twice as large as stated
                if expected < 0.5 * is {
                    found.push(format!(
                        "the true {sensor} has a {what} of {is} {unit}, the filter expects {expected}: {remedy} adds states"
                    ));
                }
            }
        }
        for (sensor, key, sigma, unit) in self.imu.without_states() {
            // Under constant gravity, vibration and final temperature these errors act mostly as a bias: a bias state
            // absorbs them.
            let remedy = sensor.map_or("calibrate the IMU for it".to_owned(), |sensor| {
                let key = InitialSettings::bias_key(sensor);
                format!("initial.{key} adds states")
            });
            found.push(format!(
                "imu.{key} = {sigma} {unit} is in no filter: {remedy}"
            ));
        }
        let GnssSettings {
            rate_hz,
            pos_sigma_m,
            correlated_pos_sigma_m: sigma_m,
            correlation_time_s,
            ..
        } = self.gnss;
        // A filter averages the white error of `fixes` fixes during one correlation time; the correlated error matters
        // once it exceeds half of that average.
        let fixes = (rate_hz * correlation_time_s).max(1.0);
        if (0..3).any(|i| sigma_m[i] > 0.5 * pos_sigma_m[i] / fixes.sqrt()) {
            let [n, e, d] = sigma_m;
            found.push(format!(
                "the true receiver errs by {n}, {e}, {d} m over {correlation_time_s} s, the filter expects white errors: a larger gnss.pos_sigma_m"
            ));
        }
        for (source, key) in self.aiding.unexpected() {
            let remedy = if key.ends_with("sigma_m_s") || key == "aiding.heading.sigma_deg" {
                format!("a larger {key} (nav-sim tune --scenario FILE finds it)")
            } else {
                format!("{key} adds states")
            };
            found.push(format!(
                "the truth has more {source} than the filter expects: {remedy}"
            ));
        }
        found
    }
}

#[cfg(test)]
#[path = "scenario_tests.rs"]
mod scenario_tests;

#[cfg(test)]
#[path = "scenario_aiding_tests.rs"]
pub(crate) mod aiding_tests;
