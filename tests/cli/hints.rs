//! Hints, followed to the letter: each bad input is refused with a hint, what it says is done, and the command ends with 0.

use crate::common::drive::*;
use std::fmt::Write;
use std::fs;

/// What is done to the contents of the file and the options of the command.
type Follow = fn(hint: &str, text: &mut String, options: &mut String);

/// Numbers about 0 within ±0.001.
fn noise(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state >> 8) / f64::from(1 << 24) - 0.5) * 2e-3
    }
}

/// A header and 200 rows; `row` has the number of the row and a source of noise.
fn table(header: &str, row: impl Fn(usize, &mut dyn FnMut() -> f64) -> String) -> String {
    let mut next = noise(1);
    let rows = (0..200).map(|k| row(k, &mut next) + "\n");
    let header = match header {
        "" => String::new(),
        _ => format!("{header}\n"),
    };
    header + &rows.collect::<String>()
}

/// Time at 100 Hz and so many columns of noise.
fn sound(header: &str, columns: usize) -> String {
    table(header, |k, next| {
        let mut row = format!("{:.2}", 0.01 * k as f64);
        (0..columns).for_each(|_| write!(row, ",{:.7}", next()).unwrap());
        row
    })
}

fn rename(text: &mut String, from: &str, to: &str) {
    assert!(text.contains(from), "{from}");
    *text = text.replacen(from, to, 1);
}

/// An option that the hint names with a value, up to a blank or the end of the clause.
fn option(hint: &str, name: &str) -> String {
    let value = hint.split(&format!("{name} ")).nth(1).unwrap_or_default();
    let value = value.split([' ', ';', '\n']).next().unwrap();
    format!(" {name} {}", value.trim_end_matches(','))
}

/// Runs the command, follows one hint after the other, and is at the end of them with exit code 0.
fn followed(place: &std::path::Path, command: &str, file: &str, text: &str, steps: &[Follow]) {
    let (mut text, mut options) = (text.to_owned(), String::new());
    for (step, follow) in steps.iter().enumerate() {
        fs::write(place.join(file), &text).unwrap();
        let ran = nav_sim(place, &format!("{command}{options}"));
        let hint = ran.stderr.split("\nhint: ").nth(1).unwrap_or_default();
        assert!(
            ran.code == 2 && !hint.is_empty(),
            "step {step} of {command}{options}: {}",
            ran.stderr
        );
        follow(hint, &mut text, &mut options);
    }
    fs::write(place.join(file), &text).unwrap();
    let ran = nav_sim(place, &format!("{command}{options}"));
    assert_eq!(ran.code, 0, "{command}{options}: {}", ran.stderr);
}

#[test]
fn hints_on_recordings_work() {
    let place = tempfile::tempdir().unwrap();
    let in_file = |file: &str, text: &str, steps: &[Follow]| {
        followed(place.path(), &format!("wv {file} -q"), file, text, steps);
    };
    let ends: Follow = |hint, text, _| {
        assert!(hint.contains("end its name in one of _rad_s"), "{hint}");
        rename(text, "GyrX", "GyrX_rad_s");
    };
    in_file("a.csv", &sound("t_s,GyrX", 1), &[ends]);

    // a counter of Xsens, whose unit depends on what wrote it
    let dot = table("SampleTimeFine,Gyr_X,", |k, next| {
        format!("{},{:.6}, ", 677_583_000 + 10_000 * k, next())
    });
    in_file(
        "a.csv",
        &dot,
        &[
            |hint, text, _| {
                assert!(hint.contains("_us"), "{hint}");
                rename(text, "SampleTimeFine", "SampleTimeFine_us");
            },
            |hint, text, _| {
                assert!(hint.contains("_deg_s"), "{hint}");
                rename(text, "Gyr_X", "Gyr_X_deg_s");
            },
        ],
    );
    let of_three: [Follow; 3] = [
        |_, text, _| rename(text, ",x,", ",x_rad_s,"),
        |_, text, _| rename(text, ",y,", ",y_rad_s,"),
        |_, text, _| rename(text, ",z\n", ",z_rad_s\n"),
    ];
    in_file("my_gyro.csv", &sound("t_s,x,y,z", 3), &of_three);
    in_file(
        "a.csv",
        &sound("t_s,accel_x_ft_s2", 1),
        &[|hint, text, _| {
            assert!(hint.contains("end accel_x in one of _m_s2"), "{hint}");
            rename(text, "accel_x_ft_s2", "accel_x_m_s2");
        }],
    );

    let columns: Follow = |hint, _, options| *options += &option(hint, "--columns");
    in_file("a.csv", &sound("", 6), &[columns]);
    let rate: Follow = |hint, _, options| {
        assert!(hint.contains("--rate-hz"), "{hint}");
        *options += " --rate-hz 100";
    };
    let untimed = table("gyro_x_rad_s", |_, next| format!("{:.6}", next()));
    in_file("a.csv", &untimed, &[rate]);
    let sentences = table("", |_, next| {
        format!(
            "$VNIMU,0,0,0,{:.6},0.1,-9.8,{:.6},{:.6},{:.6},20,84*00",
            next(),
            next(),
            next(),
            next()
        )
    });
    in_file(
        "a.txt",
        &sentences.replace("0.1,-9.8", "0.1,-9.80"),
        &[rate, |hint, _, options| {
            assert!(hint.contains("--axes"), "{hint}");
            *options += " --axes accel.x,gyro";
        }],
    );

    let gap = table("t_s,gyro_x_rad_s", |k, next| {
        format!("{:.2},{:.6}", 0.01 * (k + 100 * (k / 100)) as f64, next())
    });
    // a third and two thirds lost in a block, a third at random; where it is refused, and as it is by default
    let gaps: Follow = |hint, _, options| *options = option(hint, "--gaps");
    in_file("a.csv", &gap, &[]);
    let random = |share: u32| {
        let mut state = 1_u32;
        let mut lost = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % 100 < share
        };
        let mut lines = Vec::new();
        for line in gap_free().lines() {
            if lines.is_empty() || !lost() {
                lines.push(line.to_owned() + "\n");
            }
        }
        lines.concat()
    };
    in_file("a.csv", &random(30), &[]);
    for text in [&gap, &random(30)] {
        fs::write(place.path().join("a.csv"), text).unwrap();
        let ran = nav_sim(place.path(), "wv a.csv -q --gaps refuse");
        assert_eq!(ran.code, 2);
        let hint = ran.stderr.split("\nhint: ").nth(1).unwrap();
        let followed = nav_sim(
            place.path(),
            &format!("wv a.csv -q{}", option(hint, "--gaps")),
        );
        assert_eq!(followed.code, 0, "{}", followed.stderr);
    }
    let long = gap.replace("\n2.", "\n42.");
    in_file("a.csv", &long, &[gaps]);
    // where no value of --gaps helps, none is named, by commands without that option too
    fs::write(place.path().join("a.csv"), random(60)).unwrap();
    for command in ["wv a.csv -q", "check a.csv"] {
        let ran = nav_sim(place.path(), command);
        assert!(
            ran.code == 2
                && ran.stderr.contains("hint: record again")
                && !ran.stderr.contains("--gaps"),
            "{}",
            ran.stderr
        );
    }

    // lines before the header that look like rows
    in_file(
        "a.csv",
        &format!("Firmware 1,2,3\n2024,5,1\n{}", sound("t_s,gyro_x_rad_s", 1)),
        &[],
    );
    let both = table("t_s,gyro_x_rad_s", |k, next| {
        format!("{:.2},{:.7}", 0.01 * k as f64, next()).replace('.', ",")
    });
    in_file(
        "a.csv",
        &both,
        &[|hint, text, _| {
            assert!(hint.contains("separate cells with semicolons"), "{hint}");
            let cells = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
                [a, b, c, d] => format!("{a},{b};{c},{d}\n"),
                _ => line.replace(',', ";") + "\n",
            };
            *text = text.lines().map(cells).collect();
        }],
    );
    let coarse = table("t_s,gyro_x_rad_s", |k, next| {
        format!("{:.2},{:.6}", 0.03 * (k / 3) as f64, next())
    });
    in_file(
        "a.csv",
        &coarse,
        &[|hint, _, options| *options += &option(hint, "--gaps")],
    );
    in_file(
        "a.csv",
        &sound("t_s,gyro_x_rad_s,gx_dps", 2),
        &[|hint, text, _| {
            assert!(hint.contains("give one of them"), "{hint}");
            rename(text, "gx_dps", "other");
        }],
    );
    let in_g = table("t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2", |k, next| {
        let (t_s, x, y, z) = (0.01 * k as f64, next(), next(), 1.0 + next());
        format!("{t_s:.2},{x:.6},{y:.6},{z:.6}")
    });
    in_file(
        "a.csv",
        &in_g,
        &[|hint, text, _| {
            assert!(hint.contains("accel_x_g"), "{hint}");
            *text = text.replace("_m_s2", "_g");
        }],
    );
    let line: Follow = |hint, text, _| {
        assert!(hint.contains("remove the line"), "{hint}");
        let sound = |line: &&str| !line.ends_with(",abc");
        *text = text
            .lines()
            .filter(sound)
            .map(|l| format!("{l}\n"))
            .collect();
    };
    let bad = sound("t_s,gyro_x_rad_s", 1) + "2.00,abc\n2.00,0.001\n";
    in_file("a.csv", &bad, &[line]);
    let open = sound("t_s,gyro_x_rad_s,note", 1).replacen("0.50,", "0.50,\"", 1);
    in_file(
        "a.csv",
        &open.replace('\n', ",a\n").replacen(",a\n", "\n", 1),
        &[|hint, text, _| {
            assert!(hint.contains("remove it"), "{hint}");
            *text = text.replace('"', "");
        }],
    );
    let comma = table("t_s,gyro_x_rad_s", |k, next| {
        format!("\"{},{:02}\",{:.6}", k / 100, k % 100, next())
    });
    in_file(
        "a.csv",
        &comma,
        &[|hint, text, _| {
            assert!(hint.contains("0.5, not 0,5"), "{hint}");
            for second in ["0", "1"] {
                *text = text.replace(&format!("\"{second},"), &format!("\"{second}."));
            }
        }],
    );
    let back = sound("t_s,gyro_x_rad_s", 1);
    let (head, rows) = back.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().rev().collect();
    let back = format!("{head}\n{}\n", rows.join("\n"));
    in_file(
        "a.csv",
        &back,
        &[|hint, text, _| {
            assert!(hint.starts_with("sort the rows by time"), "{hint}");
            let (head, rows) = text.split_once('\n').unwrap();
            let mut rows: Vec<&str> = rows.lines().collect();
            rows.sort_unstable();
            *text = format!("{head}\n{}\n", rows.join("\n"));
        }],
    );
}

/// A second and more at 100 Hz.
fn gap_free() -> String {
    sound("t_s,gyro_x_rad_s", 1)
}

/// One sentence for one fault, whatever command reads the recording.
#[test]
fn commands_say_the_same_of_one_recording() {
    let place = tempfile::tempdir().unwrap();
    let rows = table("t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s", |k, next| {
        let (x, z) = (next(), next());
        format!("{:.2},{x:.7},{x:.7},{z:.7}", 0.01 * k as f64)
    });
    fs::write(place.path().join("a.csv"), rows).unwrap();
    let said = |command: &str| -> Vec<String> {
        let ran = nav_sim(place.path(), command);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let warnings = ran
            .stderr
            .lines()
            .filter(|line| line.starts_with("warning: a.csv"));
        warnings.map(str::to_owned).collect()
    };
    let text = "warning: a.csv: gyro.y repeats gyro.x: one axis was written twice";
    for command in [
        "wv a.csv",
        "check a.csv",
        "calibrate a.csv --estimator gmwm --model WN --bootstrap 0 --seed 1 -o m.toml",
    ] {
        assert_eq!(said(command), [text], "{command}");
    }
}

/// A file in the place of another: what it is, and what takes it.
#[test]
fn files_of_another_kind_are_named() {
    let place = place_with(DRIVE, MODEL);
    let place = place.path();
    fs::write(place.join("a.csv"), sound("t_s,gyro_x_rad_s", 1)).unwrap();
    let six = "t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s";
    let rows = table(six, |k, next| {
        let [x, y, a, b, c] = [0; 5].map(|_| next());
        format!(
            "{:.2},{x:.7},{y:.7},-9.8,{a:.7},{b:.7},{c:.7}",
            0.01 * k as f64
        )
    });
    fs::write(place.join("i.csv"), rows).unwrap();
    let fixes = "t_s,lat_deg,lon_deg,h_m,sd_n_m,sd_e_m,sd_d_m\n".to_owned()
        + &(0..5)
            .map(|t_s| format!("{t_s},46,6,400,1,1,2\n"))
            .collect::<String>();
    fs::write(place.join("g.csv"), fixes).unwrap();
    for (command, kind) in [
        ("wv imu.toml", "a noise model: run, fuse"),
        ("calibrate imu.toml", "a noise model"),
        (
            "export a.csv --target kalibr",
            "a recording of an IMU: wv, calibrate and fuse",
        ),
        ("run drive.toml a.csv", "a recording of an IMU: wv"),
        (
            "synthesize drive.toml --samples 99 -o s",
            "a trajectory: run",
        ),
        ("wv g.csv", "GNSS fixes: second file of fuse"),
        ("fuse g.csv a.csv imu.toml -o f", "GNSS fixes"),
        ("batch imu.toml -o b", "a noise model"),
        (
            "run drive.toml imu.toml --scenario imu.toml",
            "a noise model",
        ),
        ("calibrate --curve imu.toml", "a noise model"),
        ("calibrate --curve a.csv", "a recording of an IMU"),
        (
            "tune drive.toml --truth imu.toml",
            "a trajectory: run takes it, and --trajectory",
        ),
        (
            "tune imu.toml drive.toml",
            "a trajectory: run takes it, and --trajectory",
        ),
        (
            "tune imu.toml --truth imu.toml --trajectory imu.toml",
            "a noise model",
        ),
        ("run a.csv imu.toml", "a recording of an IMU"),
        ("fuse i.csv i.csv imu.toml -o f", "a recording of an IMU"),
        (
            "fuse i.csv g.csv imu.toml --initial imu.toml -o f",
            "a noise model",
        ),
        (
            "fuse i.csv g.csv imu.toml --odometer g.csv -o f",
            "GNSS fixes",
        ),
        (
            "judge g.csv --reference a.csv -o j",
            "a recording of an IMU",
        ),
        (
            "judge g.csv --reference g.csv --covariance a.csv -o j",
            "a recording of an IMU",
        ),
        (
            "synthesize imu.toml --contaminate drive.toml -o s",
            "a trajectory",
        ),
        ("datasheet --from imu.toml -o d.toml", "a noise model"),
        ("inspect imu.toml", "a noise model"),
        ("design a.csv", "a recording of an IMU"),
    ] {
        let ran = nav_sim(place, command);
        let hint = ran.stderr.split("\nhint: ").nth(1).unwrap_or_default();
        assert!(
            ran.code == 2 && hint.contains(kind),
            "{command}: {}",
            ran.stderr
        );
    }
    // a file that is not there is wrong input, whatever reads it
    for command in [
        "run none drive.toml",
        "fuse none g.csv imu.toml",
        "calibrate none",
        "compare imu.toml none",
        "inspect none",
        "judge g.csv --reference none",
        "datasheet --from none",
    ] {
        let ran = nav_sim(place, command);
        let expected = "error: none: No such file or directory\n\nhint: check the path";
        assert!(
            ran.code == 2 && ran.stderr.starts_with(expected),
            "{command}: {}",
            ran.stderr
        );
    }
    // a decimal comma in TOML
    let model = fs::read_to_string(place.join("imu.toml")).unwrap();
    let comma = model.replacen("rate_hz = 100.0", "rate_hz = 100,0", 1);
    followed(
        place,
        "check m.toml",
        "m.toml",
        &comma,
        &[|hint, text, _| {
            assert!(hint.contains("write decimals with a point"), "{hint}");
            rename(text, "100,0", "100.0");
        }],
    );
}

/// Files as the commands write them that hints on other formats name.
#[test]
fn conversions_that_hints_name_are_read() {
    let place = tempfile::tempdir().unwrap();
    let run = |command: &str| nav_sim(place.path(), command);
    let write = |file: &str, text: &str| fs::write(place.path().join(file), text).unwrap();
    let hint = |file: &str, head: &[u8]| {
        fs::write(place.path().join(file), head).unwrap();
        let ran = run(&format!("wv {file}"));
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        ran.stderr.split("\nhint: ").nth(1).unwrap().to_owned()
    };
    let ardupilot = hint("a.bin", b"\xa3\x95\x80\x80");
    assert!(ardupilot.contains("mavlogdump.py --format csv --types IMU"));
    // the second IMU, ten times noisier, has rows of its own
    let header = "timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,ErrG,ErrA,Temp,GyHlt,AcHlt";
    let rows = table(header, |k, next| {
        let us = 10_200_000 + 40_000 * k;
        let t_s = us as f64 * 1e-6;
        let rows = [(0, 1.0), (1, 10.0)].map(|(instance, times)| {
            let [x, y, z] = [0; 3].map(|_| times * next());
            let down = z - 9.8;
            format!(
                "{t_s:.3},{us},{instance},{x:.6},{y:.6},{z:.6},{y:.6},{x:.6},{down:.6},0,0,0.0,1,1"
            )
        });
        rows.join("\n")
    });
    write("imu.csv", &rows);
    let ran = run("wv imu.csv --format json");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("25 Hz") && ran.stderr.contains("with I = 0"),
        "{}",
        ran.stderr
    );
    // numbers within ±0.001 have a variance of 1e-6/3, of which the first scale has half
    let json: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let first = &json["signals"][3]["classical"]["wv"][0];
    assert!(first.as_f64().unwrap() < 3e-7, "{first}");
    assert_eq!(json["signals"][3]["samples"], 200);

    let matlab = hint("a.mat", b"MATLAB 5.0 MAT-file");
    assert!(matlab.contains("writematrix(imu, 'imu.csv')") && matlab.contains("--columns"));
    let columns =
        "t_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s";
    let rows = table("", |k, next| {
        let accel = format!("{:.5},{:.5},{:.5}", next(), next(), next() - 9.8);
        let gyro = format!("{:.6},{:.6},{:.6}", next(), next(), next());
        format!("{:.2},{accel},{gyro}", 0.01 * k as f64)
    });
    write("imu.csv", &rows);
    for command in ["wv", "calibrate --model WN --bootstrap 0 -o m.toml"] {
        let ran = run(&format!("{command} imu.csv --columns {columns}"));
        assert_eq!(ran.code, 0, "{}", ran.stderr);
    }

    let septentrio = hint("a.sbf", b"$@\0\0");
    assert!(septentrio.contains("bin2asc -f FILE.sbf -m PVTGeodetic2 -t"));
    let header = "TOW [0.001 s],WNc [w],Mode,Error,Latitude [rad],Longitude [rad],Height [m],Undulation [m],\
                  Vn [m/s],Ve [m/s],Vu [m/s],COG [deg]";
    let rows = table(header, |k, _| {
        let (tow, lat) = (345_600_000 + 1000 * k, 0.88 + 1e-7 * k as f64);
        format!("{tow},2200,4,0,{lat:.9},0.08,60.0,47.1,0.6,0.01,0.25,90.0")
    });
    write("PVTGeodetic2.txt", &rows);
    let ran = run("check PVTGeodetic2.txt");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("200 GNSS fixes"), "{}", ran.stdout);

    // first bytes of text that is no table
    for (head, name) in [
        (
            "%RAWIMUSA,2387,361705.000;2387,361704.9,00000077,1,1,1,1,1,1*c01b540c\n",
            "a NovAtel log",
        ),
        (
            "#BESTPOSA,COM1,0,55.0,FINESTEERING,1419,340033.000;SOL_COMPUTED*6f\n",
            "a NovAtel log",
        ),
        (
            "$PASHR,123519,1.0,T,0.1,0.2,0.3,0.01,0.01,0.01,1,1*3B\n",
            "sentences ($PASHR)",
        ),
        (
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
            "a Git LFS pointer",
        ),
    ] {
        for file in ["a.csv", "a.npz", "a.mcap", "a.npy"] {
            write(file, head);
            let ran = run(&format!("wv {file}"));
            let is_text = file != "a.npy" || name.contains("NovAtel") || name.contains("LFS");
            assert!(
                ran.code == 2 && (!is_text || ran.stderr.contains(name)),
                "{}",
                ran.stderr
            );
        }
    }
    for command in [
        "run a.toml a.toml",
        "fuse a.csv a.csv a.toml",
        "inspect a.csv",
        "check a.toml",
    ] {
        write(
            "a.toml",
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
        );
        write(
            "a.csv",
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
        );
        let ran = run(command);
        assert!(
            ran.code == 2 && ran.stderr.contains("hint: fetch it: git lfs pull"),
            "{}",
            ran.stderr
        );
    }
}

/// Commands that plan: what their hints name is done by other options.
#[test]
fn hints_on_plans_work() {
    let place = place_with(DRIVE, MODEL);
    let place = place.path();
    let write = |file: &str, text: &str| fs::write(place.join(file), text).unwrap();
    write("truth.toml", &MODEL.replace("2e-6", "4e-6"));
    // the command, its hint, and the command that follows it
    let cases = [
        (
            "require drive.toml --outage 20",
            "give one, such as --require 'p95_m<=5'",
            "require drive.toml --outage 20 --require p95_m<=5",
        ),
        (
            "require drive.toml --outage 900 --require p95_m<=9",
            "a shorter --outage",
            "require drive.toml --outage 20 --require p95_m<=9",
        ),
        (
            "require drive.toml --outage 20 --start 55 --require p95_m<=9",
            "an earlier --start",
            "require drive.toml --outage 20 --start 30 --require p95_m<=9",
        ),
        (
            "require drive.toml --outage 20 --require p95_m<=1e-4",
            "a larger limit",
            "require drive.toml --outage 20 --require p95_m<=20",
        ),
        (
            "require drive.toml --outage 20 --require p95_m<=9 --catalogue none",
            "--catalogue alone ranks",
            "require drive.toml --outage 20 --require p95_m<=9 --catalogue",
        ),
        (
            "tune imu.toml --trajectory drive.toml --outage 20:40 -o t.toml",
            "give models (--truth OTHER.toml",
            "tune imu.toml --trajectory drive.toml --outage 20:40 --truth truth.toml -o t.toml",
        ),
        (
            "tune imu.toml --trajectory drive.toml --outage 90:99 --truth truth.toml -o t.toml",
            "begin it between 0 and 60 s",
            "tune imu.toml --trajectory drive.toml --outage 40:99 --truth truth.toml -o t.toml",
        ),
        (
            "synthesize imu.toml --samples 99 --contaminate section5-IIII -o s",
            "did you mean \"section5-III\"?",
            "synthesize imu.toml --samples 99 --contaminate section5-III -o s",
        ),
        (
            "synthesize imu.toml --samples 99 --contaminate none -o s",
            "give a file or one of section4-I, ",
            "synthesize imu.toml --samples 99 --contaminate section4-II -o s",
        ),
        (
            "export imu.toml --target kalib -o k.yaml",
            "a similar value exists: 'kalibr'",
            "export imu.toml --target kalibr -o k.yaml",
        ),
    ];
    for (command, words, follows) in cases {
        let ran = nav_sim(place, command);
        let hint = ran.stderr.split("\nhint: ").nth(1).unwrap_or_default();
        assert!(
            ran.code == 2 && hint.contains(words),
            "{command}: {}",
            ran.stderr
        );
        let ran = nav_sim(place, follows);
        assert_eq!(ran.code, 0, "{follows}: {}", ran.stderr);
    }
}

#[test]
fn hints_on_drives_work() {
    let place = place_with(DRIVE, MODEL);
    let place = place.path();
    done(
        place,
        "trajectory record drive.toml imu.toml --seed 3 -o rec",
    );
    let gnss = fs::read_to_string(place.join("rec/gnss.csv")).unwrap();
    let command = "fuse rec/imu.csv g.csv imu.toml -q -o out";
    // the first columns: time and place
    let cells = |count: usize| {
        let first = |line: &str| line.split(',').take(count).collect::<Vec<_>>().join(",") + "\n";
        gnss.lines().map(first).collect::<String>()
    };
    let sigma: Follow = |hint, _, options| *options += &option(hint, "--gnss-sigma");
    let initial: Follow = |hint, _, options| {
        assert!(hint.contains("all with --initial FILE"), "{hint}");
        *options += " --initial rec/initial.toml";
    };
    followed(place, command, "g.csv", &cells(4), &[sigma, initial]);
    let mut rows: Vec<&str> = gnss.lines().collect();
    rows[1..].reverse();
    let sorted: Follow = |hint, text, _| {
        assert!(hint.starts_with("sort the rows by time"), "{hint}");
        let mut rows: Vec<&str> = text.lines().collect();
        rows[1..].reverse();
        *text = rows.join("\n");
    };
    followed(place, command, "g.csv", &rows.join("\n"), &[sorted]);
    let weeks = |line: &str| match line.split_once(',').unwrap() {
        (t_s, rest) if t_s.parse::<f64>().is_ok() => {
            format!("{},{rest}\n", t_s.parse::<f64>().unwrap() + 604_800.0)
        }
        _ => format!("{line}\n"),
    };
    let later = gnss.lines().map(weeks).collect::<String>();
    let delay: Follow = |hint, _, options| *options = format!(" {}", hint.trim());
    let ran = {
        fs::write(place.join("g.csv"), &later).unwrap();
        nav_sim(place, command)
    };
    // turns tell it, or the hint does
    if ran.code != 0 {
        followed(place, command, "g.csv", &later, &[delay]);
    }

    // times in milliseconds under the name of seconds, and a column misspelt
    let ms = |line: &str| match line.split_once(',').unwrap() {
        (t_s, rest) if t_s.parse::<f64>().is_ok() => {
            format!("{},{rest}\n", 1e3 * t_s.parse::<f64>().unwrap())
        }
        _ => format!("{line}\n"),
    };
    let unit: Follow = |hint, text, _| {
        assert!(hint.starts_with("name the column t_ms"), "{hint}");
        rename(text, "t_s,", "t_ms,");
    };
    followed(
        place,
        command,
        "g.csv",
        &gnss.lines().map(ms).collect::<String>(),
        &[unit],
    );
    let imu = fs::read_to_string(place.join("rec/imu.csv")).unwrap();
    let command = "fuse i.csv rec/gnss.csv imu.toml -q -o out";
    followed(
        place,
        command,
        "i.csv",
        &imu.lines().map(ms).collect::<String>(),
        &[unit],
    );
    let slip: Follow = |hint, text, _| {
        assert!(hint.contains("did you mean \"accel_z_m_s2\"?"), "{hint}");
        rename(text, "acel_z_m_s2", "accel_z_m_s2");
    };
    let misspelt = imu.replacen("accel_z", "acel_z", 1);
    followed(place, command, "i.csv", &misspelt, &[slip]);

    let initial = fs::read_to_string(place.join("rec/initial.toml")).unwrap();
    let command = "fuse rec/imu.csv rec/gnss.csv imu.toml -q -o out --initial i.toml";
    let up: Follow = |hint, text, _| {
        assert!(
            hint.contains("down is positive: v_d_m_s, of the other sign"),
            "{hint}"
        );
        rename(text, "v_u_m_s = ", "v_d_m_s = -");
    };
    let initial: String = initial
        .lines()
        .filter(|line| !line.starts_with("v_d_m_s"))
        .map(|line| format!("{line}\n"))
        .collect();
    followed(
        place,
        command,
        "i.toml",
        &format!("v_u_m_s = 0.0\n{initial}"),
        &[up],
    );

    let local = "t_s,n_m,e_m,d_m,roll,pitch,yaw\n";
    let rows = (0..40).map(|k| format!("{k},{},0,0,0.01,0.02,0.5\n", 5 * k));
    let local = local.to_owned() + &rows.collect::<String>();
    let steps: [Follow; 2] = [
        |hint, text, _| {
            assert!(hint.contains("end the names in _deg or _rad"), "{hint}");
            rename(text, "roll,pitch,yaw", "roll_rad,pitch_rad,yaw_rad");
        },
        |hint, text, _| {
            assert!(
                hint.contains("\"# origin: LAT_DEG, LON_DEG, H_M\""),
                "{hint}"
            );
            *text = format!("# origin: 46.5, 6.5, 400\n{text}");
        },
    ];
    followed(
        place,
        "run p.csv imu.toml --outage none --runs 2 --seed 1 -q",
        "p.csv",
        &local,
        &steps,
    );
}
