//! The clock of a recording: gaps, rates, units.

use super::*;

#[test]
fn time_is_checked() {
    assert_eq!(
        refusal(changed(7, "0.03,1")),
        "a.csv, line 7: time goes back from 0.04 s to 0.03 s"
    );
    assert_eq!(
        refusal(changed(7, "0.04,1")),
        "a.csv, line 7: duplicate in time: 0.04 s to 0.04 s, the median step is 0.01 s (2 such steps in all)"
    );
    let gap: String = sound(20)
        .into_iter()
        .enumerate()
        .filter(|(i, _)| *i != 10)
        .map(|(_, l)| l + "\n")
        .collect();
    assert_eq!(
        refusal(&gap),
        "a.csv, line 11: gap in time from 0.08 s to 0.1 s, the median step is 0.01 s"
    );
    assert_eq!(
        refusal("t_s,gyro_x_rad_s\n1,1\n1,2\n1,3\n"),
        "a.csv: column \"t_s\" does not advance: its median step is 0"
    );

    let with = |gaps| ReadOptions {
        gaps,
        ..ReadOptions::default()
    };
    let (_files, path) = Files::with("a.csv", &gap);
    let (split, report) = read(std::slice::from_ref(&path), &with(Gaps::Split)).unwrap();
    assert_eq!(
        split.iter().map(Recording::len).collect::<Vec<_>>(),
        [9, 10]
    );
    assert!(
        report.files[0].warnings[0]
            .contains("split at 1 gaps or duplicates in time, the first in line 11")
    );
    // Ignored, a lost sample leaves the rate of the others.
    let (whole, report) = read(&[path], &with(Gaps::Ignore)).unwrap();
    assert_eq!((whole.len(), whole[0].len()), (1, 19));
    assert_close(&[whole[0].rate_hz], &[100.0]);
    let warning = &report.files[0].warnings[0];
    assert!(
        warning.contains("1 gaps or duplicates in time ignored, the first in line 11"),
        "{warning}"
    );
}

/// 2000 rows at 100 Hz before as many at 149 Hz, and 7000 of 10 ms before 8000 of 20 ms (half the median step is no gap); of a
/// clock that is 0.5 % faster in the end, and of steps that jitter by 40 %, nothing is said.
#[test]
fn a_rate_that_changes_is_refused() {
    let times = |steps: &dyn Fn(usize) -> f64, n: usize| {
        let stamps: Vec<f64> = (0..n)
            .scan(0.0, |at, k| {
                *at += steps(k);
                Some(*at)
            })
            .collect();
        stamped("t_s", n, |k| format!("{:.6}", stamps[k]))
    };
    let faster = times(&|k| if k < 2000 { 0.01 } else { 1.0 / 149.0 }, 4000);
    let (message, hint) = refusal_with("a.csv", &faster, &ReadOptions::default());
    assert_eq!(
        message,
        "a.csv: the rate changes from 100 Hz in the first tenth to 149 Hz in the last"
    );
    assert!(hint.contains("split the file"), "{hint}");
    let slower = times(&|k| if k < 7000 { 0.01 } else { 0.02 }, 15_000);
    assert!(
        refusal_with("a.csv", &slower, &ReadOptions::default())
            .0
            .contains("from 100 Hz")
    );
    for steps in [
        &(|k: usize| 0.01 * (1.0 - 0.005 * k as f64 / 4000.0)) as &dyn Fn(usize) -> f64,
        &|k: usize| 0.01 * (1.0 + 0.4 * (k as f64 * 2.4).sin()),
    ] {
        assert!(read_one("a.csv", times(steps, 4000), &ReadOptions::default()).is_ok());
    }
}

/// 40 of 2000 samples lost, never two in turn: the rate is that of the samples, whatever is made of the gaps.
#[test]
fn lost_samples_do_not_change_the_rate() {
    let kept: Vec<usize> = (0..2000).filter(|k| k % 50 != 25).collect();
    let text = stamped("t_s", kept.len(), |i| {
        format!("{:.2}", 0.01 * kept[i] as f64)
    });
    let r = read_one(
        "a.csv",
        &text,
        &ReadOptions {
            gaps: Gaps::Ignore,
            ..ReadOptions::default()
        },
    )
    .unwrap();
    assert!((r.rate_hz / 100.0 - 1.0).abs() < 1e-6, "{}", r.rate_hz);
}

#[test]
fn rates() {
    let text = sound(20).join("\n");
    let given = |rate_hz| ReadOptions {
        rate_hz: Some(rate_hz),
        ..ReadOptions::default()
    };
    assert_eq!(
        refusal_with("a.csv", &text, &given(200.0)).0,
        "a.csv: the time column runs at 100 Hz, but 200 Hz is given"
    );
    let stated = "// Update Rate: 50.0Hz\ngyr_X\n0.1\n0.2\n0.4\n";
    assert_eq!(
        refusal_with("a.txt", stated, &given(25.0)).0,
        "a.txt: the head of the file says 50 Hz, but 25 Hz is given"
    );
    let (_files, path) = Files::with("a.txt", stated);
    let (rounded, _) = read(&[path], &given(50.2)).unwrap();
    assert_close(&[rounded[0].rate_hz], &[50.2]);
    assert_eq!(
        refusal_with("a.csv", &text, &given(-1.0)).0,
        "a.csv: -1 Hz is not a sample rate"
    );
    assert_eq!(
        refusal("gyro_x_rad_s\n1\n2\n"),
        "a.csv: no time column, and no rate given"
    );
    // Stamps rounded to 1 ms at 128 Hz: the span knows the rate, no single step does.
    let rounded: String = (0..1000)
        .map(|k| format!("{:.3},{}\n", k as f64 / 128.0, k % 3))
        .collect();
    let r = read_one(
        "a.csv",
        format!("t_s,gyro_x_rad_s\n{rounded}"),
        &ReadOptions::default(),
    )
    .unwrap();
    assert!((r.rate_hz - 128.0).abs() < 0.01, "{}", r.rate_hz);

    let files = Files::new();
    files.add("a.csv", &text);
    files.add("b.csv", text.replace("t_s", "t_ms"));
    let message = read(&[files.path()], &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.ends_with(&format!(
            "b.csv has 100000 Hz, but {}/a.csv has 100 Hz",
            files.path().display()
        )),
        "{message}"
    );
}

/// A recording of `n` rows with such stamps.
fn stamped(name: &str, n: usize, stamp: impl Fn(usize) -> String) -> String {
    let rows = (0..n).map(|k| format!("{},{}\n", stamp(k), (k * k % 1009 % 7) as f64 * 1e-3));
    format!("{name},gyro_x_rad_s\n{}", rows.collect::<String>())
}

/// Stamps that are late by less than `late` leave the span right to that: the rate, to `late/span`.
#[test]
fn coarse_and_bursting_stamps_keep_the_rate_of_the_whole() {
    const N: usize = 3001;
    let ignore = |rate_hz| ReadOptions {
        gaps: Gaps::Ignore,
        rate_hz,
        ..ReadOptions::default()
    };
    let cases: [(f64, f64, String); 4] = [
        (
            200.0,
            0.01,
            stamped("t_s", N, |k| format!("{:.2}", k as f64 / 200.0)),
        ),
        (
            1000.0 / 1.2,
            1e-3,
            stamped("t_ms", N, |k| format!("{}", (1.2 * k as f64).floor())),
        ),
        (
            100.0,
            0.03,
            stamped("t_s", N, |k| {
                format!("{:.4}", 0.03 * (k / 3) as f64 + 1e-4 * (k % 3) as f64)
            }),
        ),
        (
            200.0,
            1.0 / 64.0,
            stamped("t_s", N, |k| {
                format!("{}", (k as f64 / 200.0 * 64.0).floor() / 64.0)
            }),
        ),
    ];
    for (rate_hz, late_s, text) in cases {
        let bound = late_s * rate_hz / (N - 1) as f64;
        let r = read_one("a.csv", &text, &ignore(None)).unwrap();
        assert!(
            (r.rate_hz / rate_hz - 1.0).abs() <= bound,
            "{} Hz, expected {rate_hz} Hz",
            r.rate_hz
        );
        let r = read_one("a.csv", &text, &ignore(Some(rate_hz))).unwrap();
        assert_close(&[r.rate_hz], &[rate_hz]);
        let (_, hint) = refusal_with("a.csv", &text, &ReadOptions::default());
        assert!(hint.contains("--gaps ignore"), "{hint}");
    }
}

#[test]
fn a_unit_that_is_not_said_is_told_by_the_step() {
    let outcome = |name: &str, step: f64, first: f64, rate_hz: Option<f64>| {
        let text = stamped(name, 100, |k| format!("{}", first + step * k as f64));
        let (_files, path) = Files::with("a.csv", text);
        let options = ReadOptions {
            rate_hz,
            ..ReadOptions::default()
        };
        let (recordings, report) = read(&[path], &options).unwrap();
        (recordings[0].rate_hz, report.files[0].warnings.join("\n"))
    };
    for (step, guessed) in [(1.0, 1000.0), (50.0, 20.0), (200.0, 5000.0)] {
        let (rate_hz, warning) = outcome("time", step, 0.0, None);
        assert_close(&[rate_hz], &[guessed]);
        assert_eq!(warning, "");
        let (rate_hz, warning) = outcome("time", step, 0.0, Some(guessed));
        assert_close(&[rate_hz], &[guessed]);
        assert_eq!(warning, "");
    }
    let (rate_hz, warning) = outcome("time", 99.0, 0.0, None);
    assert_close(&[rate_hz], &[1e3 / 99.0]);
    assert_eq!(warning, "");
    // No doubt: a rate that only one unit makes plausible, a unit that is said, Unix time in µs.
    assert_eq!(outcome("time", 10.0, 0.0, None), (100.0, String::new()));
    assert_eq!(outcome("t_s", 1.0, 0.0, None), (1.0, String::new()));
    assert_eq!(
        outcome("timestamp", 1000.0, 1.7e15, None),
        (1000.0, String::new())
    );
}

/// A gap is seen in the time of a receiver and in a unit's own time; a column that runs like a clock and is not used is told.
#[test]
fn clocks_of_receivers_and_loggers_are_known() {
    for (name, unit) in [
        ("tow_s", 1.0),
        ("gps_tow", 1.0),
        ("gps_time_s", 1.0),
        ("sow", 1.0),
        ("TimeUS", 1e-6),
        ("iTOW", 1e-3),
        ("GPS Time (ms)", 1e-3),
    ] {
        let decimals = if unit == 1.0 { 2 } else { 0 };
        let at = |k: usize| format!("{:.decimals$}", (345_600.0 + 0.01 * k as f64) / unit);
        let r = read_one("a.csv", stamped(name, 100, at), &ReadOptions::default()).unwrap();
        // 345 600 s is held to 6e-11 s, a span of 0.99 s to 1e-10
        assert!((r.rate_hz - 100.0).abs() < 1e-6, "{name}: {}", r.rate_hz);
        let gap = stamped(name, 100, |k| at(if k < 50 { k } else { k + 6000 }));
        assert!(
            refusal(&gap).contains("gap in time"),
            "{name}: {}",
            refusal(&gap)
        );
    }
    // The time of the unit itself is preferred.
    let both = stamped("gps_time,t_s", 100, |k| {
        format!("{},{}", 5 * (k / 10), k as f64 / 50.0)
    });
    assert_close(
        &[read_one("a.csv", both, &ReadOptions::default())
            .unwrap()
            .rate_hz],
        &[50.0],
    );
}

/// An hour back, or the end of a GPS week.
#[test]
fn a_clock_that_was_set_back_is_refused() {
    let at = |k: usize| 7200.0 + 0.01 * k as f64 - if k < 50 { 0.0 } else { 3600.0 };
    let refused = refusal(stamped("t_s", 100, |k| format!("{:.2}", at(k))));
    assert!(refused.contains("time goes back"), "{refused}");
}

/// Counters of 16 and 32 bits and the GPS week: the time goes on as if they had not started again, here after 51 samples.
#[test]
fn counters_that_start_again_are_counted_on() {
    for (name, turn, step) in [
        ("t_us", 4_294_967_296.0, 10_000.0),
        ("t_s", 4_294.967_296, 0.01),
        ("t_ms", 65_536.0, 10.0),
        ("tow_s", 604_800.0, 0.01),
    ] {
        let at = |k: usize| (turn + step * (k as f64 - 50.5)) % turn;
        let text = stamped(name, 100, |k| format!("{:.6}", at(k)));
        let (_files, path) = Files::with("a.csv", text);
        let (recordings, report) = read(&[path], &ReadOptions::default()).unwrap();
        assert!((recordings[0].rate_hz - 100.0).abs() < 0.01);
        assert_eq!(
            report.files[0].assumptions[0],
            format!("column \"{name}\" starts again 1 times: counted on")
        );
    }
}

/// Of 2000 samples at 100 Hz 40 single ones and a burst of 60 lost: the places are where they were, and the rate is that of the
/// samples. A tenth lost, or time that stands still, is refused as ever.
#[test]
fn lost_samples_keep_their_places() {
    let keep = ReadOptions {
        gaps: Gaps::Keep,
        ..ReadOptions::default()
    };
    let stamps = |is_lost: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..2000).filter(|k| !is_lost(*k)).collect();
        stamped("t_s", kept.len(), |i| {
            format!("{:.2}", 0.01 * kept[i] as f64)
        })
    };
    let is_lost = |k: usize| k % 50 == 25 || (1001..1061).contains(&k);
    let lost = (0..2000).filter(|k| is_lost(*k)).count();
    let (_files, path) = Files::with("a.csv", stamps(&is_lost));
    let (recordings, report) = read(&[path], &keep).unwrap();
    let samples = &recordings[0].signals[0].samples;
    assert_eq!((samples.len(), report.files[0].samples[0]), (2000, 2000));
    assert!((0..2000).all(|k| samples[k].is_nan() == is_lost(k)));
    assert!(
        (recordings[0].rate_hz / 100.0 - 1.0).abs() < 1e-6,
        "{}",
        recordings[0].rate_hz
    );
    let warning = &report.files[0].warnings[0];
    let share = lost as f64 / 20.0;
    assert!(
        warning.contains(&format!(
            "{lost} samples ({share:.2} %) are missing in 40 gaps"
        )),
        "{warning}"
    );
    let often = stamps(&|k| k % 9 == 5);
    assert!(
        refusal_with("a.csv", &often, &keep)
            .0
            .contains("gap in time")
    );
    // at random, and in blocks: what strays from even stamps is lost, however often
    let mut state = 1_u32;
    let mut at_random = vec![false; 2000];
    for lost in &mut at_random[1..1999] {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *lost = f64::from(state >> 8) < 0.3 * f64::from(1 << 24);
    }
    let in_blocks: Vec<bool> = (0..2000).map(|k| k % 500 >= 320 && k < 1990).collect();
    for lost in [at_random, in_blocks] {
        let (_files, path) = Files::with("a.csv", stamps(&|k| lost[k]));
        let (recordings, _) = read(&[path], &keep).unwrap();
        let samples = &recordings[0].signals[0].samples;
        assert!((0..2000).all(|k| samples[k].is_nan() == lost[k]));
    }
    let twice = format!(
        "{}1,1\n",
        stamped("t_s", 20, |i| format!("{:.2}", 0.05 * (i.min(18)) as f64))
    );
    assert!(refusal_with("a.csv", &twice, &keep).0.contains("in time"));
}
