//! Headers of other programs, and units in names.

use super::*;

const PLACE: HeaderPlace<'_> = HeaderPlace {
    path: "a.csv",
    line: 1,
};

fn signal_of(name: &str, si: bool) -> Option<(String, f64)> {
    match classify(name, si) {
        Some(Ok(Role::Signal {
            channel,
            unit: Unit::Si(factor),
        })) => Some((channel.to_string(), factor)),
        _ => None,
    }
}

#[test]
fn names_of_many_tools() {
    let g = STANDARD_GRAVITY;
    for (name, channel, factor) in [
        ("accel_x_m_s2", "accel.x", 1.0),
        ("accel_y_g", "accel.y", g),
        ("accel_z_mg", "accel.z", 1e-3 * g),
        ("gyro_x_rad_s", "gyro.x", 1.0),
        ("gyro_y_deg_s", "gyro.y", DEG),
        ("gyro_z_deg_h", "gyro.z", DEG_PER_HOUR),
        ("w_RS_S_x [rad s^-1]", "gyro.x", 1.0),
        ("a_RS_S_z [m s^-2]", "accel.z", 1.0),
        ("omega_x", "gyro.x", 1.0),
        ("alpha_z", "accel.z", 1.0),
        ("field.angular_velocity.y", "gyro.y", 1.0),
        ("linear_acceleration.x", "accel.x", 1.0),
        ("Gyroscope X (deg/s)", "gyro.x", DEG),
        ("Accelerometer Z (g)", "accel.z", g),
        ("Gyroscope Y (°/s)", "gyro.y", DEG),
        ("accel_x (m/s^2)", "accel.x", 1.0),
        ("gyro_z (deg/s)", "gyro.z", DEG),
        ("ax_mps2", "accel.x", 1.0),
        ("gz_radps", "gyro.z", 1.0),
        ("gyro_x_radps", "gyro.x", 1.0),
        ("acc_y [m/s²]", "accel.y", 1.0),
        ("gx_dps", "gyro.x", DEG),
    ] {
        assert_eq!(
            signal_of(name, false),
            Some((channel.to_owned(), factor)),
            "{name}"
        );
    }
    assert_eq!(signal_of("Acc_X", true), Some(("accel.x".into(), 1.0)));
    assert_eq!(signal_of("Gyr_Z", true), Some(("gyro.z".into(), 1.0)));
}

#[test]
fn times_and_counters() {
    for (name, unit_s) in [
        ("t_s", Some(1.0)),
        ("t_ms", Some(1e-3)),
        ("time (sec)", Some(1.0)),
        ("Timestamp (us)", Some(1e-6)),
        ("#timestamp [ns]", Some(1e-9)),
        ("%time", None),
        ("field.header.stamp", None),
        ("Time", None),
    ] {
        assert_eq!(
            classify(name, false),
            Some(Ok(Role::Time { unit_s })),
            "{name}"
        );
    }
    assert_eq!(classify("PacketCounter", true), Some(Ok(Role::Counter)));
    assert_eq!(classify("SampleTimeFine", true), Some(Ok(Role::Ticks)));
}

#[test]
fn what_is_not_inertial_means_nothing() {
    for name in [
        "",
        "Mag_X",
        "Magnetometer X (uT)",
        "field.orientation.x",
        "lat_deg",
        "x",
        "roll",
        "°",
        "accel",
    ] {
        assert_eq!(classify(name, false), None, "{name}");
    }
}

#[test]
fn a_gyro_needs_a_unit_and_an_accelerometer_has_gravity() {
    assert_eq!(classify("gyro_x", false), Some(Err(())));
    assert_eq!(classify("gx", false), Some(Err(())));
    let channel = Channel {
        sensor: Sensor::Accel,
        axis: Axis::X,
    };
    assert_eq!(
        classify("ax", false),
        Some(Ok(Role::Signal {
            channel,
            unit: Unit::FromGravity
        }))
    );
}

#[test]
fn an_unknown_unit_is_not_passed_over() {
    let layout = |names: &[&str], wanted: Option<&[Channel]>| {
        Layout::new(
            PLACE,
            &names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>(),
            false,
            wanted,
        )
    };
    for name in [
        "accel_x_ft_s2",
        "gyro_z_rpm",
        "Accelerometer X (counts)",
        "ax_lsb",
        "dv_x_ft_s",
        "dtheta_y_mrad",
    ] {
        let error = layout(&["t_s", "gyro_x_rad_s", name], None).unwrap_err();
        let expected = format!("a.csv, line 1: column \"{name}\" is in a unit that is not known");
        assert_eq!(error.to_string(), expected);
    }
    assert!(
        layout(&["accel_x_m_s2", "accel_x_sigma"], None).is_ok(),
        "the axis is there"
    );
    let y = Channel {
        sensor: Sensor::Accel,
        axis: Axis::Y,
    };
    assert!(
        layout(&["accel_x_ft_s2", "accel_y_g"], Some(&[y])).is_ok(),
        "not wanted"
    );
    assert!(layout(&["accel_y_g", "temperature", "a_x_ratio", "mag_x_ut"], None).is_ok());
}

#[test]
fn the_stamp_of_the_measurement_is_the_time() {
    let names: Vec<String> = [
        "%time",
        "field.header.stamp",
        "field.header.frame_id",
        "field.linear_acceleration.x",
    ]
    .map(String::from)
    .to_vec();
    let layout = Layout::new(PLACE, &names, false, None).unwrap();
    let kept: Vec<usize> = layout.found.iter().map(|f| f.index).collect();
    assert_eq!(kept, [1, 3]);
    assert_eq!(layout.ignored, ["field.header.frame_id", "%time"]);
}

#[test]
fn our_own_names_are_known() {
    for channel in Channel::ALL {
        assert_eq!(
            signal_of(&column_name(channel), false),
            Some((channel.to_string(), 1.0))
        );
    }
}
