//! Random streams, drives, states and models that the tests of several modules share.

pub(crate) use crate::earth;
pub(crate) use crate::earth::{GravityModel, radii};
pub(crate) use crate::ekf::{FilterModel, FilterStates, InitialSettings};
pub(crate) use crate::frames::{NavState, RollPitchYaw};
pub(crate) use crate::lanes::Vec3;
pub(crate) use crate::noise::{Composite, Model, Process};
use crate::rng::StreamKey;
pub(crate) use crate::sensors::imu::Truth;
pub(crate) use crate::sensors::outage::Outage;
pub(crate) use crate::simulation::lincov::FilterPass;
pub(crate) use crate::strapdown::Strapdown;
pub(crate) use crate::trajectory::Trajectory;
use crate::trajectory::TrajectorySample;
use crate::trajectory::profile::{Bank, Profile, ProfileStart, Segment};
pub(crate) use crate::units::DEG;
pub(crate) use approx::{assert_abs_diff_eq, assert_relative_eq};
pub(crate) use glam::{DQuat, DVec3};
pub(crate) use nalgebra::DMatrix;
pub(crate) use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};

pub(crate) fn key(seed: u64) -> StreamKey<'static> {
    StreamKey {
        seed,
        scenario: "",
        run: 0,
        source: "",
        process: "",
    }
}

/// Draws of the standard normal distribution.
pub(crate) fn normals(seed: u64) -> impl FnMut() -> f64 {
    let mut source = key(seed).generator();
    move || StandardNormal.sample(&mut source)
}

/// A profile of segments as files have them, from 400 m over 46.5° N, 6.6° E.
pub(crate) fn profile(speed: f64, segments: &str) -> Profile {
    #[derive(serde::Deserialize)]
    struct File {
        segment: Vec<Segment>,
    }
    let file: File = toml::from_str(&format!("segment = [{segments}]")).unwrap();
    let start = ProfileStart {
        t_s: 0.0,
        lat: 46.5_f64.to_radians(),
        lon: 6.6_f64.to_radians(),
        h: 400.0,
        heading: 40.0_f64.to_radians(),
        speed,
    };
    Profile {
        start,
        bank: Bank::None,
        ramp_s: 2.0,
        segments: file.segment,
    }
}

pub(crate) fn drive(speed: f64, segments: &str) -> Trajectory {
    profile(speed, segments).build().unwrap()
}

/// Samples 0 to `n` at intervals of `dt_s`: latitude, longitude (rad), height and attitude at a time.
pub(crate) fn samples(
    n: u32,
    dt_s: f64,
    at: impl Fn(f64) -> (f64, f64, f64, DQuat),
) -> Vec<TrajectorySample> {
    let sample = |k| {
        let t_s = dt_s * f64::from(k);
        let (lat, lon, h, q_b_n) = at(t_s);
        TrajectorySample {
            t_s,
            lat,
            lon,
            h,
            q_b_n,
        }
    };
    (0..=n).map(sample).collect()
}

/// A vehicle that is neither level nor heads north.
pub(crate) fn state(v_n: [f64; 3]) -> NavState {
    NavState {
        lat: 0.8,
        lon: 0.1,
        h: 400.0,
        v_n: v_n.into(),
        q_b_n: DQuat::from_scaled_axis(DVec3::new(0.05, -0.1, 1.0)),
    }
}

/// White noise of a sample's variance and a Gauss-Markov bias an axis, of accelerometers and gyroscopes.
pub(crate) fn gauss_markov(
    rate_hz: f64,
    white: [f64; 2],
    bias_sigma: [f64; 2],
    t_corr_s: [f64; 2],
) -> Model {
    let [accel, gyro] = [0, 1].map(|s| {
        let bias =
            Process::gauss_markov(1.0 / t_corr_s[s], bias_sigma[s].powi(2), rate_hz).unwrap();
        Composite::new(vec![Process::white(white[s]).unwrap(), bias])
    });
    Model::pooled(rate_hz, &accel, &gyro)
}

/// Asserts that a sum of squares is one that chi-square exceeds, or falls below, with a probability above `alpha` in all.
#[track_caller]
pub(crate) fn assert_chi_square(sum: f64, dof: f64, alpha: f64) {
    let p = ChiSquared::new(dof).unwrap().cdf(sum);
    let sides = 0.5 * alpha..=1.0 - 0.5 * alpha;
    assert!(sides.contains(&p), "{sum} of {dof} degrees of freedom");
}
