//! An initial state (TOML).

use crate::formats::FileError;
use crate::formats::toml_described::Document;
use crate::formats::toml_file::Source;
use glam::DVec3;
use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw};
use nav_sim_navigation::fusion::Start;
use nav_sim_signal::units::DEG;
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::Path;

/// Largest angles.
const LON_DEG: f64 = 360.0;
const ROLL_DEG: f64 = 180.0;
const PITCH_DEG: f64 = 90.0;
const YAW_DEG: f64 = 360.0;

/// Where and how a drive begins: nav-sim fuse --initial
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Initial state")]
struct Description {
    /// Time (s)
    t_s: f64,
    /// Latitude of the IMU (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    lat_deg: f64,
    /// Longitude of the IMU (degrees)
    #[schemars(range(min = -LON_DEG, max = LON_DEG))]
    lon_deg: f64,
    /// Height of the IMU above the ellipsoid (m)
    h_m: f64,
    /// Velocity north (m/s; default: 0)
    #[serde(default)]
    v_n_m_s: f64,
    /// Velocity east (m/s; default: 0)
    #[serde(default)]
    v_e_m_s: f64,
    /// Velocity down (m/s; default: 0)
    #[serde(default)]
    v_d_m_s: f64,
    /// Roll of the vehicle (degrees)
    #[schemars(range(min = -ROLL_DEG, max = ROLL_DEG))]
    roll_deg: f64,
    /// Pitch (degrees)
    #[schemars(range(min = -PITCH_DEG, max = PITCH_DEG))]
    pitch_deg: f64,
    /// Yaw (degrees)
    #[schemars(range(min = -YAW_DEG, max = YAW_DEG))]
    yaw_deg: f64,
    /// Standard deviations of the position north, east, down (m; default: as in scenarios)
    pos_sigma_m: Option<[f64; 3]>,
    /// Of the velocity (m/s)
    vel_sigma_m_s: Option<[f64; 3]>,
    /// Of roll, pitch, yaw (degrees)
    att_sigma_deg: Option<[f64; 3]>,
    /// Of a turn-on bias of the accelerometers that the filter expects (m/s²)
    accel_bias_sigma_m_s2: Option<f64>,
    /// Of a turn-on bias of the gyroscopes (rad/s)
    gyro_bias_sigma_rad_s: Option<f64>,
    /// Of a scale-factor error of the accelerometers (parts per million)
    accel_scale_sigma_ppm: Option<f64>,
    /// Of a scale-factor error of the gyroscopes (parts per million)
    gyro_scale_sigma_ppm: Option<f64>,
}

/// The JSON schema of such a file; the ranges of standard deviations are those of scenarios.
#[must_use]
pub(crate) fn initial_schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Description).to_value();
    let of_scenarios = schemars::schema_for!(InitialSettings).to_value();
    for (key, own) in schema["properties"].as_object_mut().into_iter().flatten() {
        if let Some(said) = of_scenarios["properties"].get(key) {
            let description = own["description"].take();
            *own = said.clone();
            own["description"] = description;
        }
    }
    schema
}

/// Reads an initial state: time, position of the IMU, velocity (0 where it is not said), attitude of the
/// vehicle, and standard deviations as in the `[initial]` section of a scenario.
///
/// # Errors
/// File, line, key and value of what is refused.
pub(crate) fn read_initial(path: &Path) -> Result<Start, FileError> {
    parse(&Source::read(path)?)
}

fn parse(source: &Source) -> Result<Start, FileError> {
    let document = Document::parse(source)?;
    let d: Description = document.read()?;
    check(&d).map_err(|(key, reason)| document.root().refuse(key, reason, None))?;
    let [roll, pitch, yaw] = [d.roll_deg, d.pitch_deg, d.yaw_deg].map(|degrees| degrees * DEG);
    let state = NavState {
        lat: d.lat_deg * DEG,
        lon: d.lon_deg * DEG,
        h: d.h_m,
        v_n: DVec3::new(d.v_n_m_s, d.v_e_m_s, d.v_d_m_s),
        q_b_n: RollPitchYaw { roll, pitch, yaw }.to_quat(),
    };
    let default = InitialSettings::default();
    let sigma = InitialSettings {
        pos_sigma_m: d.pos_sigma_m.unwrap_or(default.pos_sigma_m),
        vel_sigma_m_s: d.vel_sigma_m_s.unwrap_or(default.vel_sigma_m_s),
        att_sigma_deg: d.att_sigma_deg.unwrap_or(default.att_sigma_deg),
        accel_bias_sigma_m_s2: d.accel_bias_sigma_m_s2,
        gyro_bias_sigma_rad_s: d.gyro_bias_sigma_rad_s,
        accel_scale_sigma_ppm: d.accel_scale_sigma_ppm,
        gyro_scale_sigma_ppm: d.gyro_scale_sigma_ppm,
        perfect: false,
    };
    sigma.validate().map_err(|e| document.refused(&e))?;
    Ok(Start { t_s: d.t_s, state, sigma, how: vec![format!("as {} says", source.path())] })
}

/// The key whose value means no state, and why.
fn check(d: &Description) -> Result<(), (&'static str, String)> {
    let limits = [
        ("lat_deg", d.lat_deg, 90.0),
        ("lon_deg", d.lon_deg, LON_DEG),
        ("roll_deg", d.roll_deg, ROLL_DEG),
        ("pitch_deg", d.pitch_deg, PITCH_DEG),
        ("yaw_deg", d.yaw_deg, YAW_DEG),
    ];
    if let Some((key, _, limit)) =
        limits.iter().find(|(_, value, limit)| value.is_nan() || value.abs() > *limit)
    {
        return Err((key, format!("is not within ±{limit}")));
    }
    let unlimited = [
        ("t_s", d.t_s),
        ("h_m", d.h_m),
        ("v_n_m_s", d.v_n_m_s),
        ("v_e_m_s", d.v_e_m_s),
        ("v_d_m_s", d.v_d_m_s),
    ];
    if let Some((key, _)) = unlimited.iter().find(|(_, value)| !value.is_finite()) {
        return Err((key, "is not a finite number".to_owned()));
    }
    if d.lat_deg.abs() > MAX_LATITUDE_DEG {
        return Err(("lat_deg", "is too near a pole to navigate in latitude and longitude".to_owned()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_name_line_key_and_value() {
        let sound =
            "t_s = 0\nlat_deg = 46\nlon_deg = 6\nh_m = 400\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 40\n";
        let refused = |text: &str| {
            let e = parse(&Source::new("i.toml", text)).unwrap_err();
            format!("{e} | {}", e.hint().unwrap_or_default())
        };
        assert_eq!(parse(&Source::new("i.toml", sound)).unwrap().sigma, InitialSettings::default());
        for (old, new, expected) in [
            ("= 46", "= 91", "i.toml, line 2: \"lat_deg\" = 91 is not within ±90 | "),
            (
                "= 46",
                "= 89.95",
                "i.toml, line 2: \"lat_deg\" = 89.95 is too near a pole to navigate in latitude and longitude | ",
            ),
            ("= 400", "= inf", "i.toml, line 4: \"h_m\" = inf is not a finite number | "),
            ("h_m = 400\n", "", "i.toml, line 1: \"h_m\" is missing | add the key \"h_m\""),
            (
                "yaw_deg",
                "heading_deg",
                "i.toml, line 7: unknown key \"heading_deg\" | did you mean \"yaw_deg\"?",
            ),
            (
                "t_s = 0",
                "pos_sigma_m = [1, 1, -1]",
                "i.toml, line 1: \"t_s\" is missing | add the key \"t_s\"",
            ),
            (
                "t_s = 0",
                "t_s = 0\npos_sigma_m = [1, 1, -1]",
                "i.toml, line 2: \"pos_sigma_m\" = [1, 1, -1] is refused: it must be a finite number > 0 | ",
            ),
        ] {
            assert_eq!(refused(&sound.replacen(old, new, 1)), expected);
        }
    }
}
