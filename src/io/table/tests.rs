//! Headers of other programs, units in names, and what stands before and between rows.

use super::*;
use crate::io::recordings::DICTIONARY;
use nav_sim_signal::units::{DEG, DEG_PER_HOUR, STANDARD_GRAVITY};
use proptest::prelude::*;

fn found(name: &str) -> Option<(&'static str, Option<f64>)> {
    quantity::find(DICTIONARY.quantities, name).map(|(quantity, factor)| (quantity.name, factor))
}

fn with_header(names: &[&str], unwanted: &[&str]) -> Result<InputTable, Failure> {
    let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
    let is_unwanted = |q: &Quantity| unwanted.contains(&q.name);
    let dictionary = Dictionary {
        unwanted: Some(&is_unwanted),
        ..DICTIONARY
    };
    InputTable::new("a.csv", 1, &names, &dictionary, false)
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
        ("dtheta_x_deg", "gyro.x", DEG),
    ] {
        assert_eq!(found(name), Some((channel, Some(factor))), "{name}");
    }
    for (name, unit_s) in [
        ("t_s", Some(1.0)),
        ("t_ms", Some(1e-3)),
        ("time (sec)", Some(1.0)),
        ("Timestamp (us)", Some(1e-6)),
        ("#timestamp [ns]", Some(1e-9)),
        ("TimeUS", Some(1e-6)),
        ("%time", None),
        ("field.header.stamp", None),
        ("Time", None),
    ] {
        assert_eq!(found(name), Some(("t_s", unit_s)), "{name}");
    }
    for (name, quantity) in [("gyro_x", "gyro.x"), ("gx", "gyro.x"), ("ax", "accel.x")] {
        assert_eq!(found(name), Some((quantity, None)), "{name}");
    }
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
        assert_eq!(found(name), None, "{name}");
    }
}

#[test]
fn an_unknown_unit_is_not_passed_over() {
    for name in [
        "accel_x_ft_s2",
        "gyro_z_rpm",
        "Accelerometer X (counts)",
        "ax_lsb",
        "dv_x_ft_s",
        "dtheta_y_mrad",
    ] {
        let error = with_header(&["t_s", "gyro_x_rad_s", name], &[]).unwrap_err();
        let expected = format!("a.csv, line 1: column \"{name}\" is in an unknown unit");
        assert_eq!(error.to_string(), expected);
    }
    let is_there = ["accel_x_m_s2", "accel_x_sigma"];
    assert!(with_header(&is_there, &[]).is_ok());
    assert!(with_header(&["accel_x_ft_s2", "accel_y_g"], &["accel.x"]).is_ok());
    assert!(with_header(&["accel_y_g", "temperature", "a_x_ratio", "mag_x_ut"], &[]).is_ok());
}

#[test]
fn the_stamp_of_the_measurement_is_the_time() {
    let names = [
        "%time",
        "field.header.stamp",
        "field.header.frame_id",
        "field.linear_acceleration.x",
    ];
    let table = with_header(&names, &[]).unwrap();
    let kept: Vec<&str> = table.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(kept, [names[1], names[3]]);
    assert_eq!(table.ignored, [names[2], names[0]]);
}

#[test]
fn lines_before_the_header_and_decimal_commas_are_read() {
    let text = "Logger 7;\nStarted;2026-11-26\n\nt_s;Gyro X (deg/s)\n0,00;1,5\n0,01;-2\n";
    let table = parse("a.csv", text, &DICTIONARY).unwrap();
    assert_eq!((table.header_line, table.line(1)), (4, 6));
    let gyro = table.get("gyro.x").unwrap();
    assert_eq!(gyro.values, [1.5, -2.0]);
    let quoted = "t_s,gyro_x_rad_s,note\n0,1,\"a, b\"\n1,2,\"c\nd\"\n2,3,e\n";
    let table = parse("a.csv", quoted, &DICTIONARY).unwrap();
    assert_eq!((table.rows(), table.line(2)), (3, 5));
    let comments = "# made by hand\nt_s,gyro_x_rad_s\n0,1\n# a gap\n1,2\n";
    let table = parse("a.csv", comments, &DICTIONARY).unwrap();
    assert_eq!(table.rows(), 2);
    assert_eq!(table.comments, ["made by hand", "a gap"]);
}

/// A quote that is not closed takes all lines behind it, which is no last line that was cut off.
#[test]
fn an_open_quote_is_refused_where_it_stands() {
    let read = |row: &str| {
        let text = format!("t_s,gyro_x_rad_s,note\n0,1,a\n1,2,b\n{row}\n3,4,d\n4,5,e\n");
        parse("a.csv", &text, &DICTIONARY)
    };
    for row in ["\"2,3,c", "2,\"3,c", "2,3,\"c", "2,3,\"c\"\",d"] {
        let refusal = read(row).unwrap_err().to_string();
        assert_eq!(refusal, "a.csv, line 4: a quote is not closed");
    }
    for row in [
        "2,3,5\" pipe",
        "2,3,\"5\"\" pipe\"",
        "2,3, \"a, b\" ",
        "2,3,\"a,\nb\"",
    ] {
        assert_eq!(read(row).unwrap().rows(), 5, "{row}");
    }
}

#[test]
fn columns_beyond_the_memory_are_refused_with_both_figures() {
    let table = with_header(&["t_s"], &[]).unwrap();
    let text = table.fits(u64::MAX / 16).unwrap_err().to_string();
    assert!(
        text.starts_with("a.csv: its samples need 8796093022208 MiB of memory, ")
            && text.ends_with(" MiB are free"),
        "{text}"
    );
}

proptest! {
    #[test]
    fn never_panics_on_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let reader = Box::new(Cursor::new(bytes));
        let _ = read_text("a.csv", reader, &DICTIONARY);
    }
}

/// Time stamps have the unit of their type, decimals their scale, and a text is no number.
#[cfg(feature = "parquet")]
#[test]
fn types_of_parquet_are_respected() {
    use parquet::data_type::{ByteArray, ByteArrayType, Int32Type, Int64Type};
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("a.parquet");
    let made = |time: &str, accel: &str| {
        let schema = format!("message m {{ required int64 stamp ({time}); {accel} }}");
        let schema = std::sync::Arc::new(parse_message_type(&schema).unwrap());
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = SerializedFileWriter::new(file, schema, Default::default()).unwrap();
        let mut rows = writer.next_row_group().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let stamps = [1_700_000_000_000_000, 1_700_000_000_010_000];
        column
            .typed::<Int64Type>()
            .write_batch(&stamps, None, None)
            .unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        match accel.contains("int32") {
            true => column
                .typed::<Int32Type>()
                .write_batch(&[-1_250, 9_806], None, None),
            false => {
                let texts = ["a", "b"].map(ByteArray::from);
                column
                    .typed::<ByteArrayType>()
                    .write_batch(&texts, None, None)
            }
        }
        .unwrap();
        column.close().unwrap();
        rows.close().unwrap();
        writer.close().unwrap();
        read(&path, &DICTIONARY)
    };
    let decimal = "required int32 accel_x_m_s2 (DECIMAL(9,3));";
    for (time, factor) in [
        ("TIMESTAMP(MICROS,true)", 1e-6),
        ("TIMESTAMP(NANOS,false)", 1e-9),
        ("TIMESTAMP_MICROS", 1e-6),
    ] {
        let table = made(time, decimal).unwrap();
        let t = table
            .columns
            .iter()
            .find(|c| c.name.starts_with("t_"))
            .unwrap();
        assert_eq!(
            (t.factor, t.values[1] - t.values[0]),
            (Some(factor), 10_000.0),
            "{time}"
        );
        assert_eq!(table.get("accel.x").unwrap().values, [-1.25, 9.806]);
    }
    let text = made(
        "TIMESTAMP(MICROS,true)",
        "required binary accel_x_m_s2 (UTF8);",
    );
    let refusal = text.unwrap_err().to_string();
    assert!(refusal.contains("accel_x_m_s2"), "{refusal}");
}
