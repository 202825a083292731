//! What model files hold, for the reader and for editors.

use crate::io::toml_file::{
    Between, Finite, NonNegative, OneOrEach, Positive, Stationary, Version,
};
use nav_sim_signal::imu::MAX_RATE_HZ;
use nav_sim_signal::noise::{Law, LognormalIntervals};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value};

/// What nav-sim calibrate writes and run, fuse, synthesize, export read
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Noise model")]
pub(super) struct Description {
    /// Version of the layout
    #[serde(rename = "schema")]
    _schema: Option<Version>,
    /// Sample rate that the variances are of (Hz)
    #[schemars(with = "Positive", range(max = MAX_RATE_HZ))]
    pub(super) rate_hz: Finite,
    pub(super) accel: Option<SensorTable>,
    pub(super) gyro: Option<SensorTable>,
    pub(super) turn_on: Option<TurnOnTable>,
    pub(super) spread: Option<SpreadTable>,
    /// How the model was made
    #[schemars(with = "Option<Map<String, Value>>")]
    pub(super) provenance: Option<toml::Table>,
}

/// All three axes by `processes`, or each by x, y, z
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct SensorTable {
    pub(super) processes: Option<Vec<ProcessTable>>,
    pub(super) x: Option<AxisTable>,
    pub(super) y: Option<AxisTable>,
    pub(super) z: Option<AxisTable>,
}

/// One axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
#[expect(
    dead_code,
    reason = "its values are read by the names of their parameters"
)]
pub(super) struct AxisTable {
    pub(super) processes: Vec<ProcessTable>,
}

/// Ends of a 95 % interval.
type Ends = [f64; 2];

/// A process: variances in units² of the signal
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(tag = "type", inline)]
#[expect(
    dead_code,
    reason = "its values are read by the names of their parameters"
)]
pub(super) enum ProcessTable {
    /// White noise: variance a sample
    WN {
        #[schemars(with = "NonNegative")]
        sigma2: Finite,
        sigma2_ci95: Option<Ends>,
    },
    /// Quantization noise, Q²
    QN {
        #[schemars(with = "NonNegative")]
        q2: Finite,
        q2_ci95: Option<Ends>,
    },
    /// First-order autoregression: coefficient e^(−1/(rate × correlation time)), variance of the innovation
    AR1 {
        #[schemars(with = "Stationary")]
        phi: Finite,
        phi_ci95: Option<Ends>,
        #[schemars(with = "NonNegative")]
        sigma2: Finite,
        sigma2_ci95: Option<Ends>,
    },
    /// Gauss-Markov process: reciprocal correlation time (1/s), variance of the process
    GM {
        #[schemars(with = "Positive")]
        beta: Finite,
        beta_ci95: Option<Ends>,
        #[schemars(with = "NonNegative")]
        s2: Finite,
        s2_ci95: Option<Ends>,
    },
    /// First-order moving average: coefficient, variance of the innovation
    MA1 {
        #[schemars(with = "Between<-1, 1, false>")]
        theta: Finite,
        theta_ci95: Option<Ends>,
        #[schemars(with = "NonNegative")]
        sigma2: Finite,
        sigma2_ci95: Option<Ends>,
    },
    /// Flicker noise, B²: bias instability
    FN {
        #[schemars(with = "NonNegative")]
        b2: Finite,
        b2_ci95: Option<Ends>,
    },
    /// Random walk: variance of an increment
    RW {
        #[schemars(with = "NonNegative")]
        gamma2: Finite,
        gamma2_ci95: Option<Ends>,
    },
    /// Drift (units a sample)
    DR {
        slope: Finite,
        slope_ci95: Option<Ends>,
    },
}

/// Standard deviations of the constant bias of a switching-on: one, or one for each axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub(super) struct TurnOnTable {
    pub(super) accel_m_s2: Option<OneOrEach<Finite, [Finite; 3]>>,
    pub(super) gyro_rad_s: Option<OneOrEach<Finite, [Finite; 3]>>,
}

/// How parameters vary between recordings: of all three axes of a sensor, or of each
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpreadTable {
    pub(super) accel: Option<OneOrEach<LawAxes, Vec<LawTable>>>,
    pub(super) gyro: Option<OneOrEach<LawAxes, Vec<LawTable>>>,
}

/// Laws of each axis
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
pub(super) struct LawAxes {
    pub(super) x: Vec<LawTable>,
    pub(super) y: Vec<LawTable>,
    pub(super) z: Vec<LawTable>,
}

/// The law of a parameter of one process, such as AR1_2
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub(super) struct LawTable {
    pub(super) process: String,
    pub(super) parameter: String,
    #[schemars(flatten)]
    pub(super) distribution: Distribution,
}

#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
#[schemars(tag = "distribution", !deny_unknown_fields)]
pub(super) enum Distribution {
    /// low + width × a beta law
    Beta {
        a: Finite,
        b: Finite,
        low: Finite,
        width: Finite,
    },
    /// A normal law about the parameter
    Normal { sd: Finite },
    /// A normal law of the logarithm of the parameter, of phi and beta of that of the correlation time
    Lognormal {
        median: Finite,
        median_ci95: Option<Ends>,
        sd: Finite,
        sd_ci95: Option<Ends>,
    },
}

impl Distribution {
    pub(super) fn law(&self) -> Law {
        match *self {
            Self::Beta {
                a: Finite(a),
                b: Finite(b),
                low: Finite(low),
                width: Finite(width),
            } => Law::Beta { a, b, low, width },
            Self::Normal { sd: Finite(sd) } => Law::Normal { sd },
            Self::Lognormal {
                median: Finite(median),
                median_ci95,
                sd: Finite(sd),
                sd_ci95,
            } => {
                let ends = median_ci95.zip(sd_ci95);
                let ci95 = ends.map(|(median, sd)| LognormalIntervals { median, sd });
                Law::Lognormal { median, sd, ci95 }
            }
        }
    }
}

/// The JSON schema of a model file, for editors and checkers.
#[must_use]
pub(crate) fn schema() -> Value {
    schemars::schema_for!(Description).to_value()
}
