//! Recordings as loggers and receivers write them.

use super::*;

/// A logger of front, left, up told as such gives the solution of front, right, down; other counts of columns without
/// a header are refused with what is expected; a reference that jumps is compared with where it does not.
#[test]
fn inputs_as_loggers_and_receivers_have_them() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let imu = fs::read_to_string(at("rec/imu.csv")).unwrap();
    let turned = |line: &str| {
        let cell = |(i, c): (usize, &str)| match (i, c.strip_prefix('-')) {
            (2 | 3 | 5 | 6, Some(positive)) => positive.to_owned(),
            (2 | 3 | 5 | 6, None) if c.parse::<f64>().is_ok() => format!("-{c}"),
            _ => c.to_owned(),
        };
        line.split(',')
            .enumerate()
            .map(cell)
            .collect::<Vec<_>>()
            .join(",")
            + "\n"
    };
    fs::write(at("flu.csv"), imu.lines().map(turned).collect::<String>()).unwrap();
    let end = |arguments: &str| {
        done(
            place.path(),
            &format!("fuse {arguments} rec/gnss.csv imu.toml -o out"),
        );
        table(&at("out/solution.csv")).pop().unwrap()
    };
    let (frd, flu) = (end("rec/imu.csv"), end("--mounting flu flu.csv"));
    for i in 0..10 {
        assert!(
            (frd[i] - flu[i]).abs() < 1e-6 * (1.0 + frd[i].abs()),
            "column {i}: {} {}",
            frd[i],
            flu[i]
        );
    }
    for (name, columns) in [("ten.txt", 10), ("six.txt", 6)] {
        fs::write(
            at(name),
            format!("{}\n", vec!["1"; columns].join(" ")).repeat(5),
        )
        .unwrap();
        let ran = nav_sim(
            place.path(),
            &format!("fuse rec/imu.csv {name} imu.toml -o bad"),
        );
        assert_eq!(ran.code, 2);
        for text in [
            &format!("{name}, line 1: no header with column names"),
            "7 (t_s, latitude",
        ] {
            assert!(ran.stderr.contains(text), "{}", ran.stderr);
        }
    }
    let reference = fs::read_to_string(at("rec/reference.csv")).unwrap();
    let glitch = |(i, l): (usize, &str)| {
        let row = if (400..405).contains(&i) {
            l.replacen(",46.", ",47.", 1)
        } else {
            l.to_owned()
        };
        row + "\n"
    };
    fs::write(
        at("glitch.csv"),
        reference
            .lines()
            .enumerate()
            .map(glitch)
            .collect::<String>(),
    )
    .unwrap();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --reference glitch.csv -o out",
    );
    assert!(
        ran.stderr.contains("glitch.csv, line 401: a jump of 11"),
        "{}",
        ran.stderr
    );
    let largest = table(&at("out/errors.csv"))
        .iter()
        .map(|e| e[1].hypot(e[2]))
        .fold(0.0, f64::max);
    assert!(largest < 30.0, "{largest}");
}

/// Two seconds without samples are bridged and told; the outage that lasts past the last fix is cut and told.
#[test]
fn holes_are_bridged_and_windows_cut_with_a_word() {
    let place = recorded();
    let path = place.path().join("rec/imu.csv");
    let hole =
        |(i, line): (usize, &str)| (!(6000..6200).contains(&i)).then(|| line.to_owned() + "\n");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        text.lines()
            .enumerate()
            .filter_map(hole)
            .collect::<String>(),
    )
    .unwrap();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --outage 90:130 -o out",
    );
    assert!(
        ran.stderr
            .contains("samples missing: 2.00 s before 62.00 s (line 6001)"),
        "{}",
        ran.stderr
    );
    assert!(
        ran.stderr
            .contains("outage 90:130 is cut at 101 s: the fixes end at 100 s"),
        "{}",
        ran.stderr
    );
}

/// One impossible sample of a gyroscope or an accelerometer is as good as missing: told with its line, and the solution is that of a
/// recording without it, to a hundredth of its deviation (one sample in ten thousand is bridged).
#[test]
fn a_glitch_is_taken_as_missing() {
    let place = recorded();
    let text = fs::read_to_string(place.path().join("rec/imu.csv")).unwrap();
    let fused = |imu: &str| {
        let command = format!("fuse {imu} rec/gnss.csv imu.toml --initial rec/initial.toml -o out");
        let ran = done(place.path(), &command);
        (
            ran,
            table(&place.path().join("out/solution.csv")).pop().unwrap(),
        )
    };
    let (_, sound) = fused("rec/imu.csv");
    for (column, value) in [(3, "30"), (1, "1e6"), (4, "-2e4")] {
        let spoiled = |(i, line): (usize, &str)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if i == 3500 {
                cells[column] = value;
            }
            cells.join(",") + "\n"
        };
        let spoiled: String = text.lines().enumerate().map(spoiled).collect();
        fs::write(place.path().join("glitch.csv"), spoiled).unwrap();
        let (ran, end) = fused("glitch.csv");
        let told = "samples that no motion explains: 1, the first at 35 s (line 3501)";
        assert!(ran.stderr.contains(told), "{}", ran.stderr);
        for i in 4..10 {
            assert!(
                (end[i] - sound[i]).abs() < 0.01 * sound[9 + i],
                "{value} {i}: {end:?}"
            );
        }
    }
}

/// A window before the filter starts withholds nothing; times are said to a hundredth of a second.
#[test]
fn a_window_before_the_start_is_no_outage() {
    let place = recorded();
    let path = place.path().join("rec/imu.csv");
    let later = |text: &str| shifted(0.000_000_000_000_04)(text);
    fs::write(&path, later(&fs::read_to_string(&path).unwrap())).unwrap();
    let ran = done(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv imu.toml --outage 1:3 --outage 60:75 -o out -v",
    );
    assert!(
        ran.stderr
            .contains("outage 1–3 s ends before the solution starts"),
        "{}",
        ran.stderr
    );
    assert!(
        !ran.stdout.contains("outage 1–3 s") && ran.stdout.contains("60–75 s"),
        "{}",
        ran.stdout
    );
    let long = |word: &str| {
        word.split('.')
            .nth(1)
            .is_some_and(|d| d.len() > 6 && d.parse::<u64>().is_ok())
    };
    for text in [&ran.stdout, &ran.stderr] {
        assert!(!text.split([' ', ':', ',']).any(long), "{text}");
    }
    let text = fs::read_to_string(place.path().join("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["outages"].as_array().unwrap().len(), 1);
}

/// What receivers and loggers write beside tables is told by its name, with what to do.
#[test]
fn files_of_other_kinds_are_named() {
    let four = |text: &str| {
        text.lines()
            .map(|l| l.split(',').take(4).collect::<Vec<_>>().join(",") + "\n")
            .collect()
    };
    refused(
        "rec/gnss.csv",
        four,
        "",
        &[
            "sd_n_m, sd_e_m, sd_d_m are missing",
            "hint: ",
            "--gnss-sigma",
        ],
    );
    let nmea =
        |_: &str| "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n".repeat(3);
    refused(
        "rec/gnss.csv",
        nmea,
        "",
        &[
            "gnss.csv, line 1: a fix without standard deviations",
            "--gnss-sigma",
        ],
    );
    let nmea =
        |_: &str| "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*48\n".repeat(3);
    refused(
        "rec/gnss.csv",
        nmea,
        "",
        &["gnss.csv, line 2: wrong checksum"],
    );
    let gpx = |_: &str| "<?xml version=\"1.0\"?>\n<gpx><trk/></gpx>\n".to_owned();
    refused(
        "rec/gnss.csv",
        gpx,
        "",
        &[
            "gnss.csv, line 1: XML such as GPX",
            "hint: write its points",
        ],
    );
    let increments = |text: &str| text.replacen("accel_x_m_s2", "dv_x_ft_s", 1);
    refused(
        "rec/imu.csv",
        increments,
        "",
        &["column \"dv_x_ft_s\" is in an unknown unit", "_m_s, _mps"],
    );
    let place = recorded();
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv imu.toml rec/gnss.csv -o out",
    );
    assert_eq!(ran.code, 2);
    let ran = nav_sim(
        place.path(),
        "fuse rec/imu.csv rec/gnss.csv rec/gnss.csv -o out",
    );
    assert!(
        ran.code == 2 && ran.stderr.contains("hint: it holds GNSS fixes"),
        "{}",
        ran.stderr
    );
}

/// The fixes as RTKLIB writes them, in weeks and in dates, give the solution of the table.
#[test]
fn a_solution_of_rtklib_is_read() {
    let place = recorded();
    let at = |name: &str| place.path().join(name);
    let gnss = table(&at("rec/gnss.csv"));
    let head = "% program   : RTKLIB\n%  GPST   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";
    let row = |r: &Vec<f64>, time: String| {
        format!(
            "{time} {:.10} {:.10} {:.4} 5 8 {} {} {} 0 0 0 0 0\n",
            r[1], r[2], r[3], r[4], r[5], r[6]
        )
    };
    // 2021-02-28 was a Sunday, on which GPS week 2147 began
    let date = |t: f64| {
        format!(
            "2021/02/28 {:02}:{:02}:{:06.3}",
            (t / 3600.0) as u32,
            (t / 60.0) as u32 % 60,
            t % 60.0
        )
    };
    let dated: String = gnss.iter().map(|r| row(r, date(r[0]))).collect();
    let weeks: String = gnss
        .iter()
        .map(|r| row(r, format!("2147 {:.3}", r[0])))
        .collect();
    fs::write(at("dated.pos"), head.to_owned() + &dated).unwrap();
    fs::write(at("weeks.pos"), head.to_owned() + &weeks).unwrap();
    let fixes = gnss.iter().map(|r| {
        format!(
            "{},{:.10},{:.10},{:.4},{},{},{}\n",
            r[0], r[1], r[2], r[3], r[4], r[5], r[6]
        )
    });
    let table_text: String = fixes.collect();
    fs::write(
        at("pos.csv"),
        "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m\n".to_owned() + &table_text,
    )
    .unwrap();
    let end = |file: &str| {
        let command = format!("fuse rec/imu.csv {file} imu.toml --initial rec/initial.toml -o out");
        let ran = done(place.path(), &command);
        (table(&at("out/solution.csv")).pop().unwrap(), ran.stderr)
    };
    let (plain, _) = end("pos.csv");
    for file in ["dated.pos", "weeks.pos"] {
        let (solution, said) = end(file);
        assert!(said.contains("in seconds of GPS week 2147"), "{said}");
        assert_eq!(plain, solution, "{file}");
    }
}
