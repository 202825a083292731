//! Tables of a study.

use super::super::sample;
use super::*;

fn column_result(measured: &Measured) -> ColumnResult<'_> {
    let cell = ["land", "m", "s", "g", "o"];
    ColumnResult {
        cell,
        candidate: "I/awv",
        filter: "15",
        reference: "I/awv",
        measured,
    }
}

#[test]
fn rows_fit_their_columns_and_names_carry_units() {
    let result = sample::result();
    let (outages, epochs) = (metrics::outages(&result), metrics::epochs(&result));
    let experiment = Measured::from(&result);
    let comparison = metrics::compare(&experiment, &experiment, true).unwrap();
    let tables = [
        (
            outage_columns(),
            outage_rows(&column_result(&experiment), &outages, Some(&comparison)),
        ),
        (
            outage_columns(),
            outage_rows(&column_result(&experiment), &outages, None),
        ),
        (
            epoch_columns(),
            epoch_rows(&column_result(&experiment), &epochs),
        ),
        (run_columns(), run_rows(&column_result(&experiment))),
    ];
    for (columns, rows) in tables {
        assert!(!rows.is_empty());
        let names: std::collections::HashSet<&str> =
            columns.iter().map(|(n, _)| n.as_str()).collect();
        assert_eq!(names.len(), columns.len());
        for row in &rows {
            assert_eq!(row.len(), columns.len());
            for (value, (name, kind)) in row.iter().zip(&columns) {
                let found = match value {
                    Value::Text(_) => ValueKind::Text,
                    Value::Int(_) => ValueKind::Int,
                    Value::Float(_) => ValueKind::Float,
                };
                assert_eq!(found, *kind, "{name}");
            }
        }
    }
    let units = [
        "_s",
        "_m",
        "_m_s2",
        "_deg",
        "_pct",
        "_share",
        "_mean",
        "_reference",
        "nees",
        "coverage",
        "nees_end",
        "nees_end_std_error",
        "log_density_end",
        "log_density_end_std_error",
        "_ratio",
    ];
    for (name, kind) in outage_columns()
        .iter()
        .chain(&epoch_columns())
        .chain(&run_columns())
    {
        assert!(
            *kind != ValueKind::Float || units.iter().any(|u| name.ends_with(u)),
            "{name}"
        );
    }
}

#[test]
fn values_stand_under_their_names() {
    let result = sample::result();
    let (outages, experiment) = (metrics::outages(&result), Measured::from(&result));
    let rows = outage_rows(&column_result(&experiment), &outages, None);
    let value_of = |name: &str| {
        let i = outage_columns()
            .iter()
            .position(|(n, _)| n == name)
            .unwrap();
        rows[0][i].clone()
    };
    let o = &outages[0];
    assert_eq!(value_of("candidate"), Value::Text("I/awv".into()));
    assert_eq!(value_of("duration_s"), Value::Float(o.end_s - o.start_s));
    assert_eq!(
        value_of("asee_mean_std_error_pos_n_m"),
        Value::Float(o.asee_mean.0[0].std_error)
    );
    assert_eq!(
        value_of("rmse_end_yaw_deg"),
        Value::Float(o.rmse_end.0[8].value)
    );
    assert_eq!(
        value_of("horizontal_error_end_max_m"),
        Value::Float(o.horizontal_max_m)
    );
    assert!(matches!(value_of("coverage_mean"), Value::Float(x) if x.is_nan()));
}
