use super::*;
use approx::assert_abs_diff_eq;

fn outage(start_s: f64, end_s: f64) -> Outage {
    Outage { start_s, end_s }
}

/// Fixes at 1 Hz.
const fn regular(start_s: f64, end_s: f64) -> FixedData<'static> {
    FixedData {
        span_s: (start_s, end_s),
        fixes: Fixes::Every { interval_s: 1.0 },
    }
}

#[test]
fn a_fix_at_the_start_is_missing_and_at_the_end_is_not() {
    let o = outage(300.0, 390.0);
    assert_eq!(
        [299.0, 300.0 - 1e-10, 300.0, 389.0, 390.0].map(|t| o.withholds(t)),
        [false, true, true, true, false]
    );
}

#[test]
fn kinds_are_united_in_time_order() {
    let plan = OutagePlan {
        fixed: vec![outage(50.0, 70.0), outage(10.0, 20.0), outage(95.0, 300.0)],
        periodic: Some(PeriodicOutages {
            first_s: 15.0,
            every_s: 40.0,
            duration_s: 10.0,
        }),
        ..OutagePlan::default()
    };
    let expected = vec![outage(10.0, 25.0), outage(50.0, 70.0), outage(95.0, 101.0)];
    assert_eq!(plan.windows(&regular(0.0, 100.0), 1), expected);
}

/// A fix every 10 s. Windows of 3 s every 20 s: those from 12 s withhold none, those from 18 s one each. Of 8 s every 9 s: each
/// withholds one, and there is none in the seconds between.
#[test]
fn outages_without_fixes_between_them_are_one() {
    let windows = |first_s, every_s, duration_s| {
        let data = FixedData {
            span_s: (0.0, 60.0),
            fixes: Fixes::Every { interval_s: 10.0 },
        };
        let plan = OutagePlan {
            periodic: Some(PeriodicOutages {
                first_s,
                every_s,
                duration_s,
            }),
            ..OutagePlan::default()
        };
        plan.windows(&data, 1)
    };
    assert_eq!(windows(12.0, 20.0, 3.0), []);
    let each = [outage(18.0, 21.0), outage(38.0, 41.0)];
    assert_eq!(windows(18.0, 20.0, 3.0)[..2], each);
    assert_eq!(windows(19.0, 9.0, 8.0).len(), 1);
}

/// First one, from time immemorial: as many windows as the span has room for, at the same times.
#[test]
fn periodic_outages_begin_where_the_span_does() {
    let plan = |first_s| OutagePlan {
        periodic: Some(PeriodicOutages {
            first_s,
            every_s: 100.0,
            duration_s: 20.0,
        }),
        ..OutagePlan::default()
    };
    let expected = vec![outage(0.0, 10.0), outage(90.0, 110.0), outage(190.0, 201.0)];
    assert_eq!(plan(-10.0).windows(&regular(0.0, 200.0), 1), expected);
    assert_eq!(
        plan(-1e12 - 10.0).windows(&regular(0.0, 200.0), 1),
        expected
    );
    let epoch = plan(0.0).windows(&regular(1.7e9 - 10.0, 1.7e9 + 30.0), 1);
    assert_eq!(epoch, [outage(1.7e9, 1.7e9 + 20.0)]);
}

#[test]
fn an_outage_lies_on_the_data_and_withholds_a_fix() {
    let fixes = [1.0, 2.0, 3.0, 4.0];
    let recorded = FixedData::recorded(&fixes);
    assert_eq!(recorded.span_s, (0.0, 5.0));
    let regular = regular(0.0, 5.0);
    for data in [recorded, regular] {
        let check = |a, b| data.check(outage(a, b));
        for (a, b) in [(2.0, 3.0), (3.5, 9.0), (0.0, 1.5)] {
            assert_eq!(check(a, b), Ok(()));
        }
        for (a, b) in [(2.1, 2.9), (0.0, 1.0), (2.0 + 1e-8, 3.0)] {
            let e = check(a, b).unwrap_err().to_string();
            assert_eq!(e, format!("outage {a}:{b} withholds no fix"));
        }
        for (a, b) in [(-1.0, 3.0), (5.0, 9.0)] {
            let e = check(a, b).unwrap_err().to_string();
            let expected = "does not lie on the data, which last from 0 to 5 s";
            assert_eq!(e, format!("outage {a}:{b} {expected}"));
        }
    }
    // of the two, the regular fixes have one at 5 s
    let ends = [recorded, regular].map(|d| d.cut(outage(3.5, 9.0)).end_s);
    assert_eq!(ends, [5.0, 6.0]);
    let hints = [recorded, regular].map(|d| {
        d.check(outage(5.0, 9.0))
            .unwrap_err()
            .hint()
            .map(str::to_owned)
    });
    let expected = [
        "the fixes run from 1 to 4 s: begin it between 0 and 5 s",
        "fixes come every 1 s from 0 s: begin it between 0 and 5 s",
    ];
    assert_eq!(hints, expected.map(|hint| Some(hint.to_owned())));
}

/// What was asked for is refused where what is there by default is cut or left out.
#[test]
fn default_outages_are_cut_and_that_is_said() {
    let data = regular(0.0, 720.0);
    let late = outage(800.0, 810.0);
    let default = [Outage::PAPER.to_vec(), vec![late]].concat();
    let placed = OutagePlan {
        default,
        ..OutagePlan::default()
    }
    .on(&data, 1)
    .unwrap();
    assert_eq!(placed.windows, [outage(300.0, 390.0), outage(700.0, 721.0)]);
    let expected = [
        "the default outage 700:790 is cut: the trajectory lasts from 0 to 720 s",
        "the default outage 800:810 is left out: the trajectory lasts from 0 to 720 s",
    ];
    assert_eq!(placed.remarks, expected);
    let asked = OutagePlan {
        fixed: vec![late],
        ..OutagePlan::default()
    };
    assert!(asked.on(&data, 1).is_err());
}

#[test]
fn outages_that_are_not_as_asked_for_are_remarked() {
    let remarks = |plan: OutagePlan, fixes| {
        plan.on(
            &FixedData {
                span_s: (0.0, 100.0),
                fixes,
            },
            1,
        )
        .unwrap()
        .remarks
    };
    let plan = OutagePlan {
        fixed: vec![outage(10.0, 20.0), outage(20.0, 30.0), outage(90.0, 300.0)],
        periodic: Some(PeriodicOutages {
            first_s: 100.0,
            every_s: 40.0,
            duration_s: 10.0,
        }),
        ..OutagePlan::default()
    };
    let common = [
        "outages without a fix between them are merged",
        "outage_periodic.first_s = 100 s: the trajectory ends at 100 s",
    ];
    let found = remarks(plan.clone(), Fixes::Every { interval_s: 1.0 });
    assert_eq!(
        found[0],
        "outage 90:300 is cut: the trajectory ends at 100 s"
    );
    assert_eq!(found[1..], common);
    let found = remarks(plan, Fixes::At(&[10.0, 20.0, 95.0]));
    assert_eq!(
        found[0],
        "outage 90:300 is cut at 100 s: the fixes end at 95 s"
    );
    assert_eq!(found[1..], common);
}

/// The number of outages in an hour of exponential waiting is close to Poisson: over 2000 seeds the
/// mean is within 5 standard errors of the renewal rate 3600/(mean waiting + duration).
#[test]
fn random_outages_occur_at_the_stated_rate_and_repeat_with_the_seed() {
    let plan = OutagePlan {
        random: Some(RandomOutages {
            rate_per_hour: 6.0,
            duration_s: 30.0,
        }),
        ..OutagePlan::default()
    };
    let span = &FixedData {
        span_s: (0.0, 36_000.0),
        fixes: Fixes::Every { interval_s: 1e-3 },
    };
    let count = |seed| plan.windows(span, seed).len() as f64;
    let seeds = 2000;
    let counts: Vec<f64> = (0..seeds).map(count).collect();
    let mean = counts.iter().sum::<f64>() / seeds as f64;
    let variance = counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (seeds - 1) as f64;
    // Renewal function of a delayed process: (T − E[wait])/cycle up to the residual of the first cycle,
    // E N(T) = T/m + (s² + m²)/(2m²) − E[first]/m, m = 630 s, s = E[first] = 600 s.
    let (m, s, t) = (630.0, 600.0, span.span_s.1);
    let expected = t / m + (s * s + m * m) / (2.0 * m * m) - s / m;
    assert_abs_diff_eq!(
        mean,
        expected,
        epsilon = 5.0 * (variance / seeds as f64).sqrt()
    );
    assert_eq!(plan.windows(span, 7), plan.windows(span, 7));
    assert_ne!(plan.windows(span, 7), plan.windows(span, 8));
}

#[test]
fn an_outage_is_read_from_its_times() {
    for text in ["60:90", "60: 90", " 60 :90.0"] {
        assert_eq!(text.parse(), Ok(outage(60.0, 90.0)), "{text}");
    }
    for text in ["", "60", "60:", "60:90:100", "a:b"] {
        let expected = "expected START:END in seconds, such as 300:390";
        assert_eq!(text.parse::<Outage>().unwrap_err().0, expected, "{text}");
    }
    for text in ["90:60", "60:60", "60:inf", "nan:60"] {
        let refusal = text.parse::<Outage>().unwrap_err().0;
        assert!(refusal.contains(" is refused: "), "{text}: {refusal}");
    }
}
