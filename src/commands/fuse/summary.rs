//! Verdict and figures of a fusion: `summary.json`.

use super::Fuse;
use nav_sim_document::seconds;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::fusion::mounting::Mounting;
use nav_sim_navigation::fusion::{
    ClocksApart, Displaced, Finding, Found, Levelling, Outcome, Solution, Start, Weighed,
    aid_innovations, outcome,
};
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::sensors::aiding::{
    AidingSettings, NhcSettings, OdometerSettings, ZuptSettings,
};
use nav_sim_signal::units::DEG;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

pub(super) const STATE: [&str; 9] = [
    "lat_deg",
    "lon_deg",
    "h_m",
    "v_n_m_s",
    "v_e_m_s",
    "v_d_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];

/// `summary.json` of a fusion.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FuseSummary {
    pub(super) schema_version: u32,
    pub(super) method: &'static str,
    /// VerdictKind, evidence and cause.
    pub verdict: FuseVerdict,
    /// IMU samples used.
    pub imu_samples: usize,
    /// Their rate (Hz).
    pub imu_rate_hz: f64,
    /// First time of the solution (s).
    pub start_s: f64,
    /// Last time of the solution (s).
    pub end_s: f64,
    /// States of the filter, those of a turn-on bias included.
    pub filter_states: usize,
    /// States of a turn-on bias.
    pub turn_on_states: usize,
    pub(super) initial: Initial,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mounting: Option<MountingRow>,
    /// Root mean square of the horizontal standard deviation of the filter (m).
    pub horizontal_sigma_rms_m: f64,
    /// Correlation of the innovations, and what the filter makes of it; none where fixes are few.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gnss_correlation: Option<Value>,
    /// What the vehicle knows, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<Value>,
    /// Fixes, NIS, errors at the ends of outages and against the reference.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Verdict on a solution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FuseVerdict {
    /// In one word.
    pub kind: VerdictKind,
    /// Evidence against the solution, the gravest first.
    pub evidence: Vec<Finding>,
    /// Cause of large innovations, where one was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
}

/// Cause of large innovations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The clocks of IMU and GNSS differ.
    Clocks(ClocksApart),
    /// The antenna is elsewhere, or the fixes are a little late.
    Displaced(Displaced),
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Initial {
    t_s: f64,
    state: BTreeMap<&'static str, f64>,
    sigma: InitialSettings,
    pub how: Vec<String>,
}

/// A mounting that was found: angles as `--mounting` takes them, standard deviations about front, right, down.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct MountingRow {
    pub roll_deg: f64,
    pub pitch_deg: f64,
    pub yaw_deg: f64,
    pub sigma_deg: [f64; 3],
    how: String,
}

impl Initial {
    /// The start, from the data or from a file.
    pub(super) fn new(start: &Start, file: Option<&Path>) -> Self {
        let how = match (&start.found, file) {
            (Some(found), _) => how(start, found),
            (None, file) => file
                .iter()
                .map(|file| format!("as {} says", file.display()))
                .collect(),
        };
        let state = STATE.into_iter().zip(values(&start.state)).collect();
        Self {
            t_s: start.t_s,
            state,
            sigma: start.sigma.clone(),
            how,
        }
    }
}

/// Sources of a start that was found.
fn how(start: &Start, found: &Found) -> Vec<String> {
    let [.., roll, pitch, yaw] = values(&start.state);
    let [tilt_sigma, _, yaw_sigma] = start.sigma.att_sigma_deg;
    let level = match found.level {
        Levelling::AtRest(until_s) => {
            format!("from levelling at rest until {until_s:.2} s, carried on by the gyroscopes")
        }
        Levelling::InMotion(seconds) => {
            format!(
                "from accelerations over the {seconds:.1} s after it (no better static window before)"
            )
        }
    };
    let (speed, sigma) = (start.state.v_n.truncate().length(), found.course_sigma_deg);
    let reversing = if found.is_reversing {
        ", reversing"
    } else {
        ""
    };
    let t_s = start.t_s;
    let source = if found.is_given {
        "as given".to_owned()
    } else {
        format!(
            "from the course of the fix at {} s ({speed:.1} m/s{reversing})",
            seconds(t_s)
        )
    };
    let mut how = vec![
        format!("roll {roll:.2}°, pitch {pitch:.2}° ± {tilt_sigma:.2}° {level}"),
        format!("heading {yaw:.1}° ± {sigma:.1}° {source}"),
        "biases start at zero".to_owned(),
    ];
    how.extend(found.moved_deg.map(|moved| {
        format!(
            "heading ± {yaw_sigma:.1}°: the fixes of the next minute move it by {moved:+.0}° (wind, slip)"
        )
    }));
    how
}

impl From<&Mounting> for MountingRow {
    fn from(found: &Mounting) -> Self {
        // hundredths are what is printed; + 0 takes the sign from -0
        let [roll_deg, pitch_deg, yaw_deg] = found
            .angles_deg()
            .map(|a| (a * 100.0).round() / 100.0 + 0.0);
        let km = found.way_m / 1000.0;
        let widened = match found.sigma_factor {
            1.0 => String::new(),
            factor => format!("; the fixes taken as {factor:.1} times as uncertain as they state"),
        };
        let how = format!(
            "from gravity, accelerations and turns, and the attitude of the IMU beside the track over {km:.1} km; the roads taken as level across on average, the vehicle as going where it looks{widened}"
        );
        Self {
            roll_deg,
            pitch_deg,
            yaw_deg,
            sigma_deg: found.sigma_deg(),
            how,
        }
    }
}

/// Position (degrees, m), velocity, roll, pitch, yaw (degrees).
pub(super) fn values(s: &NavState) -> [f64; 9] {
    let rpy = RollPitchYaw::from_quat(s.q_b_n);
    let [roll, pitch, yaw] = [rpy.roll, rpy.pitch, rpy.yaw].map(|a| a / DEG);
    [
        s.lat / DEG,
        wrap_angle(s.lon) / DEG,
        s.h,
        s.v_n.x,
        s.v_n.y,
        s.v_n.z,
        roll,
        pitch,
        yaw,
    ]
}

// What the vehicle knows of its own motion: settings, figures, table.

/// A road car's axes are known in the IMU's to a degree, its wheel's size to the wear and pressure of a tyre (1 σ).
const MOUNTING_SIGMA_DEG: f64 = 1.0;
const SCALE_SIGMA: f64 = 0.03;

impl Fuse {
    /// What is believed of the vehicle: nothing that was not asked for.
    pub(super) fn aiding(&self) -> AidingSettings {
        let lever_arm_m = self.rear_axle_m;
        AidingSettings {
            nhc: self.nhc.then(|| NhcSettings {
                mounting_sigma_deg: MOUNTING_SIGMA_DEG,
                lever_arm_m,
                ..NhcSettings::default()
            }),
            odometer: self.odometer.as_ref().map(|_| OdometerSettings {
                scale_sigma: SCALE_SIGMA,
                lever_arm_m,
                ..OdometerSettings::default()
            }),
            zupt: self.zupt.then(ZuptSettings::default),
            heading: None,
        }
    }
}

/// Estimates at the end, and how the aids agree with the solution; none where nothing was asked for.
pub(super) fn vehicle(solution: &Solution, settings: &AidingSettings) -> Option<Value> {
    if settings.is_none() {
        return None;
    }
    let mut found = json!({ "aids": aid_innovations(&solution.aids) });
    let keys = [
        ("wheel_scale", 1.0),
        ("mounting_pitch_deg", DEG),
        ("mounting_yaw_deg", DEG),
    ];
    for (i, (key, unit)) in keys.into_iter().enumerate() {
        let known = solution
            .vehicle
            .filter(|_| settings.state_sigmas()[i] > 0.0);
        if let Some([value, sigma]) = known.map(|v| v.map(|estimates| estimates[i] / unit)) {
            found[key] = json!({ "value": value, "sigma": sigma });
        }
    }
    Some(found)
}

/// Errors of fixes that last: the correlation of their innovations, standard deviations as stated, and the filter's answer.
pub(super) fn correlation(weighed: &Weighed) -> Option<Value> {
    let white = weighed.whiteness?;
    Some(json!({
        "lag_1": white.lag_1,
        "limit": white.limit,
        "is_correlated": white.is_correlated(),
        "pos_sigma_factor": weighed.pos_sigma_factor,
        "nis_as_stated": outcome(weighed.judged(), &[]).nis_per_component,
    }))
}
