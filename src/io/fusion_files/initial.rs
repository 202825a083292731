//! An initial state (TOML).

use crate::io::Failure;
use crate::io::toml_file::{Between, Finite, Source};
use glam::DVec3;
use nav_sim_navigation::earth::MAX_LATITUDE_DEG;
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw};
use nav_sim_navigation::fusion::Start;
use nav_sim_signal::units::{DEG, exactly_if};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::Path;

/// Where and how a drive begins: nav-sim fuse --initial
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Initial state")]
struct Description {
    /// Time (s)
    t_s: Finite,
    /// Latitude of the IMU (degrees)
    #[schemars(range(min = -MAX_LATITUDE_DEG, max = MAX_LATITUDE_DEG))]
    lat_deg: Finite,
    /// Longitude of the IMU (degrees)
    lon_deg: Between<-360, 360, false>,
    /// Height of the IMU above the ellipsoid (m)
    h_m: Finite,
    /// Velocity north (m/s; default: 0)
    #[serde(default)]
    v_n_m_s: Finite,
    /// Velocity east (m/s; default: 0)
    #[serde(default)]
    v_e_m_s: Finite,
    /// Velocity down (m/s; default: 0)
    #[serde(default)]
    v_d_m_s: Finite,
    /// Roll of the vehicle (degrees)
    roll_deg: Between<-180, 180, false>,
    /// Pitch (degrees)
    pitch_deg: Between<-90, 90, false>,
    /// Yaw (degrees)
    yaw_deg: Between<-360, 360, false>,
    /// Standard deviations of the position north, east, down (m; default: as in scenarios)
    #[serde(default, deserialize_with = "exactly_if")]
    pos_sigma_m: Option<[f64; 3]>,
    /// Of the velocity (m/s)
    #[serde(default, deserialize_with = "exactly_if")]
    vel_sigma_m_s: Option<[f64; 3]>,
    /// Of roll, pitch, yaw (degrees)
    #[serde(default, deserialize_with = "exactly_if")]
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
pub(crate) fn read_initial(path: &Path) -> Result<Start, Failure> {
    parse(&Source::read(path)?)
}

fn parse(source: &Source) -> Result<Start, Failure> {
    let d: Description = source.get()?;
    if d.lat_deg.0.abs() > MAX_LATITUDE_DEG {
        return Err(source.refused("lat_deg", format!("is not within ±{MAX_LATITUDE_DEG}")));
    }
    let (roll, pitch, yaw) = (d.roll_deg.0 * DEG, d.pitch_deg.0 * DEG, d.yaw_deg.0 * DEG);
    let state = NavState {
        lat: d.lat_deg.0 * DEG,
        lon: d.lon_deg.0 * DEG,
        h: d.h_m.0,
        v_n: DVec3::new(d.v_n_m_s.0, d.v_e_m_s.0, d.v_d_m_s.0),
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
    sigma.validate().map_err(|e| source.setting(&e))?;
    Ok(Start {
        t_s: d.t_s.0,
        state,
        sigma,
        found: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_name_line_key_and_value() {
        let sound = "t_s = 0\nlat_deg = 46\nlon_deg = 6\nh_m = 400\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 40\n";
        let refused = |text: &str| {
            let e = parse(&Source::new("i.toml", text)).unwrap_err();
            format!("{e} | {}", e.advice().unwrap_or_default())
        };
        assert_eq!(
            parse(&Source::new("i.toml", sound)).unwrap().sigma,
            InitialSettings::default()
        );
        for (old, new, expected) in [
            (
                "= 46",
                "= 91",
                "i.toml, line 2: \"lat_deg\" = 91 is not within ±89.9 | ",
            ),
            (
                "= 46",
                "= 89.95",
                "i.toml, line 2: \"lat_deg\" = 89.95 is not within ±89.9 | ",
            ),
            (
                "= 400",
                "= inf",
                "i.toml, line 4: \"h_m\" = inf is not a finite number such as 1.5e-4 | ",
            ),
            (
                "h_m = 400\n",
                "",
                "i.toml, line 1: \"h_m\" is missing | add the key \"h_m\"",
            ),
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
                "i.toml, line 2: \"pos_sigma_m\" = [1, 1, -1] is refused: it must be a finite number > 0 and ≤ 100000 | ",
            ),
        ] {
            assert_eq!(refused(&sound.replacen(old, new, 1)), expected);
        }
    }
}
