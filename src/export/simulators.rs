//! Simulators of an IMU.

use super::layout::{Layout, PLAIN, number, remark, triple};
use super::{Entry, SensorValues, Values};
use nav_sim_signal::noise::practical::{Bias, Markov};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR};

/// √3600: from per √s to per √h.
const ROOT_HOUR: f64 = 60.0;

pub(super) const GNSS_INS_SIM: Layout = Layout {
    entries: gnss_ins_sim,
    bias: Bias::Markov,
    open: "import numpy as np\n\nimu_err = {",
    close: "}",
    line: |entry| {
        let values = if entry.value.is_finite() {
            triple(entry.value)
        } else {
            "np.inf, np.inf, np.inf".into()
        };
        format!(
            "    '{}': np.array([{values}]),  # {}",
            entry.key,
            remark(entry)
        )
    },
    source: "gnss-ins-sim README, \"Define the IMU model\"",
    ..PLAIN
};

/// gnss-ins-sim: a Gauss-Markov bias whose "stability" is its standard deviation
/// (<https://github.com/Aceinna/gnss-ins-sim>, README and imu_model.py).
fn gnss_ins_sim(v: &Values) -> Vec<Entry> {
    let rate = format!("simulated at any rate, IMU at {} Hz", v.rate_hz);
    let sigma = "Gauss-Markov bias, standard deviation";
    let n = format!("white noise N, {rate}");
    let ((accel_b, a_meaning), (gyro_b, g_meaning)) = (constant(&v.accel), constant(&v.gyro));
    vec![
        Entry::new("gyro_b", gyro_b / DEG_PER_HOUR, "deg/hr", g_meaning),
        Entry::new(
            "gyro_arw",
            v.gyro.density / DEG * ROOT_HOUR,
            "deg/rt-hr",
            n.as_str(),
        ),
        Entry::new(
            "gyro_b_stability",
            v.gyro.markov.sigma / DEG_PER_HOUR,
            "deg/hr",
            sigma,
        ),
        Entry::new(
            "gyro_b_corr",
            v.gyro.markov.t_corr_s,
            "s",
            "its correlation time",
        ),
        Entry::new("accel_b", accel_b, "m/s^2", a_meaning),
        Entry::new(
            "accel_vrw",
            v.accel.density * ROOT_HOUR,
            "m/s/rt-hr",
            n.as_str(),
        ),
        Entry::new("accel_b_stability", v.accel.markov.sigma, "m/s^2", sigma),
        Entry::new(
            "accel_b_corr",
            v.accel.markov.t_corr_s,
            "s",
            "its correlation time",
        ),
    ]
}

/// The constant bias to simulate: that of one standard deviation, where the model states a turn-on bias.
fn constant(sensor: &SensorValues) -> (f64, &'static str) {
    match sensor.turn_on {
        Some(sigma) => (
            sigma,
            "constant bias, one standard deviation of the turn-on bias",
        ),
        None => (0.0, "constant bias; the model states no turn-on bias"),
    }
}

pub(super) const MATLAB: Layout = Layout {
    entries: matlab,
    bias: Bias::Markov,
    comment: "%",
    open: "accel = accelparams('NoiseType', 'single-sided');\ngyro = gyroparams('NoiseType', 'single-sided');",
    close: "imu = imuSensor('accel-gyro', 'SampleRate', SampleRate, 'Accelerometer', accel, 'Gyroscope', gyro);",
    line: |entry| match entry.key {
        "accel.BiasInstabilityCoefficients" | "gyro.BiasInstabilityCoefficients" => format!(
            "{} = struct('Numerator', 1, 'Denominator', [1 {}]);  % {}",
            entry.key,
            number(-entry.value),
            remark(entry)
        ),
        _ => format!(
            "{} = {};  % {}",
            entry.key,
            number(entry.value),
            remark(entry)
        ),
    },
    source: "MATLAB, accelparams, gyroparams and imuSensor (Navigation Toolbox)",
    ..PLAIN
};

/// MATLAB's `imuSensor`: with `NoiseType` "single-sided" a sample has NoiseDensity·√f, as here
/// (<https://www.mathworks.com/help/nav/ref/gyroparams-properties.html>; the default "double-sided" would want √2 N). White
/// noise of standard deviation `BiasInstability` through 1/(1 − phi z⁻¹) is the Gauss-Markov bias, exactly, at this rate.
fn matlab(v: &Values) -> Vec<Entry> {
    let rate = format!("at {} Hz", v.rate_hz);
    let n = format!("white noise N, single-sided, {rate}");
    let innovation = format!("noise that drives the Gauss-Markov bias, {rate}");
    let none = "none beside the Gauss-Markov bias";
    let phi = |t: f64| (-1.0 / (t * v.rate_hz)).exp();
    // 1 − phi² without cancellation
    let drive = |m: Markov| m.sigma * (-(-2.0 / (m.t_corr_s * v.rate_hz)).exp_m1()).sqrt();
    let pole = |m: Markov| {
        format!(
            "phi of the bias, standard deviation {}, correlation time {} s",
            number(m.sigma),
            number(m.t_corr_s)
        )
    };
    let (a, g) = (&v.accel, &v.gyro);
    vec![
        Entry::new("SampleRate", v.rate_hz, "Hz", "rate of the IMU"),
        Entry::new(
            "accel.NoiseDensity",
            a.density,
            "(m/s^2)/sqrt(Hz)",
            n.as_str(),
        ),
        Entry::new(
            "accel.BiasInstability",
            drive(a.markov),
            "m/s^2",
            innovation.as_str(),
        ),
        Entry::new(
            "accel.BiasInstabilityCoefficients",
            phi(a.markov.t_corr_s),
            "1",
            pole(a.markov),
        ),
        Entry::new("accel.RandomWalk", 0.0, "(m/s^2)*sqrt(Hz)", none),
        Entry::new(
            "gyro.NoiseDensity",
            g.density,
            "(rad/s)/sqrt(Hz)",
            n.as_str(),
        ),
        Entry::new(
            "gyro.BiasInstability",
            drive(g.markov),
            "rad/s",
            innovation.as_str(),
        ),
        Entry::new(
            "gyro.BiasInstabilityCoefficients",
            phi(g.markov.t_corr_s),
            "1",
            pole(g.markov),
        ),
        Entry::new("gyro.RandomWalk", 0.0, "(rad/s)*sqrt(Hz)", none),
    ]
}
