//! Sources of the true errors: independent, alone or together.

use super::track::{
    CROSS_COUPLING, ErrorSourceState, ErrorSources, G_SENSITIVITY, MeasurementError,
    MeasurementKind, RECTIFICATION, SCALE_FACTOR, TEMPERATURE,
};
use crate::ekf::FilterModel;
use crate::imu::{Axis, Channel, Sensor};
use crate::linalg::by_value;
use crate::noise::{Model, ProcessKind};
use crate::sensors::aiding::{Aid, AidError, AidingSettings};
use crate::sensors::defects::ImuSettings;
use crate::sensors::gnss::GnssSettings;
use crate::simulation::plan::Experiment;
use std::ops::Range;

/// True errors along a track, independent of the filter.
#[derive(Debug, Clone, Default)]
pub struct TruthModel {
    pub(super) inertial: ErrorSources,
    /// True if the start is in error by the filter's initial covariance.
    pub(super) starts_off: bool,
    /// True for each white noise that is present: positions, velocities, heights and each aid.
    noise: [bool; MeasurementKind::KINDS],
    /// True if the strapdown has its integration error at the IMU's rate.
    pub(super) integrates: bool,
}

/// Candidate truth of an IMU and its receiver: a noise model at the IMU's rate, and the errors
/// beside it. Without a setting, errors are as the filter expects them.
#[derive(Debug, Clone)]
pub struct TrueErrors {
    /// Model of the inertial errors.
    pub model: Model,
    /// Errors of the true IMU beside its noise.
    pub imu: ImuSettings,
    /// The true receiver, whose positions may have correlated errors.
    pub gnss: GnssSettings,
    /// True errors of the aiding measurements.
    pub aiding: AidingSettings,
}

impl From<Model> for TrueErrors {
    /// Nothing beside the model but what the filter expects.
    fn from(model: Model) -> Self {
        let imu = ImuSettings {
            rate_hz: model.rate_hz,
            ..ImuSettings::default()
        };
        Self {
            model,
            imu,
            gnss: GnssSettings::default(),
            aiding: AidingSettings::default(),
        }
    }
}

/// One source of errors.
#[derive(Debug, Clone)]
pub struct NamedSource {
    /// `accel.AR1_1`, `gyro.turn_on_bias`, `gnss.position`, `initial` …
    pub name: String,
    /// The process of a sensor's noise model that it is; none of what no noise model has, and of drifts, which are one
    /// source for both sensors.
    pub process: Option<(Sensor, ProcessKind)>,
    /// Its effect.
    pub side: TruthModel,
}

impl NamedSource {
    fn new(name: impl Into<String>, side: TruthModel) -> Self {
        Self {
            name: name.into(),
            process: None,
            side,
        }
    }
}

/// The name of the source that all drifts are.
pub const DRIFT: &str = "drift";
/// The name of the source that the integration error of the strapdown is.
pub const STRAPDOWN: &str = "strapdown";

impl TruthModel {
    /// Several independent sources together.
    pub fn together(parts: &[NamedSource]) -> Self {
        let mut all = Self::default();
        for NamedSource { side: part, .. } in parts {
            all.inertial.extend(&part.inertial);
            all.starts_off |= part.starts_off;
            all.integrates |= part.integrates;
            all.noise
                .iter_mut()
                .zip(part.noise)
                .for_each(|(there, more)| *there |= more);
        }
        all
    }

    /// Every source of an experiment whose inertial noise is that of `model`, at the IMU's rate: its processes
    /// sensor by sensor, the defects of the true IMU, start, receiver, barometer and aiding. All drifts are one source:
    /// they are the same in every run, so that their errors add, not their variances.
    pub fn sources(experiment: &Experiment<'_>, model: &Model) -> Vec<NamedSource> {
        let mut parts = beside_the_imu(experiment);
        let mut drifts = Vec::new();
        for sensor in Sensor::ALL {
            parts.extend(processes(model, sensor, &mut drifts));
            parts.extend(defects(experiment.defects, sensor));
        }
        parts.extend(inertial(DRIFT.to_owned(), drifts));
        parts.extend(correlated(experiment.gnss, experiment.rate_hz));
        parts.extend(lasting(experiment.aiding, experiment.rate_hz));
        parts.push(NamedSource::new(STRAPDOWN, Self::of_strapdown()));
        parts
    }

    /// The integration error of the strapdown alone.
    pub(super) fn of_strapdown() -> Self {
        Self {
            integrates: true,
            ..Self::default()
        }
    }

    /// The errors of a model, turn-on biases and scale factors as a filter expects them, start and receiver as it
    /// believes.
    pub(super) fn as_expected(filter_model: &FilterModel, model: &Model, starts_off: bool) -> Self {
        let mut inertial = ErrorSources::of_model(model);
        inertial
            .states
            .extend(ErrorSources::beside_model(filter_model));
        Self {
            inertial,
            starts_off,
            noise: [true; MeasurementKind::KINDS],
            integrates: false,
        }
    }

    /// The truth with what the settings of the true IMU and of the receiver state in the place of what the filter
    /// expects: turn-on biases (a 0 too), scale factors and other errors of the IMU, correlated errors of positions. The strapdown errs.
    pub(super) fn as_stated(
        filter_model: &FilterModel,
        errors: &TrueErrors,
        starts_off: bool,
    ) -> Self {
        let TrueErrors {
            model,
            imu,
            gnss,
            aiding,
        } = errors;
        let mut all = Self {
            integrates: true,
            ..Self::as_expected(filter_model, model, starts_off)
        };
        let mut stated: Vec<NamedSource> = correlated(gnss, imu.rate_hz).into_iter().collect();
        // the processes of the model come first and stay; an expectation has its place in the list after them
        let own = ErrorSources::of_model(model).states.len();
        let mut expected = all.inertial.states.split_off(own);
        let parts: Vec<MeasurementError> = aiding
            .errors()
            .into_iter()
            .map(|error| MeasurementError::Vehicle(error.part))
            .collect();
        expected.retain(|source| source.outer.is_none_or(|outer| !parts.contains(&outer)));
        stated.extend(lasting(aiding, imu.rate_hz));
        for sensor in Sensor::ALL {
            let first = 3 * sensor as usize;
            let (bias, (_, ppm)) = (imu.turn_on_bias(sensor), imu.deviations(sensor));
            expected.retain(|source| {
                let is_of = |signal: usize| {
                    source.outer.is_none() && (signal..signal + 3).contains(&source.signal)
                };
                !(bias.is_some() && is_of(first) || ppm > 0.0 && is_of(SCALE_FACTOR + first))
            });
            stated.extend(defects(imu, sensor));
        }
        all.inertial.states.append(&mut expected);
        all.inertial.extend(&Self::together(&stated).inertial);
        all
    }

    /// Returns true if a measurement has its white noise.
    pub(super) const fn has_noise(&self, measured: MeasurementKind) -> bool {
        self.noise[measured.kind()]
    }
}

/// Start, receiver, barometer and what the vehicle measures of itself.
fn beside_the_imu(experiment: &Experiment<'_>) -> Vec<NamedSource> {
    // One kind of white noise at a time: a budget asks for the share of each.
    let noise = |at: usize| TruthModel {
        noise: std::array::from_fn(|i| i == at),
        ..TruthModel::default()
    };
    let start = TruthModel {
        starts_off: true,
        ..TruthModel::default()
    };
    let has_velocity = experiment.gnss.vel_sigma_m_s.is_some();
    let all = [
        (!experiment.initial.perfect).then(|| NamedSource::new("initial", start)),
        Some(NamedSource::new("gnss.position", noise(0))),
        has_velocity.then(|| NamedSource::new("gnss.velocity", noise(1))),
        experiment.baro.map(|_| NamedSource::new("baro", noise(2))),
    ];
    let of_aid = |aid: Aid| format!("aiding.{}", aid.name());
    let aids = experiment.aiding.rates();
    let aids = aids.map(|(aid, _)| NamedSource::new(of_aid(aid), noise(3 + aid as usize)));
    all.into_iter().flatten().chain(aids).collect()
}

/// A source of states alone; none where there are none.
fn inertial(name: String, states: Vec<ErrorSourceState>) -> Option<NamedSource> {
    let inertial = ErrorSources {
        states,
        ..ErrorSources::default()
    };
    let side = TruthModel {
        inertial,
        ..TruthModel::default()
    };
    (!side.inertial.states.is_empty()).then(|| NamedSource::new(name, side))
}

/// The processes of a sensor: those of the same label are one source on all axes. Drifts are set apart.
fn processes(
    model: &Model,
    sensor: Sensor,
    drifts: &mut Vec<ErrorSourceState>,
) -> Vec<NamedSource> {
    let mut found: Vec<NamedSource> = Vec::new();
    for channel in Axis::ALL.map(|axis| Channel { sensor, axis }) {
        let noise = model.axis(channel);
        for (process, label) in noise.processes.iter().zip(noise.labels()) {
            if process.kind() == ProcessKind::Drift {
                drifts.push(ErrorSourceState::drift(
                    channel.index(),
                    process.amplitude(),
                ));
                continue;
            }
            let source = named(&mut found, &format!("{}.{label}", sensor.name()));
            source.process = Some((sensor, process.kind()));
            // The axes are independent: one source with three states has the sum of their covariances.
            source.side.inertial.add(channel.index(), process);
        }
    }
    found
}

/// Errors of a sensor of the true IMU beside its noise.
pub(super) fn defects(imu: &ImuSettings, sensor: Sensor) -> Vec<NamedSource> {
    let (bias, ppm) = imu.deviations(sensor);
    let first = 3 * sensor as usize;
    let crossed = CROSS_COUPLING + 2 * first;
    let of_force = match sensor {
        Sensor::Accel => (
            "rectification",
            imu.rectification_s2_m(),
            RECTIFICATION..TEMPERATURE,
        ),
        Sensor::Gyro => (
            "g_sensitivity",
            imu.g_sensitivity_rad_s_per_m_s2,
            G_SENSITIVITY..RECTIFICATION,
        ),
    };
    let all = [
        ("turn_on_bias", bias, first..first + 3),
        (
            "scale",
            ppm * 1e-6,
            SCALE_FACTOR + first..SCALE_FACTOR + first + 3,
        ),
        ("misalignment", imu.misalignment_rad, crossed..crossed + 6),
        of_force,
        (
            "temperature",
            imu.per_kelvin(sensor),
            TEMPERATURE + first..TEMPERATURE + first + 3,
        ),
    ];
    let source = |(name, sigma, signals): (&str, f64, Range<usize>)| {
        let states = signals.map(|signal| ErrorSourceState::constant(signal, sigma));
        inertial(
            format!("{}.{name}", sensor.name()),
            states.filter(|s| s.initial > 0.0).collect(),
        )
    };
    all.into_iter().filter_map(source).collect()
}

/// The correlated part of the receiver's error. It has a value at every epoch of the receiver; between two of them
/// it goes on from sample to sample, which is the same at the epochs.
fn correlated(gnss: &GnssSettings, imu_hz: f64) -> Option<NamedSource> {
    let phi = (-1.0 / (imu_hz * gnss.correlation_time_s)).exp();
    let state =
        |(component, sigma): (usize, f64)| ErrorSourceState::of_position(component, phi, sigma);
    let sigmas = gnss
        .correlated_pos_sigma_m
        .into_iter()
        .enumerate()
        .filter(|(_, sigma)| *sigma > 0.0);
    inertial("gnss.correlated".to_owned(), sigmas.map(state).collect())
}

/// Errors of the aiding measurements beside white noise: parts of one name are one source.
fn lasting(aiding: &AidingSettings, imu_hz: f64) -> Vec<NamedSource> {
    let mut found = Vec::new();
    for AidError { part, law, .. } in aiding.errors() {
        let source = named(&mut found, part.names().0);
        let states = &mut source.side.inertial.states;
        states.push(ErrorSourceState::of_vehicle(part, law, imu_hz));
    }
    found
}

/// The source of a name, which is added where there is none.
fn named<'a>(all: &'a mut Vec<NamedSource>, name: &str) -> &'a mut NamedSource {
    let known = all.iter().position(|source| source.name == name);
    let at = known.unwrap_or_else(|| {
        all.push(NamedSource::new(name, TruthModel::default()));
        all.len() - 1
    });
    &mut all[at]
}

// Whether the motion shows the heading.

/// Standard deviation of the heading from which an error-state filter is not to be believed (degrees): the sine
/// of the error is no longer the error, and noise is taken for information about the heading.
const LARGE_DEG: f64 = 5.0;
/// Time that an alignment may take (s).
const SETTLED_S: f64 = 120.0;

/// Warns where the heading is hardly observable: `while_fixed` are the times from the start (s) at
/// which fixes are used, and the standard deviations of yaw there (degrees). The first two minutes
/// belong to the alignment.
pub fn weak_heading(while_fixed: impl Iterator<Item = (f64, f64)>) -> Option<String> {
    let settled = while_fixed.filter(|(after_s, _)| *after_s >= SETTLED_S);
    let worst = settled.max_by(by_value);
    let (after_s, sigma_deg) = worst.filter(|(_, sigma_deg)| *sigma_deg > LARGE_DEG)?;
    // beyond half a turn a linear deviation is only a large number
    let sigma = if sigma_deg < 180.0 {
        format!("{sigma_deg:.0}°")
    } else {
        "over 180°".to_owned()
    };
    Some(format!(
        "the heading is hardly observable: sigma of yaw is {sigma} after {after_s:.0} s of fixes (horizontal accelerations are too small); it may be several times too small, with any number of states"
    ))
}

#[cfg(test)]
mod heading_tests {
    use super::*;

    #[test]
    fn the_largest_deviation_after_the_alignment_decides() {
        assert_eq!(weak_heading([(10.0, 20.0), (200.0, 4.0)].into_iter()), None);
        let doubt = weak_heading([(10.0, 20.0), (200.0, 7.0), (300.0, 6.0)].into_iter());
        assert!(doubt.is_some_and(|doubt| doubt.contains("is 7° after 200 s")));
    }
}
