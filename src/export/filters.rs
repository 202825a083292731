//! INS/GNSS filters.

use super::layout::{Layout, PLAIN, number, remark, triple};
use super::{Entry, Values};
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_signal::noise::practical::Bias;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR};

/// One milligal (m/s²).
const MILLIGAL: f64 = 1e-5;
/// √3600: from per √s to per √h.
const ROOT_HOUR: f64 = 60.0;
/// PSINS has a gravity of its own, `glv.g0` (m/s²).
const PSINS_G0: f64 = 9.780_326_771_4;
pub(super) const KF_GINS: Layout = Layout {
    entries: kf_gins,
    bias: Bias::Markov,
    open: "imunoise:",
    line: |entry| match entry.key {
        "corrtime" => format!(
            "  {}: {}  # {}",
            entry.key,
            number(entry.value),
            remark(entry)
        ),
        _ => format!(
            "  {}: [{}]  # {}",
            entry.key,
            triple(entry.value),
            remark(entry)
        ),
    },
    source: "KF-GINS, dataset/kf-gins.yaml; paste in the place of the same section",
    ..PLAIN
};

/// KF-GINS: white noise per √h and Gauss-Markov biases of one correlation time
/// (<https://github.com/i2Nav-WHU/KF-GINS>, dataset/kf-gins.yaml and its unit conversions in kf_gins.cpp).
fn kf_gins(v: &Values) -> Vec<Entry> {
    let rate = format!("IMU at {} Hz", v.rate_hz);
    let sigma = "Gauss-Markov bias, standard deviation";
    let hours = v.gyro.markov.t_corr_s.min(v.accel.markov.t_corr_s) / 3600.0;
    // KF-GINS always has such states, and a noise model knows nothing of them
    let scale_ppm = FilterStates::Reduced21.scale_sigma() * 1e6;
    let assumed = "an assumption: a noise model has no scale factor";
    vec![
        Entry::new(
            "arw",
            v.gyro.density / DEG * ROOT_HOUR,
            "deg/sqrt(hr)",
            format!("white noise N, {rate}"),
        ),
        Entry::new(
            "vrw",
            v.accel.density * ROOT_HOUR,
            "m/s/sqrt(hr)",
            format!("white noise N, {rate}"),
        ),
        Entry::new("gbstd", v.gyro.markov.sigma / DEG_PER_HOUR, "deg/hr", sigma),
        Entry::new("abstd", v.accel.markov.sigma / MILLIGAL, "mGal", sigma),
        Entry::new("gsstd", scale_ppm, "ppm", assumed),
        Entry::new("asstd", scale_ppm, "ppm", assumed),
        Entry::new(
            "corrtime",
            if hours.is_finite() { hours } else { 1.0 },
            "hr",
            "correlation time T of both biases",
        ),
    ]
}

pub(super) const NAVEGO: Layout = Layout {
    entries: navego,
    bias: Bias::Markov,
    comment: "%",
    line: |entry| match entry.key {
        "imu.freq" => format!(
            "{} = {};  % {}",
            entry.key,
            number(entry.value),
            remark(entry)
        ),
        _ => format!(
            "{} = {} * [1 1 1];  % {}",
            entry.key,
            matlab_number(entry.value),
            remark(entry)
        ),
    },
    source: "NaveGo, \"IMU data structure\" of its examples (SI units)",
    ..PLAIN
};

/// Numbers of MATLAB: infinity has its own name.
fn matlab_number(value: f64) -> String {
    if value.is_finite() {
        number(value)
    } else {
        "Inf".to_owned()
    }
}

/// NaveGo's imu structure in SI units (<https://github.com/rodralez/NaveGo>). Its filter drives the biases by white noise of
/// `gb_psd` and `ab_psd`: they are given as sigma √(2/T), so that the biases have the standard deviations given.
fn navego(v: &Values) -> Vec<Entry> {
    let root = v.rate_hz.sqrt();
    let rate = format!("IMU at {} Hz", v.rate_hz);
    let named = |what: &str| format!("{what}, {rate}");
    let (a, g) = (&v.accel, &v.gyro);
    vec![
        Entry::new(
            "imu.vrw",
            a.density,
            "m/s^2/sqrt(Hz)",
            named("white noise N"),
        ),
        Entry::new(
            "imu.arw",
            g.density,
            "rad/s/sqrt(Hz)",
            named("white noise N"),
        ),
        Entry::new(
            "imu.vrrw",
            a.walk,
            "m/s^3/sqrt(Hz)",
            named("random walk K, not used by the filter"),
        ),
        Entry::new(
            "imu.arrw",
            g.walk,
            "rad/s^2/sqrt(Hz)",
            named("random walk K, not used by the filter"),
        ),
        Entry::new(
            "imu.a_std",
            a.density * root,
            "m/s^2",
            named("white noise of a sample"),
        ),
        Entry::new(
            "imu.g_std",
            g.density * root,
            "rad/s",
            named("white noise of a sample"),
        ),
        Entry::new(
            "imu.ab_dyn",
            a.markov.sigma,
            "m/s^2",
            named("Gauss-Markov bias, standard deviation"),
        ),
        Entry::new(
            "imu.gb_dyn",
            g.markov.sigma,
            "rad/s",
            named("Gauss-Markov bias, standard deviation"),
        ),
        Entry::new(
            "imu.ab_corr",
            a.markov.t_corr_s,
            "s",
            named("its correlation time"),
        ),
        Entry::new(
            "imu.gb_corr",
            g.markov.t_corr_s,
            "s",
            named("its correlation time"),
        ),
        Entry::new(
            "imu.ab_psd",
            a.markov.drive(),
            "m/s^3/sqrt(Hz)",
            named("its driving noise"),
        ),
        Entry::new(
            "imu.gb_psd",
            g.markov.drive(),
            "rad/s^2/sqrt(Hz)",
            named("its driving noise"),
        ),
        Entry::new("imu.ab_sta", a.bias_sd, "m/s^2", named(a.bias_meaning)),
        Entry::new("imu.gb_sta", g.bias_sd, "rad/s", named(g.bias_meaning)),
        Entry::new("imu.freq", v.rate_hz, "Hz", "rate of the IMU"),
    ]
}

pub(super) const PSINS: Layout = Layout {
    entries: psins,
    bias: Bias::Markov,
    comment: "%",
    open: "glvs",
    close: "imuerr = imuerrset(eb, db, web, wdb, sqrtR0G, TauG, sqrtR0A, TauA);",
    line: |entry| {
        format!(
            "{} = {};  % {}",
            entry.key,
            matlab_number(entry.value),
            remark(entry)
        )
    },
    source: "PSINS, imuerrset.m",
    ..PLAIN
};

/// PSINS: the arguments of `imuerrset` (<http://www.psins.org.cn>, base/base1/imuerrset.m), with PSINS's own g0.
fn psins(v: &Values) -> Vec<Entry> {
    let ug = PSINS_G0 * 1e-6;
    let rate = format!("IMU at {} Hz", v.rate_hz);
    let (a, g) = (&v.accel, &v.gyro);
    let sigma = "Gauss-Markov bias, standard deviation";
    vec![
        Entry::new("eb", g.bias_sd / DEG_PER_HOUR, "deg/h", g.bias_meaning),
        Entry::new("db", a.bias_sd / ug, "ug", a.bias_meaning),
        Entry::new(
            "web",
            g.density / DEG * ROOT_HOUR,
            "deg/sqrt(h)",
            format!("white noise N, {rate}"),
        ),
        Entry::new(
            "wdb",
            a.density / ug,
            "ug/sqrt(Hz)",
            format!("white noise N, {rate}"),
        ),
        Entry::new("sqrtR0G", g.markov.sigma / DEG_PER_HOUR, "deg/h", sigma),
        Entry::new("TauG", g.markov.t_corr_s, "s", "its correlation time"),
        Entry::new("sqrtR0A", a.markov.sigma / ug, "ug", sigma),
        Entry::new("TauA", a.markov.t_corr_s, "s", "its correlation time"),
    ]
}

pub(super) const PYINS: Layout = Layout {
    entries: pyins,
    open: "from pyins.inertial_sensor import EstimationModel\n",
    close: "\naccel_model = EstimationModel(bias_sd=accel_bias_sd, noise=accel_noise, bias_walk=accel_bias_walk)\n\
            gyro_model = EstimationModel(bias_sd=gyro_bias_sd, noise=gyro_noise, bias_walk=gyro_bias_walk)",
    line: |entry| {
        format!(
            "{} = {}  # {}",
            entry.key,
            number(entry.value),
            remark(entry)
        )
    },
    source: "pyins.inertial_sensor.EstimationModel",
    ..PLAIN
};

/// pyins: SI units, root densities (<https://github.com/nmayorov/pyins>, pyins/inertial_sensor.py).
fn pyins(v: &Values) -> Vec<Entry> {
    let rate = format!("continuous-time, IMU at {} Hz", v.rate_hz);
    let (n, k) = (
        format!("white noise N, {rate}"),
        format!("bias random walk K, {rate}"),
    );
    vec![
        Entry::new(
            "accel_bias_sd",
            v.accel.bias_sd,
            "m/s^2",
            v.accel.bias_meaning,
        ),
        Entry::new("accel_noise", v.accel.density, "m/s^2/sqrt(Hz)", n.as_str()),
        Entry::new(
            "accel_bias_walk",
            v.accel.walk,
            "m/s^3/sqrt(Hz)",
            k.as_str(),
        ),
        Entry::new("gyro_bias_sd", v.gyro.bias_sd, "rad/s", v.gyro.bias_meaning),
        Entry::new("gyro_noise", v.gyro.density, "rad/s/sqrt(Hz)", n.as_str()),
        Entry::new(
            "gyro_bias_walk",
            v.gyro.walk,
            "rad/s^2/sqrt(Hz)",
            k.as_str(),
        ),
    ]
}
