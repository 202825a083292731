//! Words on what a filter does not expect, and on what a reduction costs it.

use nav_sim_document::{percent, readable};
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::metrics::ReductionQuality;
use nav_sim_navigation::scenario::Unexpected;
use nav_sim_navigation::sensors::defects::Defect;
use nav_sim_navigation::simulation::REPORTED_NAMES;

/// An error that the filter does not expect: what it is, and what helps.
pub(crate) fn unexpected_in_words(unexpected: &Unexpected) -> (String, String) {
    match unexpected {
        Unexpected::TurnOnBias {
            sensor,
            sigma,
            expected,
        } => (
            format!(
                "the true {sensor} has a turn-on bias of {sigma} {}, the filter expects {expected}",
                sensor.unit()
            ),
            format!(
                "initial.{} gives it states",
                InitialSettings::bias_key(*sensor)
            ),
        ),
        Unexpected::Scale {
            sensor,
            ppm,
            expected_ppm,
        } => (
            format!(
                "the true {sensor} has a scale-factor error of {ppm} ppm, the filter expects {expected_ppm}"
            ),
            format!(
                "--scale-ppm (initial.{}) gives it states",
                InitialSettings::scale_key(*sensor)
            ),
        ),
        Unexpected::Defect(Defect {
            key,
            sigma,
            unit,
            sensors,
            ..
        }) => (
            format!("{key} = {sigma} {unit} is in no filter"),
            match sensors {
                // By gravity, by steady vibration, by what a warming ends with: most of it is a bias.
                [sensor] => format!(
                    "initial.{} gives what is constant of it states",
                    InitialSettings::bias_key(*sensor)
                ),
                _ => "calibrate the IMU for it".to_owned(),
            },
        ),
        Unexpected::CorrelatedPositions {
            sigma_m: [n, e, d],
            correlation_time_s,
        } => (
            format!(
                "the true receiver errs by {n}, {e}, {d} m over {correlation_time_s} s, the filter expects white errors"
            ),
            "a larger gnss.pos_sigma_m".to_owned(),
        ),
        Unexpected::Aiding { source, key } => (
            format!("the truth has {source}, of which the filter expects less"),
            match key.ends_with("sigma_m_s") || *key == "aiding.heading.sigma_deg" {
                true => format!("a larger {key} (nav-sim tune --scenario FILE finds how much)"),
                false => format!("{key} gives it states"),
            },
        ),
        Unexpected::Integration {
            rate_hz,
            over_sigma,
        } => (
            format!(
                "at {rate_hz} Hz the strapdown alone errs by {} sigma on this motion",
                readable(*over_sigma)
            ),
            "a larger imu.rate_hz".to_owned(),
        ),
    }
}

/// The same in one line.
pub(crate) fn unexpected_line(unexpected: &Unexpected) -> String {
    let (what, remedy) = unexpected_in_words(unexpected);
    format!("{what}: {remedy}")
}

/// What a filter reduced to 15 states is like, in one line: its NEES, its errors above those of the full filter.
pub(crate) fn reduction_line(quality: &ReductionQuality) -> String {
    let more = |ratio: f64| format!("{:+.1} %", 100.0 * (ratio - 1.0));
    let cost = quality
        .cost()
        .map_or(String::new(), |(horizontal, (state, most))| {
            let largest = match most > horizontal {
                true => format!(", {} {}", REPORTED_NAMES[state], more(most)),
                false => String::new(),
            };
            format!(
                "; RMSE over --filter full at outages: horizontal {}{largest}",
                more(horizontal)
            )
        });
    format!(
        "reduced filter: NEES {} (9 if right){cost}",
        readable(quality.nees)
    )
}

/// A standard deviation of the reduced filter that is too small or too large at an outage's end.
pub(crate) fn reduction_doubt(quality: &ReductionQuality) -> Option<String> {
    let (state, outage, ratio) = quality.worst()?;
    let size = if ratio > 1.0 { "small" } else { "large" };
    let full = if quality.rmse_over_full.is_some() {
        "; --filter full reduces nothing"
    } else {
        ""
    };
    Some(format!(
        "reduced filter: sigma of {} at the end of outage {} is {} too {size}{full}",
        REPORTED_NAMES[state],
        outage + 1,
        percent((1.0 / ratio - 1.0).abs())
    ))
}
