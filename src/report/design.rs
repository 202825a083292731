//! What a calibration that is not made yet would tell, on one screen.

use super::number::{readable, seconds, window};
use serde::Serialize;

/// What so many recordings, so long each, would tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Design {
    /// Recordings.
    pub recordings: usize,
    /// Length of each (h).
    pub hours: f64,
    /// Every parameter.
    pub parameters: Vec<DesignedParameter>,
    /// The horizontal p95 at the end of each outage.
    pub horizontal_p95: Vec<DesignedQuantile>,
}

/// The interval that a parameter would have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DesignedParameter {
    /// `accel`, or `accel.x` alone.
    pub signals: String,
    /// `WN sigma2`, `AR1_1 correlation_time_s`.
    pub parameter: String,
    /// Its value (units of the model file; s).
    pub value: f64,
    /// Expected 95 % interval; none where the recordings would not determine it.
    pub ci95: Option<[f64; 2]>,
    /// Half of its width over the value (%).
    pub half_width_pct: Option<f64>,
    /// The same of endless recordings, where parameters vary between them: what no length takes away.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endless_half_width_pct: Option<f64>,
}

impl DesignedParameter {
    /// `accel WN sigma2`
    pub(super) fn name(&self) -> String {
        format!("{} {}", self.signals, self.parameter)
    }
}

/// The interval that the horizontal p95 at an outage's end would have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct DesignedQuantile {
    /// First instant without a fix (s).
    pub start_s: f64,
    /// First instant with a fix again (s).
    pub end_s: f64,
    /// The quantile with the model as it is (m).
    pub p95_m: f64,
    /// Expected 95 % interval (m).
    pub ci95: [f64; 2],
    /// Half of its width over the value (%).
    pub half_width_pct: f64,
}

/// What stands between the interval to expect and that of one calibration. Of 400 to 1000 simulated intervals of a random walk
/// (white noise and random walk, four recordings of three axes; ± 57 to ± 102 % to expect by 2000 draws) the median was
/// 0.83 to 0.88 of that, the mean 0.92 to 0.95, and 32 to 33 % were wider (AWV and DR-AWV); those of white noise were 0.93
/// to 0.98 of it. All of them held the truth in 96 to 98.5 % of the cases: a scatter read off twelve signals is more often
/// less than more, for which Student's quantile makes amends.
const STATED: &str = "what one calibration states scatters: for a parameter known to ± 100 % half the intervals are below 0.85 of this, one in \
     three above";

/// A part of an interval this large is nearly all of it.
const NEARLY_ALL: f64 = 0.8;

impl Design {
    /// The parameters whose intervals are nearly all due to what recordings differ by: longer ones tell no more.
    pub(crate) fn lengths_do_not_help(&self) -> impl Iterator<Item = &DesignedParameter> {
        let is_floor = |p: &&DesignedParameter| {
            p.endless_half_width_pct
                .zip(p.half_width_pct)
                .is_some_and(|(floor, all)| floor >= NEARLY_ALL * all)
        };
        self.parameters.iter().filter(is_floor)
    }
}

impl Design {
    /// The parameter that would be known least: its name, and how well.
    pub(crate) fn least_known(&self) -> String {
        let open = self.parameters.iter().filter(|p| p.half_width_pct.is_none()).count();
        let widest = self.parameters.iter().filter(|p| p.half_width_pct.is_some());
        let widest = widest.max_by(|a, b| a.half_width_pct.partial_cmp(&b.half_width_pct).expect("numbers"));
        let widest = widest.map(|p| format!("{} {}", p.name(), percent(p.half_width_pct)));
        match (open, widest) {
            (0, Some(widest)) => widest,
            (open, Some(widest)) => format!("{widest}; {open} not determined"),
            (_, None) => "not determined".to_owned(),
        }
    }

    /// What lengths do not help, in words.
    pub(super) fn floor(&self) -> Option<String> {
        let names: Vec<String> = self.lengths_do_not_help().map(DesignedParameter::name).collect();
        (!names.is_empty()).then(|| {
            format!(
                "more hours will not help {} of {} parameters ({}, …): the recordings differ among themselves; more \
                 recordings will",
                names.len(),
                self.parameters.len(),
                names[0]
            )
        })
    }

    fn p95(&self) -> Vec<String> {
        let line = |q: &DesignedQuantile| {
            let [low, high] = q.ci95.map(readable);
            let window = window(q.start_s, q.end_s);
            let half = readable(q.half_width_pct);
            format!(
                "horizontal p95 at the end of {window}: {} m ± {half} % [{low}, {high}]",
                readable(q.p95_m)
            )
        };
        self.horizontal_p95.iter().map(line).collect()
    }

    /// The verdict: the parameter known least, and the horizontal error.
    pub(crate) fn verdict(&self) -> Vec<String> {
        let head = format!(
            "{} recordings of {} h; the parameter known least: {}",
            self.recordings,
            self.hours,
            self.least_known()
        );
        std::iter::once(head).chain(self.p95()).chain(self.floor()).chain([STATED.to_owned()]).collect()
    }
}

fn percent(half_width: Option<f64>) -> String {
    half_width.map_or("not determined".to_owned(), |half| format!("± {} %", readable(half)))
}

/// The verdict on one design, or on several.
pub(crate) fn design_verdict(designs: &[Design]) -> String {
    if let [design] = designs {
        return design.verdict().join("\n");
    }
    let head = "half of the 95 % intervals to expect".to_owned();
    let floor = designs.last().and_then(Design::floor).map(|floor| format!("with the most hours, {floor}"));
    std::iter::once(head).chain(floor).chain([STATED.to_owned()]).collect::<Vec<_>>().join("\n")
}

/// Every parameter of one design, or a row for each of several; the first row is the head.
pub(crate) fn design_rows(designs: &[Design]) -> Vec<Vec<String>> {
    if let [design] = designs { parameter_rows(design) } else { grid_rows(designs) }
}

fn parameter_rows(design: &Design) -> Vec<Vec<String>> {
    let varies = design.parameters.iter().any(|p| p.endless_half_width_pct.is_some());
    let mut titles = vec!["parameter", "value", "95 % interval to expect", ""];
    titles.extend(varies.then_some("however long they are"));
    let mut rows: Vec<Vec<String>> = vec![titles.into_iter().map(str::to_owned).collect()];
    for p in &design.parameters {
        let ends =
            p.ci95.map_or(String::new(), |[low, high]| format!("{} … {}", readable(low), readable(high)));
        let mut row = vec![p.name(), readable(p.value), ends, percent(p.half_width_pct)];
        if varies {
            row.push(p.endless_half_width_pct.map_or("0 %".to_owned(), |half| percent(Some(half))));
        }
        rows.push(row);
    }
    rows
}

fn grid_rows(designs: &[Design]) -> Vec<Vec<String>> {
    let windows = designs.first().into_iter().flat_map(|d| &d.horizontal_p95);
    let windows = windows.map(|q| format!("p95 at {} s", seconds(q.end_s)));
    let titles = ["recordings", "hours", "parameter known least"].map(str::to_owned);
    let mut rows: Vec<Vec<String>> = vec![titles.into_iter().chain(windows).collect()];
    for design in designs {
        let mut row = vec![design.recordings.to_string(), readable(design.hours), design.least_known()];
        row.extend(design.horizontal_p95.iter().map(|q| percent(Some(q.half_width_pct))));
        rows.push(row);
    }
    rows
}
