//! The programs that parameters are written for: a template each, and the one substitution that fills them.
//!
//! `{gyro.N deg/sqrt(h)}` is white noise in that unit. A placeholder is `{QUANTITY [UNIT] [in LOW..HIGH] [else TEXT] [as KEY]}`;
//! those with a unit are the entries of the file, named by the first word of their line or by `as`. Quantities are those of
//! [`Export::quantity`], with `^2`, `*f`, `*sqrt(f)`, `*sqrt(2f)` or `/sqrt(SECONDS)` behind them; `in` clamps to the documented
//! range, `else` stands for what is not finite. `{=}` repeats the last value, `{unit}` its unit; `{head OPEN|CLOSE}` is the head of comments.

use super::{Export, ExportEntry, SensorExport};
use nav_sim_document::one_line;
use nav_sim_navigation::ekf::FilterStates;
use nav_sim_signal::names::UnknownName;
use nav_sim_signal::noise::practical::{Bias, Markov};
use nav_sim_signal::units::{DEG, DEG_PER_HOUR};
use std::str::FromStr;

/// A program that parameters are written for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Its name on the command line.
    pub name: &'static str,
    /// Role of the bias in the target's filter.
    pub(super) bias: Bias,
    /// True if both sensors share one correlation time.
    pub(super) has_one_time: bool,
    /// True if it flies a vehicle, whose vibration no static recording holds.
    pub(super) vibrates: bool,
    template: &'static str,
}

const WALK: Target = Target {
    name: "",
    bias: Bias::Walk,
    has_one_time: false,
    vibrates: false,
    template: "",
};
const MARKOV: Target = Target {
    bias: Bias::Markov,
    ..WALK
};

const TARGETS: [Target; 16] = [
    // Continuous-time densities, made discrete by update_rate (https://github.com/ethz-asl/kalibr/wiki/IMU-Noise-Model).
    Target {
        name: "kalibr",
        template: r#"{head # |}
# Keys and units: Kalibr wiki, "IMU Noise Model" and "YAML formats"
rostopic: /imu0  # the topic of your recording
accelerometer_noise_density: {accel.N m/s^2/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
accelerometer_random_walk: {accel.K m/s^3/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
gyroscope_noise_density: {gyro.N rad/s/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
gyroscope_random_walk: {gyro.K rad/s^2/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
update_rate: {rate Hz}  # {unit}; rate of the IMU"#,
        ..WALK
    },
    // The keys of Kalibr below imu0; it divides by the time step itself (https://docs.openvins.com/gs-calibration.html).
    Target {
        name: "openvins",
        template: r#"%YAML:1.0
{head # |}
# Keys and units: OpenVINS, kalibr_imu_chain.yaml; keep T_i_b, time_offset and the model of your own file
imu0:
  rostopic: /imu0  # the topic of your recording
  accelerometer_noise_density: {accel.N m/s^2/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
  accelerometer_random_walk: {accel.K m/s^3/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
  gyroscope_noise_density: {gyro.N rad/s/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
  gyroscope_random_walk: {gyro.K rad/s^2/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
  update_rate: {rate Hz}  # {unit}; rate of the IMU"#,
        ..WALK
    },
    // VINS-Mono and VINS-Fusion: standard deviations of a sample, N√(2f), and of the bias's slope over one sample interval, K√f:
    // the integration multiplies both by dt (https://github.com/HKUST-Aerial-Robotics/VINS-Mono,
    // vins_estimator/src/factor/integration_base.h). Its midpoint rule gives each end of an interval half the weight and takes the
    // ends as independent from interval to interval: a velocity grows by f·2·(dt/2)²·acc_n² a second, half of what noise of that
    // deviation in every sample makes. Hence the 2.
    Target {
        name: "vins",
        template: "{head # |}
# Keys and units: VINS-Mono and VINS-Fusion, config/*.yaml; paste in the place of the same keys
acc_n: {accel.N*sqrt(2f) m/s^2}  # {unit}; N sqrt(2f), noise of a sample in the midpoint rule, at {f} Hz
gyr_n: {gyro.N*sqrt(2f) rad/s}  # {unit}; N sqrt(2f), noise of a sample in the midpoint rule, at {f} Hz
acc_w: {accel.K*sqrt(f) m/s^3}  # {unit}; K sqrt(f), bias random walk of a sample, at {f} Hz
gyr_w: {gyro.K*sqrt(f) rad/s^2}  # {unit}; K sqrt(f), bias random walk of a sample, at {f} Hz",
        ..WALK
    },
    // Covariances of continuous-time noise, the squares of N and K
    // (https://docs.ros.org/en/api/gtsam/html/structgtsam_1_1PreintegrationCombinedParams.html).
    Target {
        name: "gtsam",
        template: "{head // |}
// Keys and units: GTSAM, PreintegrationParams.h and PreintegrationCombinedParams.h; setIntegrationCovariance is not a matter of the IMU
auto params = gtsam::PreintegrationCombinedParams::MakeSharedU(9.80665);  // m/s^2; gravity, z up
params->setAccelerometerCovariance({accel.N^2 (m/s^2)^2/Hz as setAccelerometerCovariance} * gtsam::I_3x3);  // {unit}; N^2, continuous-time, IMU at {f} Hz
params->setGyroscopeCovariance({gyro.N^2 (rad/s)^2/Hz as setGyroscopeCovariance} * gtsam::I_3x3);  // {unit}; N^2, continuous-time, IMU at {f} Hz
params->setBiasAccCovariance({accel.K^2 (m/s^3)^2/Hz as setBiasAccCovariance} * gtsam::I_3x3);  // {unit}; K^2, continuous-time, IMU at {f} Hz
params->setBiasOmegaCovariance({gyro.K^2 (rad/s^2)^2/Hz as setBiasOmegaCovariance} * gtsam::I_3x3);  // {unit}; K^2, continuous-time, IMU at {f} Hz",
        ..WALK
    },
    // Densities, which it squares for GTSAM, and of the biases takes times the root of the time between two nodes
    // (https://github.com/TixiaoShan/LIO-SAM, imuPreintegration.cpp).
    Target {
        name: "lio-sam",
        template: "{head # |}
# Keys and units: LIO-SAM, config/params.yaml; paste in the place of the same keys
lio_sam:
  imuAccNoise: {accel.N m/s^2/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
  imuGyrNoise: {gyro.N rad/s/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
  imuAccBiasN: {accel.K m/s^3/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
  imuGyrBiasN: {gyro.K rad/s^2/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz",
        ..WALK
    },
    // FAST-LIO2 and FAST-LIVO2: variances per sample, N²f and K²f: the covariance grows by (dt·f_w) Q (dt·f_w)ᵀ a sample, f times a
    // second (https://github.com/hku-mars/FAST_LIO, esekfom.hpp and IMU_Processing.hpp). What it ships is tuned to vibration.
    Target {
        name: "fast-lio",
        template: "{head # |}
# Keys and units: FAST-LIO2 and FAST-LIVO2, config/*.yaml; paste in the place of the same keys
mapping:
    acc_cov: {accel.N^2*f (m/s^2)^2}  # {unit}; N^2 f, of a sample at {f} Hz{shipped 0.1}
    gyr_cov: {gyro.N^2*f (rad/s)^2}  # {unit}; N^2 f, of a sample at {f} Hz{shipped 0.1}
    b_acc_cov: {accel.K^2*f (m/s^3)^2}  # {unit}; K^2 f, of a sample at {f} Hz{shipped 0.0001}
    b_gyr_cov: {gyro.K^2*f (rad/s^2)^2}  # {unit}; K^2 f, of a sample at {f} Hz{shipped 0.0001}",
        ..WALK
    },
    // The nine numbers of the message: the variance of a sample's white noise, N²f. What moves slowly is no noise of a sample, and
    // the filter that reads the message estimates it as a bias (https://docs.ros.org/en/api/sensor_msgs/html/msg/Imu.html).
    Target {
        name: "ros-imu-covariance",
        template: "{head # |}
# Keys and units: sensor_msgs/Imu.msg: covariances about x, y, z, row by row
orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]  # no orientation is measured
angular_velocity_covariance: [{gyro.N^2*f (rad/s)^2}, 0.0, 0.0, 0.0, {=}, 0.0, 0.0, 0.0, {=}]  # {unit}; N^2 f, white noise of a sample at {f} Hz
linear_acceleration_covariance: [{accel.N^2*f (m/s^2)^2}, 0.0, 0.0, 0.0, {=}, 0.0, 0.0, 0.0, {=}]  # {unit}; N^2 f, white noise of a sample at {f} Hz",
        ..WALK
    },
    // EKF2 adds (dt·noise)² to the variance of velocity or angle in a step of dt, and (dt·bias noise)² to that of the bias: N/√dt
    // and K/√dt (https://docs.px4.io/main/en/advanced_config/parameter_reference.html, covariance.cpp). The units follow: the bias
    // noise is in units per second.
    Target {
        name: "px4",
        vibrates: true,
        template: "{head # |}
# Keys and units: PX4 parameter reference, group EKF2
param set EKF2_ACC_NOISE {accel.N/sqrt(0.01) m/s^2 in 0.01..1 as EKF2_ACC_NOISE}  # {unit}; N/sqrt(dt), white noise, dt = 0.01 s (EKF2_PREDICT_US = 10000), range 0.01 to 1
param set EKF2_GYR_NOISE {gyro.N/sqrt(0.01) rad/s in 0.0001..0.1 as EKF2_GYR_NOISE}  # {unit}; N/sqrt(dt), white noise, dt = 0.01 s (EKF2_PREDICT_US = 10000), range 0.0001 to 0.1
param set EKF2_ACC_B_NOISE {accel.K/sqrt(0.01) m/s^3 in 0..0.01 as EKF2_ACC_B_NOISE}  # {unit}; K/sqrt(dt), bias, dt = 0.01 s (EKF2_PREDICT_US = 10000), range 0 to 0.01
param set EKF2_GYR_B_NOISE {gyro.K/sqrt(0.01) rad/s^2 in 0..0.01 as EKF2_GYR_B_NOISE}  # {unit}; K/sqrt(dt), bias, dt = 0.01 s (EKF2_PREDICT_US = 10000), range 0 to 0.01",
        ..WALK
    },
    // EKF3 adds (dt·noise)² to velocity and angle and (dt²·bias noise)² to biases of increments in a step of dt: N/√dt and K/√dt as
    // in PX4, with dt of 12 ms (https://ardupilot.org/copter/docs/parameters.html, AP_NavEKF3_core.cpp). Ground stations refuse a
    // line with more than a name and a value.
    Target {
        name: "ardupilot",
        vibrates: true,
        template: "{head # |}
# Keys and units: ArduPilot, complete parameter list, EK3_
EK3_ACC_P_NSE,{accel.N/sqrt(0.012) m/s^2 in 0.01..1}
# {unit}; N/sqrt(dt), white noise, dt = 0.012 s (EKF_TARGET_DT = 0.012), range 0.01 to 1
EK3_GYRO_P_NSE,{gyro.N/sqrt(0.012) rad/s in 0.0001..0.1}
# {unit}; N/sqrt(dt), white noise, dt = 0.012 s (EKF_TARGET_DT = 0.012), range 0.0001 to 0.1
EK3_ABIAS_P_NSE,{accel.K/sqrt(0.012) m/s^3 in 0.00001..0.02}
# {unit}; K/sqrt(dt), bias, dt = 0.012 s (EKF_TARGET_DT = 0.012), range 0.00001 to 0.02
EK3_GBIAS_P_NSE,{gyro.K/sqrt(0.012) rad/s^2 in 0.00001..0.001}
# {unit}; K/sqrt(dt), bias, dt = 0.012 s (EKF_TARGET_DT = 0.012), range 0.00001 to 0.001",
        ..WALK
    },
    // White noise per √h and Gauss-Markov biases of one correlation time (https://github.com/i2Nav-WHU/KF-GINS,
    // dataset/kf-gins.yaml and its unit conversions in kf_gins.cpp). It always has states of scale factors.
    Target {
        name: "kf-gins",
        has_one_time: true,
        template: "{head # |}
# Keys and units: KF-GINS, dataset/kf-gins.yaml; paste in the place of the same section
imunoise:
  arw: [{gyro.N deg/sqrt(hr)}, {=}, {=}]  # {unit}; white noise N, IMU at {f} Hz
  vrw: [{accel.N m/s/sqrt(hr)}, {=}, {=}]  # {unit}; white noise N, IMU at {f} Hz
  gbstd: [{gyro.sigma deg/hr}, {=}, {=}]  # {unit}; Gauss-Markov bias, standard deviation
  abstd: [{accel.sigma mGal}, {=}, {=}]  # {unit}; Gauss-Markov bias, standard deviation
  gsstd: [{scale ppm}, {=}, {=}]  # {unit}; an assumption: a noise model has no scale factor
  asstd: [{scale ppm}, {=}, {=}]  # {unit}; an assumption: a noise model has no scale factor
  corrtime: {T hr else 1.0}  # {unit}; correlation time T of both biases",
        ..MARKOV
    },
    // SI units (https://github.com/rodralez/NaveGo). The filter drives the biases by white noise of gb_psd and ab_psd: they are
    // given as sigma √(2/T), so that the biases have the standard deviations given.
    Target {
        name: "navego",
        template: r#"{head % |}
% Keys and units: NaveGo, "IMU data structure" of its examples (SI units)
imu.vrw = {accel.N m/s^2/sqrt(Hz)} * [1 1 1];  % {unit}; white noise N, IMU at {f} Hz
imu.arw = {gyro.N rad/s/sqrt(Hz)} * [1 1 1];  % {unit}; white noise N, IMU at {f} Hz
imu.vrrw = {accel.K m/s^3/sqrt(Hz)} * [1 1 1];  % {unit}; random walk K, not used by the filter, IMU at {f} Hz
imu.arrw = {gyro.K rad/s^2/sqrt(Hz)} * [1 1 1];  % {unit}; random walk K, not used by the filter, IMU at {f} Hz
imu.a_std = {accel.N*sqrt(f) m/s^2} * [1 1 1];  % {unit}; white noise of a sample, IMU at {f} Hz
imu.g_std = {gyro.N*sqrt(f) rad/s} * [1 1 1];  % {unit}; white noise of a sample, IMU at {f} Hz
imu.ab_dyn = {accel.sigma m/s^2} * [1 1 1];  % {unit}; Gauss-Markov bias, standard deviation, IMU at {f} Hz
imu.gb_dyn = {gyro.sigma rad/s} * [1 1 1];  % {unit}; Gauss-Markov bias, standard deviation, IMU at {f} Hz
imu.ab_corr = {accel.T s else Inf} * [1 1 1];  % {unit}; its correlation time, IMU at {f} Hz
imu.gb_corr = {gyro.T s else Inf} * [1 1 1];  % {unit}; its correlation time, IMU at {f} Hz
imu.ab_psd = {accel.drive m/s^3/sqrt(Hz)} * [1 1 1];  % {unit}; its driving noise, IMU at {f} Hz
imu.gb_psd = {gyro.drive rad/s^2/sqrt(Hz)} * [1 1 1];  % {unit}; its driving noise, IMU at {f} Hz
imu.ab_sta = {accel.start m/s^2} * [1 1 1];  % {unit}; standard deviation of the bias at the start{accel.unstated}
imu.gb_sta = {gyro.start rad/s} * [1 1 1];  % {unit}; standard deviation of the bias at the start{gyro.unstated}
imu.freq = {rate Hz};  % {unit}; rate of the IMU"#,
        ..MARKOV
    },
    // The arguments of imuerrset (http://www.psins.org.cn, base/base1/imuerrset.m), with PSINS's own g0.
    Target {
        name: "psins",
        template: "{head % |}
% Keys and units: PSINS, imuerrset.m
glvs
eb = {gyro.start deg/h};  % {unit}; standard deviation of the bias at the start{gyro.unstated}
db = {accel.start ug};  % {unit}; standard deviation of the bias at the start{accel.unstated}
web = {gyro.N deg/sqrt(h)};  % {unit}; white noise N, IMU at {f} Hz
wdb = {accel.N ug/sqrt(Hz)};  % {unit}; white noise N, IMU at {f} Hz
sqrtR0G = {gyro.sigma deg/h};  % {unit}; Gauss-Markov bias, standard deviation
TauG = {gyro.T s else Inf};  % {unit}; its correlation time
sqrtR0A = {accel.sigma ug};  % {unit}; Gauss-Markov bias, standard deviation
TauA = {accel.T s else Inf};  % {unit}; its correlation time
imuerr = imuerrset(eb, db, web, wdb, sqrtR0G, TauG, sqrtR0A, TauA);",
        ..MARKOV
    },
    // A Gauss-Markov bias whose \"stability\" is its standard deviation (https://github.com/Aceinna/gnss-ins-sim, README and
    // imu_model.py). The constant bias is that of one standard deviation, where the model states a turn-on bias.
    Target {
        name: "gnss-ins-sim",
        template: r#"{head # |}
# Keys and units: gnss-ins-sim README, "Define the IMU model"
import numpy as np

imu_err = {
    'gyro_b': np.array([{gyro.turn_on deg/hr}, {=}, {=}]),  # {unit}; constant bias, one standard deviation of the turn-on bias{gyro.unstated}
    'gyro_arw': np.array([{gyro.N deg/rt-hr}, {=}, {=}]),  # {unit}; white noise N, simulated at any rate, IMU at {f} Hz
    'gyro_b_stability': np.array([{gyro.sigma deg/hr}, {=}, {=}]),  # {unit}; Gauss-Markov bias, standard deviation
    'gyro_b_corr': np.array([{gyro.T s else np.inf}, {=}, {=}]),  # {unit}; its correlation time
    'accel_b': np.array([{accel.turn_on m/s^2}, {=}, {=}]),  # {unit}; constant bias, one standard deviation of the turn-on bias{accel.unstated}
    'accel_vrw': np.array([{accel.N m/s/rt-hr}, {=}, {=}]),  # {unit}; white noise N, simulated at any rate, IMU at {f} Hz
    'accel_b_stability': np.array([{accel.sigma m/s^2}, {=}, {=}]),  # {unit}; Gauss-Markov bias, standard deviation
    'accel_b_corr': np.array([{accel.T s else np.inf}, {=}, {=}]),  # {unit}; its correlation time
}"#,
        ..MARKOV
    },
    // SI units, root densities (https://github.com/nmayorov/pyins, pyins/inertial_sensor.py).
    Target {
        name: "pyins",
        template: "{head # |}
# Keys and units: pyins.inertial_sensor.EstimationModel
from pyins.inertial_sensor import EstimationModel

accel_bias_sd = {accel.start m/s^2}  # {unit}; standard deviation of the bias at the start{accel.unstated}
accel_noise = {accel.N m/s^2/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
accel_bias_walk = {accel.K m/s^3/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz
gyro_bias_sd = {gyro.start rad/s}  # {unit}; standard deviation of the bias at the start{gyro.unstated}
gyro_noise = {gyro.N rad/s/sqrt(Hz)}  # {unit}; white noise N, continuous-time, IMU at {f} Hz
gyro_bias_walk = {gyro.K rad/s^2/sqrt(Hz)}  # {unit}; bias random walk K, continuous-time, IMU at {f} Hz

accel_model = EstimationModel(bias_sd=accel_bias_sd, noise=accel_noise, bias_walk=accel_bias_walk)
gyro_model = EstimationModel(bias_sd=gyro_bias_sd, noise=gyro_noise, bias_walk=gyro_bias_walk)",
        ..WALK
    },
    // imuSensor: with NoiseType "single-sided" a sample has NoiseDensity·√f, as here
    // (https://www.mathworks.com/help/nav/ref/gyroparams-properties.html; the default "double-sided" would want √2 N). White noise
    // of standard deviation BiasInstability through 1/(1 − phi z⁻¹) is the Gauss-Markov bias, exactly, at this rate.
    Target {
        name: "matlab",
        template: "{head % |}
% Keys and units: MATLAB, accelparams, gyroparams and imuSensor (Navigation Toolbox)
accel = accelparams('NoiseType', 'single-sided');
gyro = gyroparams('NoiseType', 'single-sided');
SampleRate = {rate Hz};  % {unit}; rate of the IMU
accel.NoiseDensity = {accel.N (m/s^2)/sqrt(Hz)};  % {unit}; white noise N, single-sided, at {f} Hz
accel.BiasInstability = {accel.step m/s^2};  % {unit}; noise that drives the Gauss-Markov bias, at {f} Hz
accel.BiasInstabilityCoefficients = struct('Numerator', 1, 'Denominator', [1 -{accel.phi 1}]);  % {unit}; phi of the bias, standard deviation {accel.sigma}, correlation time {accel.T else Inf} s
accel.RandomWalk = {0 (m/s^2)*sqrt(Hz)};  % {unit}; none beside the Gauss-Markov bias
gyro.NoiseDensity = {gyro.N (rad/s)/sqrt(Hz)};  % {unit}; white noise N, single-sided, at {f} Hz
gyro.BiasInstability = {gyro.step rad/s};  % {unit}; noise that drives the Gauss-Markov bias, at {f} Hz
gyro.BiasInstabilityCoefficients = struct('Numerator', 1, 'Denominator', [1 -{gyro.phi 1}]);  % {unit}; phi of the bias, standard deviation {gyro.sigma}, correlation time {gyro.T else Inf} s
gyro.RandomWalk = {0 (rad/s)*sqrt(Hz)};  % {unit}; none beside the Gauss-Markov bias
imu = imuSensor('accel-gyro', 'SampleRate', SampleRate, 'Accelerometer', accel, 'Gyroscope', gyro);",
        ..MARKOV
    },
    // SDF: white noise of a sample, a constant bias drawn once, and a bias of each sample b ← b·exp(−dt/τ) + σ_d·w with
    // σ_d² = −s²τ/2·expm1(−2dt/τ): stationary with s²τ/2, so that s = σ√(2/τ) makes a Gauss-Markov process of σ exactly, from zero
    // at the start (https://github.com/gazebosim/gz-sensors, GaussianNoiseModel.cc). A correlation time of 0 switches it off.
    Target {
        name: "gazebo",
        template: r#"{head <!-- | -->}
<!-- Keys and units: SDF specification, sensor/imu; gz-sensors, GaussianNoiseModel.cc -->
<imu>
  <angular_velocity>
    <x><noise type="gaussian">
      <mean>0</mean>
      <stddev>{gyro.N*sqrt(f) rad/s as angular_velocity.stddev}</stddev>  <!-- {unit}; N sqrt(f), white noise of a sample at {f} Hz -->
      <bias_mean>{0 rad/s as angular_velocity.bias_mean}</bias_mean>  <!-- {unit}; mean of the turn-on bias -->
      <bias_stddev>{gyro.turn_on rad/s as angular_velocity.bias_stddev}</bias_stddev>  <!-- {unit}; turn-on bias, standard deviation{gyro.unstated} -->
      <dynamic_bias_stddev>{gyro.drive rad/s/sqrt(s) as angular_velocity.dynamic_bias_stddev}</dynamic_bias_stddev>  <!-- {unit}; sigma sqrt(2/T) of the Gauss-Markov bias, which starts at 0 -->
      <dynamic_bias_correlation_time>{gyro.T_or_0 s as angular_velocity.dynamic_bias_correlation_time}</dynamic_bias_correlation_time>  <!-- {unit}; its correlation time -->
    </noise></x>
    <y><noise type="gaussian">
      <mean>0</mean>
      <stddev>{gyro.N*sqrt(f)}</stddev>
      <bias_mean>0.0</bias_mean>
      <bias_stddev>{gyro.turn_on}</bias_stddev>
      <dynamic_bias_stddev>{gyro.drive}</dynamic_bias_stddev>
      <dynamic_bias_correlation_time>{gyro.T_or_0}</dynamic_bias_correlation_time>
    </noise></y>
    <z><noise type="gaussian">
      <mean>0</mean>
      <stddev>{gyro.N*sqrt(f)}</stddev>
      <bias_mean>0.0</bias_mean>
      <bias_stddev>{gyro.turn_on}</bias_stddev>
      <dynamic_bias_stddev>{gyro.drive}</dynamic_bias_stddev>
      <dynamic_bias_correlation_time>{gyro.T_or_0}</dynamic_bias_correlation_time>
    </noise></z>
  </angular_velocity>
  <linear_acceleration>
    <x><noise type="gaussian">
      <mean>0</mean>
      <stddev>{accel.N*sqrt(f) m/s^2 as linear_acceleration.stddev}</stddev>  <!-- {unit}; N sqrt(f), white noise of a sample at {f} Hz -->
      <bias_mean>{0 m/s^2 as linear_acceleration.bias_mean}</bias_mean>  <!-- {unit}; mean of the turn-on bias -->
      <bias_stddev>{accel.turn_on m/s^2 as linear_acceleration.bias_stddev}</bias_stddev>  <!-- {unit}; turn-on bias, standard deviation{accel.unstated} -->
      <dynamic_bias_stddev>{accel.drive m/s^2/sqrt(s) as linear_acceleration.dynamic_bias_stddev}</dynamic_bias_stddev>  <!-- {unit}; sigma sqrt(2/T) of the Gauss-Markov bias, which starts at 0 -->
      <dynamic_bias_correlation_time>{accel.T_or_0 s as linear_acceleration.dynamic_bias_correlation_time}</dynamic_bias_correlation_time>  <!-- {unit}; its correlation time -->
    </noise></x>
    <y><noise type="gaussian">
      <mean>0</mean>
      <stddev>{accel.N*sqrt(f)}</stddev>
      <bias_mean>0.0</bias_mean>
      <bias_stddev>{accel.turn_on}</bias_stddev>
      <dynamic_bias_stddev>{accel.drive}</dynamic_bias_stddev>
      <dynamic_bias_correlation_time>{accel.T_or_0}</dynamic_bias_correlation_time>
    </noise></y>
    <z><noise type="gaussian">
      <mean>0</mean>
      <stddev>{accel.N*sqrt(f)}</stddev>
      <bias_mean>0.0</bias_mean>
      <bias_stddev>{accel.turn_on}</bias_stddev>
      <dynamic_bias_stddev>{accel.drive}</dynamic_bias_stddev>
      <dynamic_bias_correlation_time>{accel.T_or_0}</dynamic_bias_correlation_time>
    </noise></z>
  </linear_acceleration>
</imu>"#,
        ..MARKOV
    },
];

impl Target {
    /// All of them.
    pub const ALL: [Self; TARGETS.len()] = TARGETS;
    /// Their names, in the same order.
    pub const NAMES: [&'static str; TARGETS.len()] = {
        let (mut names, mut i) = ([""; TARGETS.len()], 0);
        while i < TARGETS.len() {
            names[i] = TARGETS[i].name;
            i += 1;
        }
        names
    };
}

impl FromStr for Target {
    type Err = UnknownName;

    fn from_str(word: &str) -> Result<Self, UnknownName> {
        TARGETS
            .into_iter()
            .find(|target| target.name == word)
            .ok_or_else(|| UnknownName {
                word: word.to_owned(),
                legal: &Self::NAMES,
            })
    }
}

/// PSINS has a gravity of its own, `glv.g0` (m/s²); no other target has µg.
const PSINS_UG: f64 = 9.780_326_771_4e-6;
/// √3600: from per √s to per √h.
const ROOT_HOUR: f64 = 60.0;

/// A quantity in a unit of some target, from SI.
fn in_unit(x: f64, unit: &str) -> f64 {
    match unit {
        "deg/sqrt(h)" | "deg/sqrt(hr)" | "deg/rt-hr" => x / DEG * ROOT_HOUR,
        "m/s/sqrt(hr)" | "m/s/rt-hr" => x * ROOT_HOUR,
        "deg/h" | "deg/hr" => x / DEG_PER_HOUR,
        "mGal" => x / 1e-5,
        "ug" | "ug/sqrt(Hz)" => x / PSINS_UG,
        "hr" => x / 3600.0,
        "ppm" => x * 1e6,
        _ => x,
    }
}

/// A number that reads back to the same, with a point: YAML 1.1 takes `2e-5` for a text.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0.0".to_owned();
    }
    let is_plain = (1e-3..1e6).contains(&value.abs());
    let text = if is_plain {
        format!("{value}")
    } else {
        format!("{value:e}")
    };
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, ""));
    let point = if digits.contains('.') { "" } else { ".0" };
    let e = if is_plain { "" } else { "e" };
    format!("{digits}{point}{e}{exponent}")
}

/// A text that stays within its comment, whatever a file is called: no line of its own, no control sequence, no end of XML.
fn comment(text: &str) -> String {
    one_line(text).replace("--", "- -")
}

impl Export {
    /// Fills the template: the entries of the file, and its text below the comments of `head`.
    pub(super) fn filled(&self, head: &[String]) -> (Vec<ExportEntry>, String) {
        let (mut entries, mut text): (Vec<ExportEntry>, String) = (Vec::new(), String::new());
        let mut last = String::new();
        for template in self.target.template.lines() {
            let (mut line, mut rest, mut meaning) = (String::new(), template, None);
            while let Some((before, placeholder, after)) = next(rest) {
                line += before;
                let (name, argument) = placeholder.split_once(' ').unwrap_or((placeholder, ""));
                match (name, entries.last()) {
                    ("=", _) => line += &last,
                    ("f", _) => line += &self.rate_hz.to_string(),
                    ("head", _) => {
                        let (open, close) = argument.split_once('|').unwrap_or_default();
                        let comments: Vec<String> = head
                            .iter()
                            .map(|l| format!("{open}{}{close}", comment(l)))
                            .collect();
                        line += &comments.join("\n");
                    }
                    ("unit", Some(entry)) => {
                        line += entry.unit;
                        meaning = Some(line.len());
                    }
                    ("accel.unstated" | "gyro.unstated", _) => {
                        let sensor = &self.sensors[usize::from(name.starts_with('g'))];
                        if sensor.turn_on.is_none() {
                            line += "; the model states no turn-on bias";
                        }
                    }
                    ("shipped", Some(entry)) if entry.value > 0.0 => {
                        let times = nav_sim_document::readable(
                            (argument.parse().unwrap_or(f64::NAN) / entry.value).sqrt(),
                        );
                        line += &format!(
                            "; the shipped {argument} is {times} times its standard deviation"
                        );
                    }
                    ("shipped" | "unit", _) => {}
                    _ => {
                        let (shown, entry) = self.value(name, argument, &line);
                        line += &shown;
                        last = shown;
                        entries.extend(entry);
                    }
                }
                rest = after;
            }
            line += rest;
            if let (Some(start), Some(entry)) = (meaning, entries.last_mut()) {
                entry.meaning = line[start..].trim_matches([';', ' ', '-', '>']).to_owned();
            }
            text += &line;
            text.push('\n');
        }
        text.pop();
        (entries, text)
    }

    /// A value as it is written, and its entry where it has a unit; `line` stands before it.
    fn value(
        &self,
        name: &str,
        argument: &'static str,
        line: &str,
    ) -> (String, Option<ExportEntry>) {
        let words: Vec<&'static str> = argument.split(' ').collect();
        let after = |word: &str| words.iter().position(|w| *w == word).map(|i| words[i + 1]);
        let unit = words.first().copied().filter(|w| !["", "else"].contains(w));
        let asked = in_unit(self.quantity(name), unit.unwrap_or_default());
        let value = after("in")
            .and_then(|range| range.split_once(".."))
            .and_then(|(low, high)| Some((low.parse().ok()?, high.parse().ok()?)))
            .map_or(asked, |(low, high)| asked.clamp(low, high));
        let infinite = after("else").unwrap_or("Inf");
        let is_number = value.is_finite();
        let value = if is_number {
            value
        } else {
            infinite.parse().unwrap_or(value)
        };
        let key = line
            .split(|c: char| !(c.is_alphanumeric() || "._".contains(c)))
            .find(|w| !w.is_empty());
        let entry = unit.map(|unit| ExportEntry {
            key: after("as").or(key).unwrap_or_default().to_owned(),
            value,
            unit,
            meaning: String::new(),
            wanted: (value != asked && is_number).then_some(asked),
        });
        (
            if is_number {
                number(value)
            } else {
                infinite.to_owned()
            },
            entry,
        )
    }

    /// A quantity by its name (SI): `accel.N`, `gyro.K*sqrt(f)`, `rate`, a number.
    fn quantity(&self, name: &str) -> f64 {
        let (base, operation) = name.split_at(name.find(['^', '*', '/']).unwrap_or(name.len()));
        let [accel, gyro] = &self.sensors;
        let x = match base.split_once('.') {
            Some(("accel", symbol)) => accel.quantity(symbol, self.rate_hz),
            Some((_, symbol)) => gyro.quantity(symbol, self.rate_hz),
            None if base == "rate" => self.rate_hz,
            None if base == "scale" => FilterStates::Reduced21.scale_sigma(),
            None if base == "T" => accel.markov().t_corr_s.min(gyro.markov().t_corr_s),
            None => base.parse().unwrap_or(f64::NAN),
        };
        match operation {
            "" => x,
            "^2" => x * x,
            "^2*f" => x * x * self.rate_hz,
            "*sqrt(f)" => x * self.rate_hz.sqrt(),
            "*sqrt(2f)" => x * (2.0 * self.rate_hz).sqrt(),
            step => {
                x / step
                    .strip_prefix("/sqrt(")
                    .and_then(|s| s.strip_suffix(')')?.parse::<f64>().ok())
                    .unwrap_or(f64::NAN)
                    .sqrt()
            }
        }
    }
}

/// Text before the next placeholder, the placeholder, and the text behind it.
fn next(text: &'static str) -> Option<(&'static str, &'static str, &'static str)> {
    let (before, rest) = text.split_once('{')?;
    let (placeholder, after) = rest.split_once('}')?;
    Some((before, placeholder, after))
}

impl SensorExport {
    /// The Gauss-Markov bias; of no size and endless memory where the pair has none: the correlation time that a search leaves to
    /// a bias of no size means nothing.
    fn markov(&self) -> Markov {
        self.exported
            .markov
            .filter(|m| m.sigma > 0.0)
            .unwrap_or(Markov {
                sigma: 0.0,
                t_corr_s: f64::INFINITY,
            })
    }

    fn quantity(&self, symbol: &str, rate_hz: f64) -> f64 {
        let markov = self.markov();
        let samples = markov.t_corr_s * rate_hz;
        match symbol {
            "N" => self.exported.density,
            // Programs that list K beside a Gauss-Markov bias do not use it; it is that of the other pair.
            "K" => self.largest.walk.walk,
            "sigma" => markov.sigma,
            "T" => markov.t_corr_s,
            "T_or_0" if markov.sigma == 0.0 => 0.0,
            "T_or_0" => markov.t_corr_s,
            "drive" => markov.drive(),
            "phi" => (-1.0 / samples).exp(),
            // σ√(1 − phi²) without cancellation
            "step" => markov.sigma * (-(-2.0 / samples).exp_m1()).sqrt(),
            "start" => self.bias_sd,
            "turn_on" => self.turn_on.unwrap_or(0.0),
            _ => f64::NAN,
        }
    }
}
