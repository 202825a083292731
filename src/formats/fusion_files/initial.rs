//! An initial state (TOML).

use crate::earth::MAX_LATITUDE;
use crate::ekf::InitialSettings;
use crate::formats::FileError;
use crate::formats::toml_file::{Section, Source};
use crate::frames::{NavState, RollPitchYaw};
use crate::fusion::Start;
use crate::units::DEG;
use glam::DVec3;
use std::path::Path;

const KEYS: [&str; 17] = [
    "t_s",
    "lat_deg",
    "lon_deg",
    "h_m",
    "v_n_m_s",
    "v_e_m_s",
    "v_d_m_s",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "pos_sigma_m",
    "vel_sigma_m_s",
    "att_sigma_deg",
    "accel_bias_sigma_m_s2",
    "gyro_bias_sigma_rad_s",
    "accel_scale_sigma_ppm",
    "gyro_scale_sigma_ppm",
];

/// Reads an initial state: time, position of the IMU, velocity (0 where it is not said), attitude of the
/// vehicle, and standard deviations as in the `[initial]` section of a scenario.
///
/// # Errors
/// File, line, key and value of what is refused.
pub(crate) fn read_initial(path: &Path) -> Result<Start, FileError> {
    parse(&Source::read(path)?)
}

fn parse(source: &Source) -> Result<Start, FileError> {
    let table = source.parse()?;
    let root = source.root(&table);
    root.only(&KEYS)?;
    let angle = |key: &str, limit: f64| {
        let degrees = root.require_f64(key)?;
        if degrees.abs() > limit {
            return Err(root.refuse(key, format!("is not within ±{limit}"), None));
        }
        Ok(degrees * DEG)
    };
    let speed = |key| Ok::<f64, FileError>(root.f64(key)?.unwrap_or(0.0));
    let lat = angle("lat_deg", 90.0)?;
    if lat.abs() > MAX_LATITUDE {
        return Err(root.refuse("lat_deg", "is too near a pole to navigate in latitude and longitude", None));
    }
    let attitude = RollPitchYaw {
        roll: angle("roll_deg", 180.0)?,
        pitch: angle("pitch_deg", 90.0)?,
        yaw: angle("yaw_deg", 360.0)?,
    };
    let state = NavState {
        lat,
        lon: angle("lon_deg", 360.0)?,
        h: root.require_f64("h_m")?,
        v_n: DVec3::new(speed("v_n_m_s")?, speed("v_e_m_s")?, speed("v_d_m_s")?),
        q_b_n: attitude.to_quat(),
    };
    let how = vec![format!("as {} says", source.path())];
    Ok(Start { t_s: root.require_f64("t_s")?, state, sigma: sigma(&root)?, how })
}

fn sigma(root: &Section<'_>) -> Result<InitialSettings, FileError> {
    let d = InitialSettings::default();
    let three = |key: &str, default: [f64; 3]| match root.f64s(key)? {
        None => Ok(default),
        Some(v) => <[f64; 3]>::try_from(v).map_err(|_| root.refuse(key, "is not three numbers", None)),
    };
    let sigma = InitialSettings {
        pos_sigma_m: three("pos_sigma_m", d.pos_sigma_m)?,
        vel_sigma_m_s: three("vel_sigma_m_s", d.vel_sigma_m_s)?,
        att_sigma_deg: three("att_sigma_deg", d.att_sigma_deg)?,
        accel_bias_sigma_m_s2: root.f64("accel_bias_sigma_m_s2")?,
        gyro_bias_sigma_rad_s: root.f64("gyro_bias_sigma_rad_s")?,
        accel_scale_sigma_ppm: root.f64("accel_scale_sigma_ppm")?,
        gyro_scale_sigma_ppm: root.f64("gyro_scale_sigma_ppm")?,
        perfect: false,
    };
    sigma
        .validate()
        .map_err(|e| root.refuse(&e.key.clone(), format!("is refused: {}", e.requirement), None))?;
    Ok(sigma)
}
