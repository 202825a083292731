//! `epochs.csv` and `runs.csv` of a run directory.

use super::csv::{csv, flat};
use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_navigation::metrics::{EpochMetrics, Estimate, PerState};
use nav_sim_navigation::simulation::{BIAS_NAMES, RunRecord, RunResult};
use nav_sim_signal::imu::{ImuIncrement, Sensor};
use nav_sim_signal::units::DEG;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// `epochs.csv`: one row a reporting epoch (1 Hz), means over runs.
pub(crate) fn epochs_csv(epochs: &[EpochMetrics]) -> String {
    let values = |all: &PerState<Estimate>| PerState(all.0.map(|e| e.value));
    let row = |e: &EpochMetrics| {
        let mut row = flat(&json!({
            "t_s": e.t_s,
            "gnss": u8::from(e.gnss),
            "asee": values(&e.asee),
            "rmse": values(&e.rmse),
            "bias": values(&e.bias),
            "mean_pos_err_m": e.mean_pos_err_m.value,
            "mean_att_err_deg": e.mean_att_err_deg.value,
            "nees": e.nees.value,
            "coverage": e.coverage,
        }));
        row.extend(
            BIAS_NAMES
                .iter()
                .zip(e.bias_asee)
                .map(|(name, asee)| (format!("asee_{name}"), asee.into())),
        );
        row
    };
    csv(&epochs.iter().map(row).collect::<Vec<_>>())
}

/// `runs.csv`, run by run: one row a run and outage (one row a run, outage empty, when there is none).
pub(crate) fn runs_csv(result: &RunResult) -> impl Iterator<Item = String> {
    let rows = |(k, run): (usize, &RunRecord)| {
        let row = |outage: Option<usize>| {
            let end = outage.map(|i| run.outages[i].clone()).unwrap_or_default();
            let mut row = flat(&json!({
                "run": run.run,
                "diverged": u8::from(run.diverged),
                "nis_mean": run.nis.0,
                "fixes": run.nis.1,
                "nees_mean": run.nees_mean,
                "coverage": run.covered,
                "normalised_sq": PerState(run.normalised_sq),
                "outage": outage,
                "see_mean": PerState(end.see_mean),
                "see_end": PerState(end.see_end),
                "error_end": PerState(end.error_end),
                "nees_end": end.nees_end,
                "log_density_end": end.log_density_end,
                "horizontal_error_end_m": end.horizontal_error_end_m,
                "reconvergence_s": end.reconvergence_s,
            }));
            let of_outage = row.iter_mut().skip_while(|(key, _)| *key != "outage");
            if outage.is_none() {
                of_outage.for_each(|(_, value)| *value = Value::Null);
            }
            row
        };
        let rows: Vec<_> = match run.outages.len() {
            0 => vec![row(None)],
            outages => (0..outages).map(Some).map(row).collect(),
        };
        let text = csv(&rows);
        match text.split_once('\n') {
            Some((_, rows)) if k > 0 => rows.to_owned(),
            _ => text,
        }
    };
    result.runs.iter().enumerate().map(rows)
}

// A simulated recording as the files that `fuse` reads.

/// `imu.csv`: mean rates over the interval that ends at the time given.
pub(crate) fn imu_csv(samples: &[ImuIncrement]) -> String {
    let mut text =
        "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n"
            .to_owned();
    for s in samples {
        let (w, f) = (s.dtheta / s.dt_s, s.dv / s.dt_s);
        // 1e-10 rad/s and 1e-8 m/s²: a thousandth of the noise of the best sensors
        let _ = writeln!(
            text,
            "{:.6},{:.10},{:.10},{:.10},{:.8},{:.8},{:.8}",
            s.t_s, w.x, w.y, w.z, f.x, f.y, f.z
        );
    }
    text
}

/// `gnss.csv`: fixes with their standard deviations.
pub(crate) fn gnss_csv(fixes: &[GnssFix]) -> String {
    let has_velocity = fixes.iter().any(|f| f.velocity.is_some());
    let velocity = ",v_n_m_s,v_e_m_s,v_d_m_s,sd_vn_m_s,sd_ve_m_s,sd_vd_m_s";
    let more = if has_velocity { velocity } else { "" };
    let mut text = format!("t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m{more}\n");
    for f in fixes {
        let s = f.pos_sigma_n;
        let _ = write!(
            text,
            "{:.6},{:.10},{:.10},{:.4},{},{},{}",
            f.t_s,
            f.lat / DEG,
            wrap_angle(f.lon) / DEG,
            f.h,
            s.x,
            s.y,
            s.z
        );
        if let Some(velocity) = f.velocity {
            let (v, s) = (velocity.v_n(), velocity.sigma_n());
            let _ = write!(
                text,
                ",{:.5},{:.5},{:.5},{},{},{}",
                v.x, v.y, v.z, s.x, s.y, s.z
            );
        }
        text.push('\n');
    }
    text
}

/// `initial.toml`: a start and how well it is known.
pub(crate) fn initial_toml(t_s: f64, state: &NavState, sigma: &InitialSettings) -> String {
    let rpy = RollPitchYaw::from_quat(state.q_b_n);
    let v = state.v_n;
    let list = |x: [f64; 3]| format!("[{:?}, {:?}, {:?}]", x[0], x[1], x[2]);
    let beside = |sensor: Sensor| {
        let said = [
            (InitialSettings::bias_key(sensor), sigma.bias_sigma(sensor)),
            (
                InitialSettings::scale_key(sensor),
                sigma.scale_sigma_ppm(sensor),
            ),
        ]
        .into_iter()
        .filter_map(|(key, sigma)| Some((key, sigma?)));
        said.map(|(key, sigma)| format!("{key} = {sigma:?}\n"))
            .collect::<String>()
    };
    format!(
        "t_s = {t_s:?}\nlat_deg = {:.10}\nlon_deg = {:.10}\nh_m = {:.4}\nv_n_m_s = {:.5}\nv_e_m_s = {:.5}\n\
         v_d_m_s = {:.5}\nroll_deg = {:.6}\npitch_deg = {:.6}\nyaw_deg = {:.6}\npos_sigma_m = {}\n\
         vel_sigma_m_s = {}\natt_sigma_deg = {}\n{}{}",
        state.lat / DEG,
        wrap_angle(state.lon) / DEG,
        state.h,
        v.x,
        v.y,
        v.z,
        rpy.roll / DEG,
        rpy.pitch / DEG,
        rpy.yaw / DEG,
        list(sigma.pos_sigma_m),
        list(sigma.vel_sigma_m_s),
        list(sigma.att_sigma_deg),
        beside(Sensor::Accel),
        beside(Sensor::Gyro)
    )
}

#[cfg(test)]
mod tables_tests {
    use super::*;

    #[test]
    fn the_columns_are_those_of_the_interface() {
        let epochs = nav_sim_navigation::metrics::epochs(&crate::report::sample::result());
        let header = epochs_csv(&epochs)
            .lines()
            .next()
            .unwrap()
            .replace(',', ", ");
        assert!(
            header.starts_with(
                "t_s, gnss, asee_pos_n_m, asee_pos_e_m, asee_pos_d_m, asee_vel_n_m_s, "
            )
        );
        assert!(
            header.contains("asee_yaw_deg, rmse_pos_n_m")
                && header.contains("rmse_yaw_deg, bias_pos_n_m")
        );
        assert!(header.contains(
            "bias_yaw_deg, mean_pos_err_m, mean_att_err_deg, nees, coverage, asee_b_ax_m_s2"
        ));
        assert!(
            header.ends_with("asee_b_az_m_s2, asee_b_gx_rad_s, asee_b_gy_rad_s, asee_b_gz_rad_s")
        );
    }
}
