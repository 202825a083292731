//! A fusion as a document: verdict, figures, track, errors, innovations.

use super::{FuseAnswer, InnovationCause};
use crate::commands::judge::setup_fault;
use crate::report::trajectory::track_map;
use crate::report::verdict::{deciding, drive_line};
use crate::report::{error_charts, reduction_doubt, reduction_line, tone};
use glam::DVec3;
use nav_sim_document::{
    Chart, ChartAxis, Colour, Document, Importance, Mark, Panel, Series, Table, counted, readable,
    seconds, window,
};
use nav_sim_navigation::earth::ned_difference;
use nav_sim_navigation::frames::NavState;
use nav_sim_navigation::fusion::{
    ClocksApart, ExcessWhiteNoise, Finding, FixRecord, Outliers, Solution, SolutionRow,
    WithheldWindows,
};
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::simulation::{REPORTED, REPORTED_NAMES};

impl FuseAnswer {
    /// Verdict, figures, charts and notes.
    pub(super) fn page(&self) -> Document {
        let (solution, summary) = (&self.solution, &self.summary);
        let mut document = Document::new(
            "INS/GNSS fusion of recorded data",
            tone(summary.verdict.kind),
            self.verdict(),
        );
        document.text(&self.span());
        document.text(&format!("start: {}", summary.initial.how.join("; ")));
        let outages: Vec<_> = summary
            .outcome
            .outages
            .iter()
            .map(|o| (o.outage.start_s, o.outage.end_s))
            .collect();
        document.section("Track");
        document.chart(&map(solution, &outages), "North and east of the start.");
        self.figures(&mut document);
        document.section("Position");
        document.chart(&position(solution, &outages), POSITION);
        if solution.rows.iter().any(|row| row.error.is_some()) {
            document.section("Errors against the reference");
            document.charts(&errors(solution, &outages), ERRORS);
        }
        if let Some(outliers) = &summary.outcome.outliers {
            let importance = match outliers.share > MANY {
                true => Importance::Warning,
                false => Importance::Remark,
            };
            document.note(importance, rejected(outliers));
        }
        for noise in &summary.imu_noise {
            document.note(Importance::Warning, own_noise(noise));
        }
        document.section("Fixes");
        document.chart(&innovations(solution, &outages), FIXES);
        if let Some(quality) = &self.reduction {
            match reduction_doubt(quality) {
                Some(doubt) => document.note(Importance::Warning, doubt),
                None => document.note(Importance::Remark, reduction_line(quality)),
            }
        }
        document
    }
}

impl FuseAnswer {
    /// The answer in lines, the gravest evidence first.
    fn verdict(&self) -> Vec<String> {
        let summary = &self.summary;
        let verdict = &summary.verdict;
        let outages = summary.outcome.outages.iter();
        let outages: Vec<_> = outages
            .map(|o| (o.outage.start_s, o.outage.end_s))
            .collect();
        let mut evidence = verdict.evidence.iter().map(|f| evidence(f, &outages));
        let first = evidence.next().unwrap_or_else(|| {
            let outcome = &summary.outcome;
            let nees = outcome
                .reference
                .as_ref()
                .map(|r| format!(", NEES {} (9 if right)", readable(r.nees_mean)));
            let nis = readable(outcome.nis_per_component);
            let withheld = summary
                .withheld
                .as_ref()
                .map(|w| format!(", {}", at_windows(w)));
            format!(
                "NIS {nis} per component over {} fixes{}{}",
                outcome.fixes.used,
                withheld.unwrap_or_default(),
                nees.unwrap_or_default()
            )
        });
        let mut lines = vec![format!("{}{}: {first}", verdict.kind, self.widened())];
        lines.extend(verdict.cause.as_ref().map(cause));
        lines.extend(evidence.take(2));
        lines.extend(summary.mounting.as_ref().map(|m| {
            let [front, right, down] = m.sigma_deg;
            let (roll, pitch, yaw) = (m.roll_deg, m.pitch_deg, m.yaw_deg);
            format!(
                "mounting found: --mounting={roll:.2},{pitch:.2},{yaw:.2}:{front:.2},{right:.2},{down:.2}"
            )
        }));
        lines
    }

    /// ` with position sigmas × 11.9`, where those of the fixes are not as stated.
    fn widened(&self) -> String {
        let factors = ["position", "velocity"]
            .into_iter()
            .zip(self.summary.sigma_factors);
        let parts: Vec<String> = factors
            .filter(|(_, factor)| *factor > 1.0)
            .map(|(part, factor)| format!("{part} sigmas × {factor:.1}"))
            .collect();
        // of what is overconfident the solution may make them
        match parts.is_empty() || self.summary.verdict.kind == VerdictKind::Overconfident {
            true => String::new(),
            false => format!(" with {}", parts.join(", ")),
        }
    }

    /// Advice for an overconfident solution.
    pub(crate) fn advice(&self) -> String {
        let outcome = &self.summary.outcome;
        if let Some(fault) = self.reference_faults.first() {
            return setup_fault(fault);
        }
        let advice = if outcome.reference.is_some() && outcome.nis_per_component < 1.0 {
            "the reference may have other axes or another clock"
        } else {
            "check axes (--mounting), units, start (--initial), clocks (--gnss-delay), antenna (--lever-arm) and stated deviations of the fixes (--gnss-sigma)"
        };
        advice.to_owned()
    }

    /// `0–900 s, 90000 IMU samples at 100.00 Hz, 15 states`
    fn span(&self) -> String {
        let summary = &self.summary;
        let (samples, rate_hz) = (summary.imu_samples, summary.imu_rate_hz);
        let span = window(summary.start_s, summary.end_s);
        let states = summary.filter_states - summary.turn_on_states;
        let turn_on = match summary.turn_on_states {
            0 => String::new(),
            n => format!(" + {n} turn-on"),
        };
        format!("{span}, {samples} IMU samples at {rate_hz:.2} Hz, {states}{turn_on} states")
    }

    /// Consistency and errors, of the filter and smoothed.
    fn figures(&self, document: &mut Document) {
        const OUTAGE: (&str, &str) = ("outage", "{start_s}–{end_s} s");
        document.section("Figures");
        let rows = [
            (
                "NIS per component, {fixes/used} fixes used, {fixes/rejected} rejected, {fixes/withheld} withheld",
                "nis_per_component -",
            ),
            (
                "error over σ at the ends of {ends/count} outages and gaps, rms",
                "ends/error_over_sigma -",
            ),
            (
                "horizontal 1 σ, rms (m)",
                "horizontal_sigma_rms_m smoothed/horizontal_sigma_rms_m",
            ),
            (
                "NEES (9 if right)",
                "reference/nees_mean smoothed/reference/nees_mean",
            ),
            (
                "horizontal RMSE (m)",
                "reference/horizontal_rmse_m smoothed/reference/horizontal_rmse_m",
            ),
            (
                "horizontal error, largest (m)",
                "reference/horizontal_max_m smoothed/reference/horizontal_max_m",
            ),
            (
                "yaw RMSE (°)",
                "reference/rmse/yaw_deg smoothed/reference/rmse/yaw_deg",
            ),
        ];
        let table = Table::of_keys(self, &["", "filter", "smoothed"], &rows);
        document.table(table.without_unknown());
        let mut table = |title: &str, table: Table| {
            if !table.is_empty() {
                document.section(title);
                document.table(table.without_unknown());
            }
        };
        let columns = [
            OUTAGE,
            ("fixes withheld", "fixes_withheld"),
            ("end: from the next fix (m)", "end_from_fix/horizontal_m"),
            ("1 σ", "end_from_fix/expected_sigma_m"),
            ("from the reference (m)", "end_from_reference/horizontal_m"),
            ("1 σ", "end_from_reference/expected_sigma_m"),
        ];
        table("Outages", Table::of(self, "/outages/*", &columns));
        let columns = [
            OUTAGE,
            ("largest 1 σ (m)", "sigma_max_filter_m"),
            ("smoothed", "sigma_max_m"),
            ("largest error (m)", "horizontal_max_filter_m"),
            ("smoothed", "horizontal_max_m"),
        ];
        table(
            "Outages, smoothed",
            Table::of(self, "/smoothed/outages/*", &columns),
        );
        let rows = [
            (
                "wheel scale",
                "vehicle/wheel_scale/value vehicle/wheel_scale/sigma",
            ),
            (
                "mounting pitch (°)",
                "vehicle/mounting_pitch_deg/value vehicle/mounting_pitch_deg/sigma",
            ),
            (
                "mounting yaw (°)",
                "vehicle/mounting_yaw_deg/value vehicle/mounting_yaw_deg/sigma",
            ),
        ];
        table(
            "Vehicle",
            Table::of_keys(self, &["", "value", "1 σ"], &rows),
        );
        let columns = [
            ("aid", "aid"),
            ("used", "count"),
            ("NIS per component", "nis_per_component"),
            ("95 % if right: from", "nis_band/lower"),
            ("to", "nis_band/upper"),
            ("correlation", "whiteness/lag_1"),
        ];
        table("Aids", Table::of(self, "/vehicle/aids/*", &columns));
        let columns = [
            ("state", "@"),
            ("RMSE", "."),
            ("smoothed", "../../../smoothed/reference/rmse/@"),
            ("error over σ, rms", "../../error_over_sigma/@"),
        ];
        table("States", Table::of(self, "/reference/rmse/*", &columns));
    }
}

/// `errors 1.02 ± 0.08 times sigma at the ends of 12 withheld windows of 20 s`
fn at_windows(found: &WithheldWindows) -> String {
    if found.windows == 0 {
        return "too short for windows without fixes".to_owned();
    }
    let (ratio, error) = (found.verdict.ratio, found.verdict.ratio_std_error);
    let length_s = found.length_s;
    let windows = match found.windows {
        1 => "the end of a withheld window".to_owned(),
        n => format!("the ends of {n} withheld windows"),
    };
    format!(
        "errors {} ± {error:.2} times sigma at {windows} of {length_s} s",
        readable(ratio)
    )
}

/// Evidence in a sentence.
fn evidence(finding: &Finding, outages: &[(f64, f64)]) -> String {
    match *finding {
        Finding::NoFix => "no fix used".to_owned(),
        Finding::Start { nis_per_component } => format!(
            "the fixes of the first minute contradict every start (NIS {})",
            readable(nis_per_component)
        ),
        Finding::Direction => "the fixes do not show whether the vehicle goes backwards".to_owned(),
        Finding::NotLevel {
            roll_deg,
            pitch_deg,
        } => {
            format!(
                "axes not front, right, down: roll {roll_deg:.0}°, pitch {pitch_deg:.0}° at the start"
            )
        }
        Finding::Nis { per_component } if per_component > 1.0 => format!(
            "NIS {} per component: fixes {:.1} times as far from the solution as stated",
            readable(per_component),
            per_component.sqrt()
        ),
        Finding::Nis { per_component } => format!(
            "NIS {} per component: the stated errors of the fixes are too large; a reference decides",
            readable(per_component)
        ),
        Finding::Correlated { lag_1, .. } => {
            format!("errors of the fixes last (correlation {lag_1:.2} from one to the next)")
        }
        Finding::Minutes {
            bad,
            of,
            worst_s,
            nis_per_component,
        } => format!(
            "in {bad} of {of} minutes the fixes are too far from the solution: NIS {} after {} s",
            readable(nis_per_component),
            seconds(worst_s)
        ),
        Finding::Ends(ends) => format!(
            "at the ends of {} outages and gaps errors are {:.1} times as large as stated (p = {:.0e})",
            ends.count, ends.error_over_sigma, ends.p_value
        ),
        Finding::Aid {
            aid,
            nis_per_component,
        } => format!(
            "{aid}: NIS {} per component, {:.1} times as far from the solution as stated",
            readable(nis_per_component),
            nis_per_component.sqrt()
        ),
        Finding::Reference { ref verdict } => {
            let line = drive_line(verdict, REPORTED_NAMES.len(), outages);
            format!("against the reference {line}")
        }
        Finding::Withheld(ref found) => {
            let is_undecided = found.verdict.kind == VerdictKind::Undecided;
            let decides = match is_undecided {
                true => format!("; {}", deciding(&found.verdict)),
                false => String::new(),
            };
            format!("{}{decides}", at_windows(found))
        }
    }
}

/// Share of rejected fixes that is worth a warning.
const MANY: f64 = 0.01;
/// Times that a sentence names.
const NAMED: usize = 20;

/// Fixes that were left out, by time.
fn rejected(outliers: &Outliers) -> String {
    let times = |t_s: &[f64]| {
        let named: Vec<String> = t_s.iter().take(NAMED).map(|t| seconds(*t)).collect();
        let more = match t_s.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} more (summary.json)"),
        };
        format!("{} s{more}", named.join(", "))
    };
    let reopened = match outliers.gate_reopened_s.as_slice() {
        [] => String::new(),
        t_s => format!("; too many in a row: used again from {}", times(t_s)),
    };
    format!(
        "{} ({:.1} % of the fixes, --gate): at {}{reopened}",
        counted(outliers.t_s.len(), "outlier"),
        100.0 * outliers.share,
        times(&outliers.t_s)
    )
}

/// Noise that is used instead of the model's, and the line to paste there.
fn own_noise(noise: &ExcessWhiteNoise) -> String {
    let ExcessWhiteNoise {
        sensor,
        times_model,
        sigma2,
    } = noise;
    format!(
        "{sensor}: the recording has {times_model:.1} times the model's white noise: its own is used; to keep it, in [{sensor}] of the model: {{ type = \"WN\", sigma2 = {sigma2:.3e} }}"
    )
}

/// Clocks that are not the same, and the option that makes them so.
fn apart(clocks: &ClocksApart) -> String {
    let [now, then] = clocks.correlation;
    let delay = match clocks.sigma_s {
        Some(sigma_s) => format!("{:.3} (± {sigma_s:.3})", clocks.delay_s),
        None => format!("{:.1}", clocks.delay_s),
    };
    format!(
        "the clocks differ: --gnss-delay={delay} matches the turns (correlation {then:.2}, now {now:.2})"
    )
}

/// A cause and the options that take it away.
fn cause(cause: &InnovationCause) -> String {
    let three = |v: DVec3| format!("{:.2},{:.2},{:.2}", v.x, v.y, v.z);
    match cause {
        InnovationCause::Clocks(clocks) => apart(clocks),
        InnovationCause::Displaced(found) => {
            let options: Vec<_> = found
                .lever_arm_b
                .map(|[arm, sigma]| format!("--lever-arm={} (± {})", three(arm), three(sigma)))
                .into_iter()
                .chain(
                    found
                        .delay_s
                        .map(|[delay, sigma]| format!("--gnss-delay={delay:.3} (± {sigma:.3})")),
                )
                .collect();
            let [now, then] = found.nis;
            let (now, then) = (readable(now), readable(then));
            format!(
                "the fixes agree with {}: NIS {then}, now {now}",
                options.join(" ")
            )
        }
    }
}

// A fusion drawn: track, position, errors, innovations.

/// Velocities of a reference that are known worse than this are not drawn: its positions jump (m/s).
const UNEVEN: f64 = 0.5;

const POSITION: &str = "Dashed: horizontal 1 σ stated. Line: distance from the reference.";
const ERRORS: &str = "Lines: solution minus reference. Bands: ± 3 σ as stated.";
const FIXES: &str = "A consistent filter has 95 % of the used fixes in the band.";

/// Colour of what is smoothed.
const SMOOTHED: Colour = Colour::Hue(2);

fn map(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let place = |row: &SolutionRow| {
        let NavState { lat, lon, h, .. } = row.state;
        let moved = ned_difference(solution.rows[0].state.place(), [lat, lon, h]);
        [moved.y, moved.x]
    };
    let track = solution.rows.iter().map(|row| (row.t_s, place(row)));
    track_map("solution", &track.collect::<Vec<_>>(), "Track", outages)
}

/// Rows of the filter, and smoothed ones: names of what is stated and of the error, colours. A panel has room for three
/// names in its legend.
fn solutions(solution: &Solution) -> Vec<(&[SolutionRow], [&'static str; 2], [Colour; 2])> {
    let rows = solution.rows.as_slice();
    match solution.smoothed.as_deref() {
        None => vec![(rows, ["stated", "error"], [Colour::BELIEVED, Colour::REAL])],
        Some(smoothed) => {
            vec![
                (rows, ["filter"; 2], [Colour::REAL; 2]),
                (smoothed, ["smoothed"; 2], [SMOOTHED; 2]),
            ]
        }
    }
}

fn position(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let mut series = Vec::new();
    for (rows, [stated, error], [believed, real]) in solutions(solution) {
        series.push(Series::dashed(
            stated,
            believed,
            rows.iter()
                .map(|row| (row.t_s, row.sigma[0].hypot(row.sigma[1])))
                .collect(),
        ));
        let errors = rows
            .iter()
            .filter_map(|row| Some((row.t_s, row.error?.values[0].hypot(row.error?.values[1]))));
        let errors: Vec<_> = errors.collect();
        series.extend((!errors.is_empty()).then(|| Series::line(error, real, errors)));
    }
    Chart::over_time(
        "Horizontal position",
        vec![Panel::new(ChartAxis::log("horizontal (m)"), series)],
        outages,
    )
}

fn errors(solution: &Solution, outages: &[(f64, f64)]) -> Vec<Chart> {
    let row = |row: &SolutionRow| {
        let mut values = row.error.map_or([f64::NAN; REPORTED], |e| e.values);
        if row.error.is_some_and(|e| e.velocity_sigma >= UNEVEN) {
            values[3..6].fill(f64::NAN);
        }
        (row.t_s, values, row.sigma)
    };
    let sets: Vec<_> = solutions(solution)
        .into_iter()
        .map(|(rows, names, colours)| (rows.iter().map(row).collect(), names, colours))
        .collect();
    error_charts(&sets, outages)
}

fn innovations(solution: &Solution, outages: &[(f64, f64)]) -> Chart {
    let panel = |(i, name): (usize, &str)| {
        let normalised = |f: &FixRecord| {
            f.innovation
                .get(i)
                .zip(f.sigma.get(i))
                .map_or(f64::NAN, |(x, s)| x / s)
        };
        let mut series = vec![Series::new(
            "95 % band",
            Colour::RIGHT,
            Mark::Zone(-1.96, 1.96),
        )];
        for (fate, name, colour) in [
            ((true, false), "used", Colour::BELIEVED),
            ((false, false), "withheld", Colour::Soft),
            ((false, true), "rejected", Colour::REAL),
        ] {
            let of_fate = solution.fixes.iter();
            let of_fate = of_fate.filter(|f| (f.used, f.rejected_above.is_some()) == fate);
            let points: Vec<_> = of_fate.map(|f| (f.t_s, normalised(f), f64::NAN)).collect();
            series.extend((!points.is_empty()).then(|| Series::points(name, colour, points)));
        }
        Panel::new(
            ChartAxis::linear(&format!("{name} (σ)")).including(-3.0, 3.0),
            series,
        )
        .of_height(0.55)
    };
    Chart::over_time(
        "Innovations of position, normalised",
        ["north", "east", "down"]
            .into_iter()
            .enumerate()
            .map(panel)
            .collect(),
        outages,
    )
}
