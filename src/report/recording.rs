//! A simulated recording as the files that `fuse` reads.

use nav_sim_navigation::ekf::InitialSettings;
use nav_sim_navigation::frames::{NavState, RollPitchYaw, wrap_angle};
use nav_sim_navigation::gnss::GnssFix;
use nav_sim_signal::imu::{ImuIncrement, Sensor};
use nav_sim_signal::units::DEG;
use std::fmt::Write as _;

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
        let bias = (InitialSettings::bias_key(sensor), sigma.bias_sigma(sensor));
        let scale = (
            InitialSettings::scale_key(sensor),
            sigma.scale_sigma_ppm(sensor),
        );
        let said = [bias, scale]
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
