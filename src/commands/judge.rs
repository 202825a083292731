//! `nav-sim judge`: the solution of any filter against a reference.

use super::fuse::{Columns, TIME, number, table};
use crate::app::{Command, Context, Failure, OutputKind, PlainAnswer, Result, refused};
use crate::io::trajectory_file::{load_reference, load_solution, parse_origin};
use crate::parse::numbers;
use crate::report::verdict::{drive_line, tone};
use crate::report::{error_charts, json};
use nav_sim_document::{Cell, Colour, Document, Importance, Table, readable, window};
use nav_sim_navigation::fusion::judge::{
    Judgement, ReferenceOffset, SetupFault, StatedErrors, judge, rough_delay_s,
};
use nav_sim_navigation::metrics::{DriveVerdict, VerdictKind};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::REPORTED_NAMES;
use serde_json::json;
use std::path::PathBuf;

/// Judge the solution of any filter: are its errors as large as it states?
///
/// SOLUTION: t_s, lat_deg, lon_deg, h_m (or n_m, e_m, d_m), velocities v_n_m_s … and roll_deg, pitch_deg, yaw_deg where
/// they are known, with standard deviations sd_n_m, sd_e_m, sd_d_m, sd_vn_m_s … sd_yaw_deg; a solution of RTKLIB (.pos); a
/// TUM trajectory or a KF-GINS result (.nav) with --covariance. Errors are compared with the standard deviations state by
/// state and together (NEES), by as many samples as the errors are worth: how long they last is found from them. A clock or
/// a point of the vehicle that is not the reference's is found and named. Writes summary.json, errors.csv, report.html,
/// manifest.json. Exit code 3: the solution is overconfident.
#[derive(clap::Args, Debug, Clone)]
pub struct Judge {
    /// Solution (.csv, .tsv, .txt, .pos, .nav, .tum, also .gz)
    #[arg(value_name = "SOLUTION")]
    solution: PathBuf,
    /// Reference trajectory; stretches where it jumps are left out
    #[arg(long, value_name = "TRAJECTORY")]
    reference: PathBuf,
    /// Standard deviations or covariances of SOLUTION in a file of their own: a table of t_s, sd_n_m, …; that of KF-GINS; rows
    /// of a time and a matrix: position north, east, down (9 numbers), the pose of ROS (36), or position, velocity and rotation
    /// about north, east, down (81)
    #[arg(long, value_name = "FILE")]
    covariance: Option<PathBuf>,
    /// Window in which SOLUTION had no fixes, in seconds on its clock (repeatable)
    #[arg(long = "outage", value_name = "START:END")]
    outages: Vec<Outage>,
    /// Time by which the stamps of the reference are late (s)
    #[arg(
        long = "reference-delay",
        value_name = "S",
        value_parser = number,
        default_value = "0",
        hide_default_value = true,
        allow_hyphen_values = true
    )]
    reference_delay_s: f64,
    /// Point of the reference from that of SOLUTION: front, right, down (m)
    #[arg(long = "reference-arm", value_name = "X,Y,Z", value_parser = arm, default_value = "0,0,0",
        hide_default_value = true, allow_hyphen_values = true)]
    reference_arm_m: [f64; 3],
    /// Origin of local coordinates
    #[arg(long, value_name = "LAT_DEG,LON_DEG,H_M", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<[f64; 3]>,
}

fn arm(text: &str) -> Result<[f64; 3], &'static str> {
    numbers(text).ok_or("expected 3 numbers")
}

fn origin(text: &str) -> Result<[f64; 3], &'static str> {
    parse_origin(text).ok_or("expected latitude, longitude (degrees) and height (m)")
}

impl Command for Judge {
    type Answer = PlainAnswer;
    const NAME: &'static str = "judge";
    const OUT: OutputKind = OutputKind::Directory {
        path: "out/judge",
        files: &["summary.json", "errors.csv"],
    };

    fn run(&self, context: &Context<'_>) -> Result<PlainAnswer> {
        let (reference, warnings) = load_reference(&self.reference, self.origin)?;
        context.warn_each(&warnings);
        let covariance = self.covariance.as_deref();
        let (rows, warnings) =
            load_solution(&self.solution, covariance, self.origin, reference.span_s())?;
        context.warn_each(&warnings);
        let given = ReferenceOffset {
            delay_s: self.reference_delay_s,
            lever_arm_m: self.reference_arm_m.into(),
        };
        let outages = &self.outages;
        let judgement = judge(&rows, &reference, given, outages).ok_or_else(|| {
            let (start, end) = reference.span_s();
            let ends = rows.first().zip(rows.last());
            let ends = ends.map_or((0.0, 0.0), |(a, b)| (a.t_s, b.t_s));
            let message = format!(
                "{} is of {:.2} to {:.2} s, the reference of {start:.2} to {end:.2} s",
                self.solution.display(),
                ends.0,
                ends.1
            );
            let hint = match rough_delay_s(&rows, &reference, given) {
                Some(delay_s) => format!("--reference-delay={delay_s} aligns them"),
                None => "give both on one clock, or --reference-delay S".to_owned(),
            };
            Failure::input(message).hint(hint)
        })?;
        let (first, last) = (rows.first(), rows.last());
        let span = first.zip(last).map_or((0.0, 0.0), |(a, b)| (a.t_s, b.t_s));
        for outage in outages {
            if outage.end_s < span.0 || outage.start_s > span.1 {
                let asked = window(outage.start_s, outage.end_s);
                let message = format!("--outage: {asked} is outside the solution");
                let hint = format!("it goes from {:.2} to {:.2} s", span.0, span.1);
                return refused(message, hint);
            }
        }
        if let Some(stated) = &judgement.stated {
            let unstated = REPORTED_NAMES.iter().zip(judgement.rmse.0);
            let unstated = unstated.zip(stated.error_over_sigma.0);
            let unstated = unstated.filter(|((_, rmse), ratio)| rmse.is_finite() && ratio.is_nan());
            let names: Vec<&str> = unstated.map(|((name, _), _)| *name).collect();
            if !names.is_empty() {
                context.warn(format!(
                    "no standard deviations of {}: not in the verdict",
                    names.join(", ")
                ));
            }
        }
        let is_overconfident = judgement.kind == VerdictKind::Overconfident;
        let unmet = is_overconfident.then(|| {
            Failure::bound("the solution is overconfident")
                .hint("larger process or measurement noise in the filter: errors.csv shows where")
        });
        let summary = summary(&judgement, outages);
        let document = page(&judgement, outages);
        let files = [
            ("summary.json", json(&summary)),
            ("errors.csv", errors_csv(&judgement)),
        ];
        Ok(PlainAnswer::new(summary, document)
            .with(files)
            .with_unmet(unmet))
    }
}

fn summary(judgement: &Judgement, outages: &[Outage]) -> serde_json::Value {
    let stated = judgement.stated.as_ref();
    let mut verdict = stated.map_or(json!({}), |s| json!(s.verdict));
    verdict["kind"] = json!(judgement.kind);
    let outage = |(k, outage): (usize, &Outage)| {
        let mut errors = judgement.errors.iter();
        let last = errors.rfind(|e| outage.withholds(e.t_s));
        json!({
            "start_s": outage.start_s,
            "end_s": outage.end_s,
            "verdict": stated.and_then(|s| s.outages.get(k)),
            "horizontal_error_end_m": last.map(|e| e.values[0].hypot(e.values[1])),
            "horizontal_sigma_end_m": last.map(|e| e.sigma[0].hypot(e.sigma[1])),
        })
    };
    json!({
        "schema_version": 1,
        "method": "judge",
        "verdict": verdict,
        "doubts": judgement.doubts,
        "offset": judgement.offset,
        "without_offset": judgement.without_offset,
        "rows": judgement.rows,
        "nees": stated.map(|s| json!({ "dof": s.nees_dof, "mean": s.verdict.nees })),
        "coverage": stated.map(|s| json!({ "level": 0.95, "mean": s.verdict.coverage })),
        "rmse": judgement.rmse,
        "horizontal_rmse_m": judgement.horizontal_rmse_m,
        "horizontal_max_m": judgement.horizontal_max_m,
        "error_over_sigma": stated.map(|s| s.error_over_sigma),
        "error_over_sigma_std_error": stated.map(|s| s.error_over_sigma_std_error),
        "independent_samples": stated.map(|s| s.independent_samples),
        "outages": outages.iter().enumerate().map(outage).collect::<Vec<_>>(),
    })
}

/// Whatever else explains the errors, in a sentence with what to do.
pub(crate) fn setup_fault(doubt: &SetupFault) -> String {
    match doubt {
        SetupFault::Apart { metres } => format!(
            "solution and reference are {} m apart: another origin, swapped latitude and longitude, or another drive",
            readable(*metres)
        ),
        SetupFault::Height { metres } => format!(
            "heights of the solution are {} m above the reference's: sea level against ellipsoid?",
            readable(*metres)
        ),
        SetupFault::Axes {
            axes,
            angles_deg: [roll, pitch, yaw],
        } => format!(
            "the axes of {axes} are turned by roll {roll:.0}°, pitch {pitch:.0}°, yaw {yaw:.0}°: write both as front, right, down in north, east, down"
        ),
        SetupFault::Transformed { cause, times, left } => format!(
            "{cause}? Errors are {} times their standard deviations, {} times after that",
            readable(*times),
            readable(*left)
        ),
        SetupFault::Offset(found) => {
            let (offset, sigma) = (found.offset, found.sigma);
            let (arm, arm_sigma) = (offset.lever_arm_m, sigma.lever_arm_m);
            let delay = format!(
                "the reference is {:.3} ± {:.3} s late (--reference-delay={:.3})",
                offset.delay_s, sigma.delay_s, offset.delay_s
            );
            let point = format!(
                "the reference is of a point {:.2},{:.2},{:.2} m front, right, down (± {:.2},{:.2},{:.2}; --reference-arm={0:.2},{1:.2},{2:.2})",
                arm.x, arm.y, arm.z, arm_sigma.x, arm_sigma.y, arm_sigma.z
            );
            match found.parts {
                [true, true] => format!("{delay}, and {point}"),
                [true, false] => delay,
                _ => point,
            }
        }
    }
}

fn lines(judgement: &Judgement, outages: &[(f64, f64)]) -> Vec<String> {
    let own = match &judgement.stated {
        Some(stated) => drive_line(&stated.verdict, stated.nees_dof, outages),
        None => "undecided: no standard deviations in the solution; errors only".to_owned(),
    };
    if judgement.doubts.is_empty() {
        return vec![own];
    }
    let mut lines: Vec<String> = judgement.doubts.iter().map(setup_fault).collect();
    lines[0] = format!("{}: {}", judgement.kind, lines[0]);
    let without = judgement.without_offset.as_ref();
    lines.extend(without.map(|s| {
        format!(
            "without that, {}",
            drive_line(&s.verdict, s.nees_dof, outages)
        )
    }));
    lines.push(format!("as it is, {own}"));
    lines
}

fn page(judgement: &Judgement, outages: &[Outage]) -> Document {
    let windows: Vec<_> = outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let mut document = Document::new(
        "A solution against a reference",
        tone(judgement.kind),
        lines(judgement, &windows),
    );
    let ends = judgement.errors.first().zip(judgement.errors.last());
    if let Some((first, last)) = ends {
        document.text(&format!(
            "{} rows, {:.2}–{:.2} s{}",
            judgement.rows,
            first.t_s,
            last.t_s,
            match judgement.is_at_epochs {
                true => ", at the reference's epochs, which are coarser",
                false => "",
            }
        ));
    }
    if let Some(found) = judgement
        .offset
        .filter(|_| judgement.without_offset.is_none())
    {
        let text = format!(
            "{}: less than the solution states",
            setup_fault(&SetupFault::Offset(found))
        );
        document.note(Importance::Remark, text);
    }
    document.section("States");
    let mut table = Table::new([
        "state",
        "RMSE",
        "error over σ, rms",
        "±",
        "independent samples",
    ]);
    for (i, name) in REPORTED_NAMES.iter().enumerate() {
        if judgement.rmse.0[i].is_nan() {
            continue;
        }
        let of = |key: &str, value: f64| Cell::number(value, &format!("/{key}/{name}"));
        let stated = judgement.stated.as_ref();
        let figure = |of: fn(&DriveVerdict) -> &[f64; 9]| stated.map_or(f64::NAN, |s| of(s)[i]);
        table.row([
            (*name).into(),
            of("rmse", judgement.rmse.0[i]),
            of("error_over_sigma", figure(|s| &s.error_over_sigma.0)),
            of(
                "error_over_sigma_std_error",
                figure(|s| &s.error_over_sigma_std_error.0),
            ),
            of("independent_samples", figure(|s| &s.independent_samples.0)),
        ]);
    }
    document.table(table.without_unknown());
    if !outages.is_empty() {
        document.section("Outages");
        let columns = [
            ("outage", "{start_s}–{end_s} s"),
            ("verdict", "verdict/kind"),
            ("horizontal error at the end (m)", "horizontal_error_end_m"),
            ("1 σ", "horizontal_sigma_end_m"),
        ];
        let table = Table::of(&summary(judgement, outages), "/outages/*", &columns);
        document.table(table.without_unknown());
    }
    document.section("Errors");
    let rows = judgement.errors.iter().map(|e| (e.t_s, e.values, e.sigma));
    let names = ["stated", "error"];
    document.charts(
        &error_charts(
            &[(rows.collect(), names, [Colour::BELIEVED, Colour::REAL])],
            &windows,
        ),
        "Lines: solution minus reference. Bands: ± 3 σ as stated.",
    );
    document
}

/// A row for each of the solution: errors, standard deviations, NEES where correlations are stated.
fn errors_csv(judgement: &Judgement) -> String {
    const COLUMNS: [Columns; 4] = [
        TIME,
        ("err_", &REPORTED_NAMES, Some(6)),
        ("sd_", &REPORTED_NAMES, Some(6)),
        ("", &["nees"], Some(4)),
    ];
    let row = |e: &StatedErrors| {
        let nees = e.nees.unwrap_or(f64::NAN);
        [&[e.t_s], &e.values[..], &e.sigma, &[nees]].concat()
    };
    table(&COLUMNS, judgement.errors.iter().map(row))
}
