//! Fixes of the receiver in a log.

use super::Remark;
use super::fixes::Fixes;
use super::rtklib::of_unix;
use crate::formats::{FileError, Place, Setting, logs};
use glam::DVec3;
use nav_sim_logs::{Clock, Fix, Stamp};
use nav_sim_navigation::gnss::{FixSigma, GnssFix, GnssVelocity};
use nav_sim_signal::units::DEG;
use std::path::Path;

/// Reads fixes of a topic, of several; `unsaid` are the standard deviations where the log states none, `imu_s` is when the IMU
/// begins and ends.
///
/// # Errors
/// When the log is damaged, has no fixes, or states no standard deviations where none are given.
pub(super) fn fixes(
    path: &Path,
    (unsaid, topic): (Option<&FixSigma>, Option<&str>),
    imu_s: Option<(f64, f64)>,
) -> Result<Fixes, FileError> {
    let refused = |e| logs::refused(path, e);
    let log = logs::open(path)?;
    let mut read = log.fixes(topic, Stamp::default()).map_err(refused)?;
    let mut fixes = Vec::new();
    for (row, fix) in read.by_ref().enumerate() {
        let fix = of_log(&fix.map_err(refused)?, unsaid).ok_or_else(|| {
            let message = "the fixes have no standard deviations";
            FileError::contents(path.display().to_string(), Place::Within, message)
                .setting(Setting::FixSigma)
        })?;
        fixes.push((row as u64 + 1, fix));
    }
    let mut said = format!("fixes of {}", read.topic());
    let is_dated = log
        .channels()
        .iter()
        .any(|c| c.topic == read.topic() && c.clock == Clock::Unix);
    let span_s = fixes
        .first()
        .zip(fixes.last())
        .map(|((_, first), (_, last))| (first.t_s, last.t_s));
    if let Some(clock) = span_s
        .filter(|_| is_dated)
        .and_then(|span_s| of_unix(span_s, imu_s))
    {
        fixes
            .iter_mut()
            .for_each(|(_, fix)| fix.t_s -= clock.origin_s);
        said = format!("{said}, in {}", clock.name);
    }
    let cut = read.damage().or(log.damage()).map(logs::cut_off);
    let remarks = cut.map(Remark::doubt).into_iter();
    Ok((fixes, remarks.chain([Remark::note(said)]).collect()))
}

/// The same fix with angles in radians; none without standard deviations.
fn of_log(fix: &Fix, unsaid: Option<&FixSigma>) -> Option<GnssFix> {
    let pos_sigma_n = fix.sd_ned_m.or(unsaid.map(|sigma| sigma.pos_m))?;
    let velocity_sigma = fix.sd_v_ned_m_s.or(unsaid.and_then(|sigma| sigma.vel_m_s));
    let velocity = fix.v_ned_m_s.zip(velocity_sigma);
    Some(GnssFix {
        t_s: fix.t_s(),
        lat: fix.lat_deg * DEG,
        lon: fix.lon_deg * DEG,
        h: fix.h_m,
        pos_sigma_n: DVec3::from(pos_sigma_n),
        velocity: velocity.map(|(v, sigma)| GnssVelocity::new(v.into(), sigma.into())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sums are those of the independent writer of the file (`src/logs/tests/data/expected.csv`), in degrees and metres.
    #[test]
    fn fixes_of_a_log_are_those_of_its_writer() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/logs/tests/data/ros2_zstd.mcap");
        let (fixes, _) = fixes(&path, (None, None), None).unwrap();
        let sum = |of: fn(&GnssFix) -> f64| fixes.iter().map(|(_, fix)| of(fix)).sum::<f64>();
        assert_eq!(fixes.len(), 4);
        assert!((sum(|f| f.lat) / DEG - 186.000_007_999_999_98).abs() < 1e-11);
        assert!((sum(|f| f.lon) / DEG - 26.399_984).abs() < 1e-11);
        assert!((sum(|f| f.h) - 1_601.022_578_849_756).abs() < 1e-9);
        assert!((sum(|f| f.pos_sigma_n.z) - 4.8).abs() < 1e-12);
    }
}
