//! `report.html`: one page with everything inside it.

use super::manifest::Manifest;
use super::number::{readable, seconds};
use super::svg::{Line, Plot, Scale, escape};
use super::verdict::{verdict_line, verdict_word};
use crate::metrics::{EpochMetrics, Estimate, OutageSummary, PerState, Summary};
use crate::simulation::REPORTED;
use std::fmt::Write as _;

/// The reported states, in words.
const TITLES: [&str; REPORTED] = [
    "position north (m)",
    "position east (m)",
    "position down (m)",
    "velocity north (m/s)",
    "velocity east (m/s)",
    "velocity down (m/s)",
    "roll (degrees)",
    "pitch (degrees)",
    "yaw (degrees)",
];

const STYLE: &str = include_str!("report.css");

/// The page of a run directory.
pub(super) fn run_page(epochs: &[EpochMetrics], summary: &Summary, manifest: &Manifest) -> String {
    let mut body = String::new();
    head(manifest, summary, &mut body);
    accuracy(summary, &mut body);
    outages(&summary.outages, &mut body);
    consistency(summary, &mut body);
    let stripes = summary.outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let plots = Plots { stripes, epochs };
    plots.states("Position", 0, &mut body);
    plots.states("Attitude", 6, &mut body);
    plots.states("Velocity", 3, &mut body);
    plots.consistency(summary, &mut body);
    provenance(manifest, &mut body);
    page("nav-sim run", &body)
}

/// A whole page around a body.
fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        escape(title)
    )
}

fn head(manifest: &Manifest, summary: &Summary, body: &mut String) {
    let input = |role: &str| manifest.inputs.iter().find(|i| i.role == role).map_or("", |i| i.path.as_str());
    let truth = match (input("static"), input("truth")) {
        ("", "") => input("model"),
        ("", model) => model,
        (recording, _) => recording,
    };
    let figures = [
        ("trajectory", input("trajectory").to_owned()),
        ("model of the filter", input("model").to_owned()),
        ("what makes the errors", truth.to_owned()),
    ];
    let runs = [
        ("runs", format!("{} ({} diverged)", summary.runs, summary.diverged)),
        ("independent runs", readable(summary.independent_runs)),
    ];
    let rest = [("filter states", summary.filter_states.to_string()), ("seed", summary.seed.to_string())];
    let is_sampled = summary.runs > 0;
    let runs = runs.into_iter().filter(|_| is_sampled);
    let windows: Vec<(f64, f64)> = summary.outages.iter().map(|o| (o.start_s, o.end_s)).collect();
    let verdict = verdict_line(&summary.verdict, &windows, summary.runs, summary.diverged);
    *body += if is_sampled {
        "<h1>INS/GNSS Monte-Carlo run</h1>\n"
    } else {
        "<h1>INS/GNSS covariance analysis</h1>\n"
    };
    let class = verdict_word(summary.verdict.kind);
    let _ = writeln!(body, "<p class=\"verdict {class}\">The filter is {}</p>", escape(&verdict));
    *body += "<dl>\n";
    for (name, value) in figures.into_iter().chain(runs).chain(rest) {
        let _ = writeln!(body, "<dt>{name}</dt><dd>{}</dd>", escape(&value));
    }
    *body += "</dl>\n";
}

fn outages(outages: &[OutageSummary], body: &mut String) {
    if outages.is_empty() {
        return;
    }
    *body += "<h2>Outages</h2>\n<p>Horizontal errors just before the first fix after the outage; brackets are \
              95 % intervals.</p>\n";
    let mut head = vec!["".to_owned()];
    head.extend(outages.iter().map(window));
    let mut rows = vec![head];
    let mut row = |name: &str, cell: &dyn Fn(&OutageSummary) -> String| {
        let cells = outages.iter().map(cell);
        rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    };
    let interval = |ci: (Option<f64>, Option<f64>)| {
        let bound = |b: Option<f64>| b.map_or("–".to_owned(), readable);
        format!("[{}, {}]", bound(ci.0), bound(ci.1))
    };
    row("horizontal error, median (m)", &|o| {
        let h = &o.horizontal_error_end_m;
        format!("{} {}", readable(h.p50), interval(h.p50_ci95))
    });
    row("horizontal error, 95 % (m)", &|o| {
        let h = &o.horizontal_error_end_m;
        format!("{} {}", readable(h.p95), interval(h.p95_ci95))
    });
    if outages.iter().any(|o| o.horizontal_error_end_m.p999.is_some()) {
        row("horizontal error, 99.9 % (m)", &|o| readable(o.horizontal_error_end_m.p999.unwrap_or(f64::NAN)));
    } else {
        row("horizontal error, largest (m)", &|o| readable(o.horizontal_error_end_m.max));
    }
    row("re-convergence, median (s)", &|o| readable(o.reconvergence_s.p50));
    table(&rows, body);
    *body += "<h3>Just before the first fix after the outage</h3>\n";
    let at_end = |o: &OutageSummary| Pair {
        name: window(o),
        rmse: o.rmse_end,
        rmse_std_error: o.rmse_end_std_error,
        asee: o.asee_end,
    };
    pairs(&outages.iter().map(at_end).collect::<Vec<_>>(), body);
    *body += "<h3>Mean over the outage</h3>\n";
    let over_all = |o: &OutageSummary| Pair {
        name: window(o),
        rmse: o.rmse_mean,
        rmse_std_error: o.rmse_mean_std_error,
        asee: o.asee_mean,
    };
    pairs(&outages.iter().map(over_all).collect::<Vec<_>>(), body);
    budgets(outages, body);
}

/// What the errors at the ends of outages are made of, beside what the filter believes.
fn budgets(outages: &[OutageSummary], body: &mut String) {
    for o in outages {
        let both = [("true errors", &o.budget), ("what the filter believes", &o.believed_budget)];
        for (of, budget) in both {
            let Some(budget) = budget else { continue };
            let _ = writeln!(body, "<h3>Sources of errors at the end of {}: {of} (%)</h3>", window(o));
            let head = std::iter::once("").chain(TITLES).map(str::to_owned).collect();
            let percent = |share: &f64| format!("{:.1}", 100.0 * share);
            let row = |(name, of): &(String, PerState<f64>)| {
                std::iter::once(name.clone()).chain(of.0.iter().map(percent)).collect()
            };
            let rows: Vec<Vec<String>> = std::iter::once(head).chain(budget.shares.iter().map(row)).collect();
            table(&rows, body);
        }
    }
}

fn window(o: &OutageSummary) -> String {
    format!("{}–{} s", seconds(o.start_s), seconds(o.end_s))
}

/// Means over the run.
fn accuracy(summary: &Summary, body: &mut String) {
    *body += "<h2>Accuracy</h2>\n<p>RMSE: how wrong the runs were. ASEE (averaged standard estimation error): the \
              filter's own standard deviation, averaged over the runs. Their ratio is 1 if the filter is right. \
              ± is one Monte-Carlo standard error.</p>\n";
    let a = &summary.accuracy;
    let name = "mean over the run".to_owned();
    let whole = Pair { name, rmse: a.rmse_mean, rmse_std_error: a.rmse_mean_std_error, asee: a.asee_mean };
    pairs(&[whole], body);
}

/// How wrong the runs were and how wrong the filter believed them to be, both at the same time.
struct Pair {
    /// When.
    name: String,
    rmse: PerState<f64>,
    rmse_std_error: PerState<f64>,
    asee: PerState<f64>,
}

/// State by state.
fn pairs(pairs: &[Pair], body: &mut String) {
    let mut head = vec!["".to_owned()];
    for pair in pairs {
        head.extend(["RMSE", "ASEE", "RMSE/ASEE"].map(|what| format!("{what}, {}", pair.name)));
    }
    let mut rows = vec![head];
    for (i, title) in TITLES.iter().enumerate() {
        let mut row = vec![(*title).to_owned()];
        for pair in pairs {
            let (rmse, error, asee) = (pair.rmse.0[i], pair.rmse_std_error.0[i], pair.asee.0[i]);
            row.push(format!("{} ± {}", readable(rmse), readable(error)));
            row.push(readable(asee));
            row.push(format!("{} ± {}", readable(rmse / asee), readable(error / asee)));
        }
        rows.push(row);
    }
    table(&rows, body);
}

fn consistency(summary: &Summary, body: &mut String) {
    let (nees, nis, coverage) = (&summary.nees, &summary.nis, &summary.coverage);
    let band = |low: f64, high: f64| format!("[{}, {}]", readable(low), readable(high));
    let share = |x: f64| if x.is_finite() { format!("{:.0} %", x * 100.0) } else { "–".to_owned() };
    let rows = [
        ["", "mean", "if the filter is right", "95 % band", "epochs inside"].map(str::to_owned).to_vec(),
        vec![
            "NEES (position, velocity, attitude), per epoch".to_owned(),
            readable(nees.mean),
            nees.dof.to_string(),
            band(nees.lower95, nees.upper95),
            share(nees.fraction_inside),
        ],
        vec![
            format!("NIS, all {} fixes", nis.fixes),
            readable(nis.mean),
            nis.dof.to_string(),
            band(nis.lower95, nis.upper95),
            String::new(),
        ],
        vec![
            "coverage (position, attitude), per epoch".to_owned(),
            readable(coverage.mean),
            coverage.level.to_string(),
            band(coverage.lower95, coverage.upper95),
            share(coverage.fraction_inside),
        ],
    ];
    *body += "<h2>Consistency</h2>\n";
    table(&rows, body);
}

struct Plots<'a> {
    /// Outages.
    stripes: Vec<(f64, f64)>,
    epochs: &'a [EpochMetrics],
}

impl Plots<'_> {
    fn curve(&self, label: &str, class: &'static str, y: impl Fn(&EpochMetrics) -> f64) -> Line {
        let points = self.epochs.iter().map(|e| (e.t_s, y(e))).collect();
        Line { label: label.to_owned(), class, points }
    }

    /// Three states from `first`: what the filter believes (ASEE) and how wrong it is (RMSE).
    fn states(&self, title: &str, first: usize, body: &mut String) {
        let _ = writeln!(body, "<h2>{title}</h2>");
        for state in first..first + 3 {
            let value =
                |of: fn(&EpochMetrics) -> &PerState<Estimate>| move |e: &EpochMetrics| of(e).0[state].value;
            let lines = vec![
                self.curve("RMSE", "rmse", value(|e| &e.rmse)),
                self.curve("ASEE", "asee", value(|e| &e.asee)),
            ];
            *body += &self.plot(TITLES[state], Scale::Log, lines).render();
        }
    }

    fn consistency(&self, summary: &Summary, body: &mut String) {
        *body += "<h2>Consistency over time</h2>\n";
        let nees = vec![self.curve("NEES", "asee", |e| e.nees.value)];
        let band = Some((summary.nees.lower95, summary.nees.upper95));
        *body += &Plot { band, ..self.plot("NEES and where a right filter keeps it", Scale::Linear, nees) }
            .render();
        let coverage = vec![self.curve("coverage", "asee", |e| e.coverage)];
        let band = Some((summary.coverage.lower95, summary.coverage.upper95));
        let title = format!("coverage at level {}", summary.coverage.level);
        *body += &Plot { band, ..self.plot(&title, Scale::Linear, coverage) }.render();
    }

    fn plot(&self, title: &str, scale: Scale, lines: Vec<Line>) -> Plot {
        let stripes = self.stripes.clone();
        Plot { title: title.to_owned(), scale, include: None, stripes, band: None, lines }
    }
}

fn provenance(manifest: &Manifest, body: &mut String) {
    *body += "<h2>Provenance</h2>\n";
    // the command, the threads and the time taken are in manifest.json: this page is the same for the same seed
    let _ = writeln!(body, "<p>nav-sim {}; the command is in manifest.json</p>", escape(&manifest.version));
    let mut rows = vec![["input", "file", "BLAKE3"].map(str::to_owned).to_vec()];
    rows.extend(manifest.inputs.iter().map(|i| vec![i.role.clone(), i.path.clone(), i.blake3.clone()]));
    table(&rows, body);
    let configuration = toml::to_string_pretty(&manifest.configuration).unwrap_or_default();
    let _ = writeln!(
        body,
        "<details><summary>Configuration</summary><pre>{}</pre></details>",
        escape(&configuration)
    );
}

/// A table whose first row is its head.
fn table(rows: &[Vec<String>], body: &mut String) {
    *body += "<div class=\"scroll\"><table>\n";
    for (i, row) in rows.iter().enumerate() {
        let tag = if i == 0 { "th" } else { "td" };
        let cells = row.iter().map(|c| format!("<{tag}>{}</{tag}>", escape(c))).collect::<String>();
        let _ = writeln!(body, "<tr>{cells}</tr>");
    }
    *body += "</table></div>\n";
}
