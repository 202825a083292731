//! What the results of a run rest on: models, true IMU, receiver, start.

use super::RunAnswer;
use nav_sim_document::readable;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::metrics::Summary;
use nav_sim_navigation::sensors::aiding::{Aid, AidingSettings};
use nav_sim_navigation::sensors::defects::{Defect, ImuSettings};
use nav_sim_navigation::sensors::gnss::GnssSettings;
use nav_sim_signal::imu::Sensor;
use nav_sim_signal::units::DEG;

/// What the results rest on.
pub(super) fn assumptions(summary: &Summary, answer: &RunAnswer) -> Vec<(&'static str, String)> {
    let input = |role: &str| {
        answer
            .inputs
            .iter()
            .find(|i| i.role == role)
            .map_or("", |i| i.path.as_str())
    };
    let truth = match (input("static"), input("truth")) {
        ("", "") => format!("{} (the model of the filter)", input("model")),
        ("", model) => model.to_owned(),
        (recording, _) => format!("windows of {recording}"),
    };
    let scenario = &answer.origin.configuration;
    let mut facts = vec![
        ("trajectory", input("trajectory").to_owned()),
        (
            "model of the filter",
            format!("{}, {} states", input("model"), summary.filter_states),
        ),
        ("what makes the errors", truth),
        ("IMU", defects(&scenario.imu)),
        ("GNSS", receiver(&scenario.gnss)),
        ("start (1 σ)", start(&scenario.initial)),
    ];
    if let Some(baro) = &scenario.baro {
        facts.push((
            "barometer",
            format!("{} Hz; 1 σ {} m", baro.rate_hz, readable(baro.sigma_m)),
        ));
    }
    let aids: Vec<String> = scenario
        .aiding
        .rates()
        .map(|aid| aided(&scenario.aiding, aid))
        .collect();
    if !aids.is_empty() {
        facts.push(("aiding (1 σ)", aids.join("; ")));
    }
    if summary.runs > 0 {
        let worth = readable(summary.independent_runs);
        facts.push((
            "runs",
            format!(
                "{} ({} diverged), worth {worth} independent ones",
                summary.runs, summary.diverged
            ),
        ));
    }
    facts.extend(summary.seed.map(|seed| ("seed", seed.to_string())));
    facts
}

fn three(sigma: &[f64; 3]) -> String {
    sigma.map(readable).join(", ")
}

/// What the true IMU has beside its noise.
fn defects(imu: &ImuSettings) -> String {
    let [bias_a, bias_g] = Sensor::ALL.map(|sensor| readable(imu.deviations(sensor).0));
    let [ppm_a, ppm_g] = Sensor::ALL.map(|sensor| readable(imu.deviations(sensor).1));
    let mut facts = vec![
        format!("{} Hz", imu.rate_hz),
        format!("1 σ: turn-on bias {bias_a} m/s², {bias_g} rad/s"),
        format!("scale factors {ppm_a}, {ppm_g} ppm"),
    ];
    let of = |defect: Defect| format!("{} {} {}", defect.key, readable(defect.sigma), defect.unit);
    facts.extend(imu.without_states().map(of));
    facts.extend(
        imu.output
            .as_ref()
            .map(|_| "samples of a range and a resolution".to_owned()),
    );
    facts.join("; ")
}

/// `nhc 0.2 m/s at 1 Hz`
fn aided(aiding: &AidingSettings, (aid, rate_hz): (Aid, f64)) -> String {
    let [sigma, _] = aiding.sigmas(aid);
    let (sigma, unit) = if aid == Aid::Heading {
        (sigma / DEG, "°")
    } else {
        (sigma, "m/s")
    };
    format!("{} {} {unit} at {rate_hz} Hz", aid.name(), readable(sigma))
}

fn receiver(gnss: &GnssSettings) -> String {
    let velocity = gnss.vel_sigma_m_s.map_or("no velocity".to_owned(), |v| {
        format!("velocity {} m/s", three(&v))
    });
    let position = three(&gnss.pos_sigma_m);
    let mut words = format!(
        "{} Hz; 1 σ north, east, down: position {position} m, {velocity}",
        gnss.rate_hz
    );
    if gnss.correlated_pos_sigma_m.iter().any(|sigma| *sigma > 0.0) {
        let (sigma, time) = (
            three(&gnss.correlated_pos_sigma_m),
            readable(gnss.correlation_time_s),
        );
        words +=
            &format!("; in truth a correlated position error of {sigma} m over {time} s beside it");
    }
    if gnss.lever_arm_m.iter().any(|x| *x != 0.0) {
        words += &format!(
            "; antenna {} m front, right, down of the IMU",
            three(&gnss.lever_arm_m)
        );
    }
    words
}

/// What the filter knows at the start.
fn start(initial: &InitialSettings) -> String {
    if initial.perfect {
        return "the true state".to_owned();
    }
    format!(
        "position {} m, velocity {} m/s, attitude {} °",
        three(&initial.pos_sigma_m),
        three(&initial.vel_sigma_m_s),
        three(&initial.att_sigma_deg)
    )
}
