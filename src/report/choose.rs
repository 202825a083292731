//! The ranking of candidates, on one screen and as JSON.

use super::number::{readable, window};
use crate::choose::{Influence, Mean, Placed, Ranking};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::NEES_DOF;
use serde::Serialize;

/// Share of the largest influence from which on a scale decides.
const DECISIVE: f64 = 0.25;
/// Version of the layout of `ranking.json`.
const SCHEMA_VERSION: u32 = 1;

/// What was compared, where, and what came of it.
#[derive(Debug, Clone)]
pub(crate) struct ChoiceReport<'a> {
    /// The candidates.
    pub ranking: &'a Ranking,
    /// What decides the error, where it was asked.
    pub influence: Option<&'a Influence>,
    /// The outages at whose ends they are judged.
    pub outages: &'a [Outage],
    /// The trajectory, as it was named.
    pub trajectory: &'a str,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// One ranking of a study, in words and as JSON.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RankedPlace {
    /// Trajectory, scenario, receiver and outages.
    pub name: String,
    /// What the data say.
    pub verdict: Vec<String>,
    /// A row for each candidate under a head.
    pub rows: Vec<Vec<String>>,
    /// What the marks of the table mean.
    pub legend: String,
    /// As in `ranking.json`, and `place`.
    pub json: serde_json::Value,
}

/// `ranking.json`.
#[derive(Serialize)]
struct RankingFile<'a> {
    schema_version: u32,
    verdict: Vec<String>,
    winner: &'a str,
    /// Candidates that the data cannot tell from the winner.
    tied: Vec<&'a str>,
    trajectory: &'a str,
    outages: &'a [Outage],
    seed: u64,
    #[serde(flatten)]
    ranking: &'a Ranking,
    #[serde(skip_serializing_if = "Option::is_none")]
    influence: Option<&'a Influence>,
}

impl ChoiceReport<'_> {
    /// The verdict, a sentence or two a line: the winner, what cannot be told from it, which recordings decide.
    pub(crate) fn verdict(&self) -> Vec<String> {
        let ranking = self.ranking;
        let mut lines = vec![self.best()];
        let tied: Vec<&str> = self.tied().collect();
        if ranking.tells && !tied.is_empty() {
            lines.push(format!("cannot be told from it: {}", tied.join("; ")));
        }
        lines.extend(self.dishonest());
        if !ranking.undescribed.is_empty() {
            // what most of the recordings have is not one recording's fault
            let cure = if 2 * ranking.undescribed.len() > ranking.winner().folds.len() {
                "something moves in most of them: where it is a warm-up at their beginning, --skip-s auto leaves it out"
            } else {
                "look at it with nav-sim calibrate --verbose, and run again with --skip-s auto (a warm-up) or without it"
            };
            lines.push(format!(
                "no candidate describes {}: errors are far larger than every filter believes; {cure}",
                ranking.undescribed.join(", ")
            ));
        }
        if !ranking.decisive.is_empty() {
            lines.push(format!(
                "without {} another candidate would win",
                ranking.decisive.join(", or without ")
            ));
        }
        if ranking.winner().folds.iter().any(|fold| fold.windows == 0) {
            lines.push(
                "recordings shorter than the trajectory are judged by covariance analysis with their own N2 as truth"
                    .to_owned(),
            );
        }
        lines
    }

    /// The winner, and whether the data can tell that it is.
    fn best(&self) -> String {
        let winner = self.ranking.winner();
        let recordings = winner.folds.len();
        let figures = format!(
            "{} m of horizontal RMSE at the end of an outage where its filter believes {} m, NEES {} (9 if right)",
            readable(winner.rmse_m),
            readable(winner.believed_m),
            readable(winner.nees.value)
        );
        let eligible = self.ranking.candidates.iter().filter(|p| p.eligible).count();
        match (self.ranking.tells, eligible) {
            (_, 1) => format!("{}: {figures}; there is no other candidate", winner.candidate),
            (true, _) => format!("{} is the best: {figures}", winner.candidate),
            (false, _) if recordings < 4 => format!(
                "{recordings} recordings cannot tell the candidates apart; {} has the highest score: {figures}",
                winner.candidate
            ),
            (false, _) => format!(
                "the recordings differ more than the candidates do: the data cannot tell; {} has the highest score: \
                 {figures}",
                winner.candidate
            ),
        }
    }

    /// The candidates whose filters believe too little or too much.
    fn dishonest(&self) -> Vec<String> {
        let right = NEES_DOF as f64;
        let line = |word: &str, is_so: &dyn Fn(&Placed) -> bool| {
            let all = self.ranking.candidates.iter().filter(|p| p.eligible && is_so(p));
            let names = all.map(|p| p.candidate.as_str()).collect::<Vec<_>>().join("; ");
            (!names.is_empty()).then(|| format!("{word} (NEES over the recordings): {names}"))
        };
        let over = line("overconfident", &|p| p.nees.ci95.0 > right);
        let under = line("underconfident", &|p| p.nees.ci95.1 < right);
        over.into_iter().chain(under).collect()
    }

    /// A row for each candidate under a head.
    pub(crate) fn rows(&self) -> Vec<Vec<String>> {
        let head = [
            "candidate",
            "RMSE (m)",
            "against the best (%)",
            "believed (m)",
            "NEES (9)",
            "coverage",
            "log score (nats)",
        ];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        rows.extend(self.ranking.candidates.iter().map(|p| self.row(p)));
        rows
    }

    /// The table as a terminal of 120 columns and a few lines shows it: the best, and what decides.
    pub(crate) fn brief_rows(&self) -> Vec<Vec<String>> {
        const SHOWN: usize = 9;
        let brief = |row: Vec<String>| {
            let kept = |(column, cell)| (![BELIEVED, COVERAGE].contains(&column)).then_some(cell);
            row.into_iter().enumerate().filter_map(kept).collect::<Vec<String>>()
        };
        let mut rows: Vec<Vec<String>> = self.rows().into_iter().take(1 + SHOWN).map(brief).collect();
        let more = self.ranking.candidates.len().saturating_sub(SHOWN);
        if more > 0 {
            let mut rest = vec![String::new(); rows[0].len()];
            rest[0] = format!("… and {more} more");
            rows.push(rest);
        }
        rows
    }

    fn row(&self, placed: &Placed) -> Vec<String> {
        let is_winner = placed.index == self.ranking.winner().index;
        let mark = match (is_winner, placed.eligible, placed.tied) {
            (true, ..) => " *",
            (_, false, _) => " †",
            (_, _, true) => " =",
            _ => "",
        };
        let against = |mean: &Mean| {
            if is_winner {
                "–".to_owned()
            } else if mean.value.is_infinite() {
                // an error that the filter held for impossible
                "−∞".to_owned()
            } else {
                let [value, low, high] = [mean.value, mean.ci95.0, mean.ci95.1].map(signed_few);
                format!("{value} [{low}, {high}]")
            }
        };
        vec![
            format!("{}{mark}", placed.candidate),
            readable(placed.rmse_m),
            against(&placed.difference.rmse_pct),
            readable(placed.believed_m),
            format!("{} [{}, {}]", few(placed.nees.value), few(placed.nees.ci95.0), few(placed.nees.ci95.1)),
            placed.coverage.map_or("–".to_owned(), |c| format!("{c:.2}")),
            if is_winner {
                format!("{:.2}", placed.log_score.value)
            } else {
                against(&placed.difference.log_score)
            },
        ]
    }

    /// What the marks of the table mean.
    pub(crate) fn legend(&self) -> String {
        let recordings = self.ranking.winner().folds.len();
        let ends: Vec<String> = self.outages.iter().map(|o| window(o.start_s, o.end_s)).collect();
        format!(
            "{recordings} recordings, each left out once; [95 % over recordings]; horizontal RMSE at the ends of the outages \
             {}\n* best log score, the others relative to it; = not distinguishable from it, given the number of candidates; † of one recording; NEES 9, coverage 0.95 if \
             the filter is right",
            ends.join(", ")
        )
    }

    /// Recording by recording: NEES and log score of every candidate.
    pub(crate) fn fold_rows(&self) -> Vec<Vec<String>> {
        let winner = self.ranking.winner();
        let mut head = vec!["NEES (log score, nats)".to_owned()];
        head.extend(winner.folds.iter().map(|fold| fold.recording.clone()));
        let row = |p: &Placed| {
            let cell = |fold: &crate::choose::FoldScore| {
                format!("{} ({:.1})", readable(fold.score.nees), fold.score.log_score)
            };
            std::iter::once(p.candidate.clone()).chain(p.folds.iter().map(cell)).collect()
        };
        std::iter::once(head).chain(self.ranking.candidates.iter().map(row)).collect()
    }

    /// Which scales of which sensors decide: a line each, those of a quarter of the largest influence or more.
    pub(crate) fn decisive_scales(&self) -> Vec<String> {
        let scales = self.influence.map_or(&[][..], |influence| &influence.scales);
        let largest = scales.iter().map(|s| s.on_error.abs()).fold(0.0, f64::max);
        let mut lines: Vec<String> = Vec::new();
        for (i, first) in scales.iter().enumerate() {
            if scales[..i].iter().any(|s| s.signals == first.signals) {
                continue;
            }
            let of_signals: Vec<_> = scales.iter().filter(|s| s.signals == first.signals).collect();
            // the scales around the one that counts most
            let decides = |s: &&crate::choose::ScaleInfluence| s.on_error >= DECISIVE * largest;
            let peak = (0..of_signals.len())
                .max_by(|a, b| of_signals[*a].on_error.total_cmp(&of_signals[*b].on_error))
                .unwrap_or(0);
            let before = of_signals[..peak].iter().rev().take_while(|s| decides(s)).count();
            let felt: Vec<_> = of_signals[peak - before..].iter().take_while(|s| decides(s)).collect();
            let sum: f64 = of_signals.iter().map(|s| s.on_error).sum();
            let range = match (felt.first(), felt.last()) {
                (Some(from), Some(to)) => {
                    format!("mostly from {} to {} s", readable(from.tau_s), readable(to.tau_s))
                }
                _ => "and no scale decides".to_owned(),
            };
            lines.push(format!(
                "{}: 1 % more wavelet variance at all scales is {} % more horizontal error, {range}",
                first.signals,
                signed(sum)
            ));
        }
        lines
    }

    /// Scale by scale under a head.
    pub(crate) fn scale_rows(&self) -> Vec<Vec<String>> {
        let head = ["signals", "scale (s)", "% of horizontal error for 1 % of wavelet variance"];
        let row = |s: &crate::choose::ScaleInfluence| {
            vec![s.signals.clone(), readable(s.tau_s), signed(s.on_error)]
        };
        let head = head.map(str::to_owned).to_vec();
        std::iter::once(head).chain(self.influence.iter().flat_map(|i| &i.scales).map(row)).collect()
    }

    /// Recording by recording under a head.
    pub(crate) fn recording_rows(&self) -> Vec<Vec<String>> {
        let head = ["adds to the expected horizontal error (%)", "awv", "sr-awv", "dr-awv"];
        let row = |r: &crate::choose::RecordingInfluence| {
            let adds = [r.awv_pct, r.sr_awv_pct, r.dr_awv_pct].map(signed);
            std::iter::once(r.recording.clone()).chain(adds).collect()
        };
        let head = head.map(str::to_owned).to_vec();
        std::iter::once(head).chain(self.influence.iter().flat_map(|i| &i.recordings).map(row)).collect()
    }

    fn tied(&self) -> impl Iterator<Item = &str> {
        let others = self.ranking.candidates.iter().skip(1);
        others.filter(|p| p.eligible && p.tied).map(|p| p.candidate.as_str())
    }

    /// `ranking.json`.
    pub(crate) fn json(&self) -> String {
        super::json(&self.file())
    }

    /// The same as one of several rankings.
    pub(crate) fn of_place(&self, name: String) -> RankedPlace {
        let mut json = serde_json::to_value(self.file()).expect("plain structs are always JSON");
        json["place"] = name.as_str().into();
        RankedPlace { name, verdict: self.verdict(), rows: self.rows(), legend: self.legend(), json }
    }

    fn file(&self) -> RankingFile<'_> {
        RankingFile {
            schema_version: SCHEMA_VERSION,
            verdict: self.verdict(),
            winner: &self.ranking.winner().candidate,
            tied: self.tied().collect(),
            trajectory: self.trajectory,
            outages: self.outages,
            seed: self.seed,
            ranking: self.ranking,
            influence: self.influence,
        }
    }
}

/// Columns of [`ChoiceReport::rows`] that a terminal does not show unless asked.
const BELIEVED: usize = 3;
const COVERAGE: usize = 5;

/// A number in a table that is wide enough already: two decimals at most.
fn few(x: f64) -> String {
    let decimals = match x.abs() {
        size if size < 10.0 => 2,
        size if size < 100.0 => 1,
        _ => 0,
    };
    format!("{x:.decimals$}")
}

/// The same with its sign.
fn signed_few(x: f64) -> String {
    let shown = few(x);
    if x > 0.0 { format!("+{shown}") } else { shown }
}

/// A number with its sign.
fn signed(x: f64) -> String {
    let shown = readable(x);
    if x > 0.0 && x.is_finite() { format!("+{shown}") } else { shown }
}
