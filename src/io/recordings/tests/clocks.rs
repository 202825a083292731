//! The clock of a recording: gaps, rates, units.

use super::*;
use approx::assert_abs_diff_eq;
use nav_sim_signal::rng::Generator;
use rand::{RngExt, SeedableRng};

#[test]
fn time_is_checked() {
    let gap = sound(20).into_iter().enumerate().filter(|(i, _)| *i != 10);
    let gap: String = gap.map(|(_, line)| line + "\n").collect();
    insta::assert_snapshot!(answers(
        [
            ("back", changed(7, "0.03,1")),
            ("twice", changed(7, "0.04,1")),
            ("gap", gap.clone()),
            ("stands", "t_s,gyro_x_rad_s\n1,1\n1,2\n1,3\n".to_owned()),
            // an hour back, or the end of a GPS week
            (
                "set back",
                stamped("t_s", 100, |k| {
                    format!(
                        "{:.2}",
                        7200.0 + 0.01 * k as f64 - if k < 50 { 0.0 } else { 3600.0 }
                    )
                })
            ),
        ]
        .map(|(name, text)| (name, read_one("a.csv", text, &ReadOptions::default())))
    ));
    let (_files, path) = Files::with("a.csv", &gap);
    let of = |gaps| {
        let (recordings, report) = read(std::slice::from_ref(&path), &with_gaps(gaps)).unwrap();
        let lengths: Vec<usize> = recordings.iter().map(Recording::len).collect();
        (
            lengths,
            recordings[0].rate_hz,
            report.files[0].warnings[0].clone(),
        )
    };
    let (lengths, _, warning) = of(Gaps::Split);
    assert_eq!(lengths, [9, 10]);
    let split = "split at gaps or duplicates in time: 1, the first in line 11";
    assert!(warning.contains(split), "{warning}");
    // Ignored, a lost sample leaves the rate of the others.
    let (lengths, rate_hz, warning) = of(Gaps::Ignore);
    assert_eq!(lengths, [19]);
    assert_close(&[rate_hz], &[100.0]);
    let ignored = "gaps or duplicates in time ignored: 1, the first in line 11";
    assert!(warning.contains(ignored), "{warning}");
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
    let slower = times(&|k| if k < 7000 { 0.01 } else { 0.02 }, 15_000);
    insta::assert_snapshot!(answers(
        [("faster", faster), ("slower", slower)]
            .map(|(name, text)| (name, read_one("a.csv", text, &ReadOptions::default())))
    ));
    for steps in [
        &(|k: usize| 0.01 * (1.0 - 0.005 * k as f64 / 4000.0)) as &dyn Fn(usize) -> f64,
        &|k: usize| 0.01 * (1.0 + 0.4 * (k as f64 * 2.4).sin()),
    ] {
        read_csv(times(steps, 4000));
    }
}

#[test]
fn rates() {
    let text = sound(20).join("\n");
    let stated = "// Update Rate: 50.0Hz\ngyr_X\n0.1\n0.2\n0.4\n";
    insta::assert_snapshot!(answers(
        [
            ("100 Hz", &*text, at(200.0)),
            ("100 Hz", &text, at(-1.0)),
            (stated, stated, at(25.0)),
            ("no rate", "gyro_x_rad_s\n1\n2\n", ReadOptions::default()),
        ]
        .map(|(name, text, options)| (name, read_one("a.csv", text, &options)))
    ));
    let rounded = read_one("a.txt", stated, &at(50.2)).unwrap();
    assert_close(&[rounded.rate_hz], &[50.2]);

    let files = Files::new();
    files.add("a.csv", &text);
    files.add("b.csv", text.replace("t_s", "t_ms"));
    let e = read(&[files.path()], &ReadOptions::default()).unwrap_err();
    let told = files.told(&e);
    assert!(
        told.contains("b.csv has 100000 Hz, but a.csv has 100 Hz"),
        "{told}"
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
        rate_hz,
        ..with_gaps(Gaps::Ignore)
    };
    type Stamp = fn(f64) -> f64;
    let cases: [(f64, f64, Stamp); 5] = [
        (200.0, 0.01, |k| (k / 2.0).round() / 100.0),
        (1000.0 / 1.2, 1e-3, |k| (1.2 * k).floor() / 1000.0),
        (100.0, 0.03, |k| 0.03 * (k / 3.0).floor() + 1e-4 * (k % 3.0)),
        (200.0, 1.0 / 64.0, |k| (k / 200.0 * 64.0).floor() / 64.0),
        // to milliseconds, of which no step is that of 128 Hz
        (128.0, 1e-3, |k| (k / 128.0 * 1e3).round() / 1e3),
    ];
    for (rate_hz, late_s, stamp) in cases {
        let text = stamped("t_s", N, |k| format!("{}", stamp(k as f64)));
        let r = read_one("a.csv", &text, &ignore(None)).unwrap();
        assert_relative_eq!(
            r.rate_hz,
            rate_hz,
            max_relative = late_s * rate_hz / (N - 1) as f64
        );
        let r = read_one("a.csv", &text, &ignore(Some(rate_hz))).unwrap();
        assert_close(&[r.rate_hz], &[rate_hz]);
        if late_s > 1e-3 {
            let refusal = refusal("a.csv", &text, &ReadOptions::default());
            assert!(refusal.contains("--gaps ignore"), "{refusal}");
        }
    }
}

#[test]
fn a_unit_that_is_not_said_is_told_by_the_step() {
    let found = |name: &str, step: f64, first: f64, rate_hz: Option<f64>| {
        let text = stamped(name, 100, |k| format!("{}", first + step * k as f64));
        let options = ReadOptions {
            rate_hz,
            ..ReadOptions::default()
        };
        let (recording, report) = outcome(text, &options);
        (recording.rate_hz, report.warnings.join("\n"))
    };
    for (name, step, first, guessed) in [
        ("time", 1.0, 0.0, 1000.0),
        ("time", 50.0, 0.0, 20.0),
        ("time", 200.0, 0.0, 5000.0),
        ("time", 99.0, 0.0, 1e3 / 99.0),
        // a rate that only one unit makes plausible, a unit that is said, Unix time in µs
        ("time", 10.0, 0.0, 100.0),
        ("t_s", 1.0, 0.0, 1.0),
        ("timestamp", 1000.0, 1.7e15, 1000.0),
    ] {
        for given in [None, Some(guessed)] {
            let (rate_hz, warning) = found(name, step, first, given);
            assert_close(&[rate_hz], &[guessed]);
            assert_eq!(warning, "", "{name} {step}");
        }
    }
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
        let r = read_csv(stamped(name, 100, at));
        // 345 600 s is held to 6e-11 s, a span of 0.99 s to 1e-10
        assert!((r.rate_hz - 100.0).abs() < 1e-6, "{name}: {}", r.rate_hz);
        let gap = stamped(name, 100, |k| at(if k < 50 { k } else { k + 6000 }));
        let refusal = refusal("a.csv", &gap, &ReadOptions::default());
        assert!(refusal.contains("gap in time"), "{name}: {refusal}");
    }
    // The time of the unit itself is preferred.
    let both = stamped("gps_time,t_s", 100, |k| {
        format!("{},{}", 5 * (k / 10), k as f64 / 50.0)
    });
    assert_close(&[read_csv(both).rate_hz], &[50.0]);
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
        let (recording, report) = outcome(text, &ReadOptions::default());
        assert_abs_diff_eq!(recording.rate_hz, 100.0, epsilon = 0.01);
        assert_eq!(
            report.assumptions[0],
            format!("column \"{name}\" starts again 1 times: counted on")
        );
    }
}

/// Of 2000 samples at 100 Hz 40 single ones and a burst of 60 lost: the places are where they were, and the rate is that of the
/// samples. A tenth lost, or time that stands still, is refused as ever.
#[test]
fn lost_samples_keep_their_places() {
    let keep = with_gaps(Gaps::Keep);
    let stamps = |is_lost: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..2000).filter(|k| !is_lost(*k)).collect();
        stamped("t_s", kept.len(), |i| {
            format!("{:.2}", 0.01 * kept[i] as f64)
        })
    };
    let is_lost = |k: usize| k % 50 == 25 || (1001..1061).contains(&k);
    let lost = (0..2000).filter(|k| is_lost(*k)).count();
    let (recording, report) = outcome(stamps(&is_lost), &keep);
    let samples = &recording.signals[0].samples;
    assert_eq!((samples.len(), report.samples[0]), (2000, 2000));
    assert!((0..2000).all(|k| samples[k].is_nan() == is_lost(k)));
    // also where they are ignored
    let ignored = read_one("a.csv", stamps(&is_lost), &with_gaps(Gaps::Ignore)).unwrap();
    for rate_hz in [recording.rate_hz, ignored.rate_hz] {
        assert_relative_eq!(rate_hz, 100.0, max_relative = 1e-6);
    }
    let warning = &report.warnings[0];
    let share = lost as f64 / 20.0;
    let missing = format!("{lost} samples ({share:.2} %) are missing in 40 gaps");
    assert!(warning.contains(&missing), "{warning}");
    let often = stamps(&|k| k % 9 == 5);
    let refused = refusal("a.csv", &often, &keep);
    assert!(refused.contains("gap in time"), "{refused}");
    // at random, and in blocks: what strays from even stamps is lost, however often
    let mut generator = Generator::seed_from_u64(1);
    let is_inside = |k: usize| (1..1999).contains(&k);
    let at_random: Vec<bool> = (0..2000)
        .map(|k| is_inside(k) && generator.random_bool(0.3))
        .collect();
    let in_blocks: Vec<bool> = (0..2000).map(|k| k % 500 >= 320 && k < 1990).collect();
    for lost in [at_random, in_blocks] {
        let (recording, _) = outcome(stamps(&|k| lost[k]), &keep);
        let samples = &recording.signals[0].samples;
        assert!((0..2000).all(|k| samples[k].is_nan() == lost[k]));
    }
    let twice = format!(
        "{}1,1\n",
        stamped("t_s", 20, |i| format!("{:.2}", 0.05 * (i.min(18)) as f64))
    );
    let refused = refusal("a.csv", &twice, &keep);
    assert!(refused.contains("in time"), "{refused}");
}
