//! The filter of a fusion: made for a recording whose trajectory is not known.

use super::FuseError;
use crate::app::Context;
use crate::commands::run::Reduced;
use nav_sim_navigation::ekf::{Belief, FilterStates, InitialSettings};
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_navigation::metrics::ReductionSummary;
use nav_sim_navigation::sensors::defects::ImuSettings;
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::lincov;
use nav_sim_signal::noise::{Composite, Model, Process, continuous, reduction};

/// The filter for an IMU of that rate, these fixes and outages. A reduced filter is made for a built-in drive with
/// the receiver of the fixes; also what the reduction loses.
///
/// # Errors
/// When the model cannot be converted to the rate, or has no such filter.
pub(super) fn belief(
    (model, states, initial): (&Model, FilterStates, &InitialSettings),
    rate_hz: f64,
    gnss: &[GnssFix],
    outages: &[Outage],
) -> Result<(Belief, Option<ReductionSummary>), FuseError> {
    let model = at_rate(model, rate_hz)?;
    let lengths: Vec<f64> = outages.iter().map(|o| o.end_s - o.start_s).collect();
    let steps = gnss.windows(2).map(|w| w[1].t_s - w[0].t_s);
    let interval_s = middle(steps.collect()).unwrap_or(1.0);
    let window_s = reduction::window_s(lengths.iter().copied().fold(0.0, f64::max));
    let belief = Belief::new(&model, states, interval_s, window_s)?;
    let drive = || {
        lincov::drive(
            &model,
            &ImuSettings::default(),
            &receiver(gnss, interval_s),
            &lengths,
        )
    };
    let Some(track) = states.is_reduced().then(drive).flatten() else {
        return Ok((belief.with_initial(initial), None));
    };
    let belief =
        lincov::reduced_belief(&model, belief, &track, lincov::Alike::All).with_initial(initial);
    let full = Belief::new(&model, FilterStates::Full, interval_s, window_s);
    let full = full
        .ok()
        .map(|full| full.with_initial(&beside(states, initial)));
    let reduced = Reduced {
        model: &model,
        belief: &belief,
        full,
        track: &track,
        interval_s,
        window_s,
    };
    let summary = reduced.summary(&Context::default())?;
    Ok((belief, Some(summary)))
}

/// The value in the middle, in order.
fn middle(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// What a filter expects beside the model, with what its states say of scale factors.
fn beside(states: FilterStates, initial: &InitialSettings) -> InitialSettings {
    let mut all = initial.clone();
    let ppm = states.scale_sigma() * 1e6;
    if ppm > 0.0 {
        all.accel_scale_sigma_ppm.get_or_insert(ppm);
        all.gyro_scale_sigma_ppm.get_or_insert(ppm);
    }
    all
}

/// The receiver of the fixes: medians.
fn receiver(gnss: &[GnssFix], interval_s: f64) -> GnssSettings {
    let defaults = GnssSettings::default();
    let position = |i: usize| middle(gnss.iter().map(|fix| fix.pos_sigma_n[i]).collect());
    let velocity = |i: usize| {
        middle(
            gnss.iter()
                .filter_map(|fix| Some(fix.velocity?.sigma_n()[i]))
                .collect(),
        )
    };
    let velocities = [0, 1, 2].map(velocity);
    let has_velocity = velocities.iter().all(Option::is_some);
    GnssSettings {
        rate_hz: 1.0 / interval_s,
        pos_sigma_m: [0, 1, 2].map(|i| position(i).unwrap_or(defaults.pos_sigma_m[i])),
        vel_sigma_m_s: has_velocity.then(|| velocities.map(Option::unwrap_or_default)),
        ..defaults
    }
}

/// At the rate of the recording, without quantization noise: the filter leaves it out, and it belongs to
/// its own rate.
fn at_rate(model: &Model, rate_hz: f64) -> Result<Model, continuous::RateError> {
    let kept = |axis: &Composite| {
        let processes = axis
            .processes
            .iter()
            .filter(|p| !matches!(p, Process::Quantization(_)));
        Composite::new(processes.copied().collect())
    };
    let axes = std::array::from_fn(|i| kept(&model.axes[i]));
    continuous::at_rate(
        &Model {
            rate_hz: model.rate_hz,
            axes,
        },
        rate_hz,
    )
}
