//! The ranking of candidates: `ranking.json`, and what is said and drawn of it.

use super::{FoldScore, Mean, Placed, Ranking};
use crate::report::curves::{Dots, dot_chart};
use nav_sim_document::{
    Axis, Cell, Chart, Colour, Document, Importance, Interval, Mark, Panel, Series, Table, Tone,
    readable, short_names, window,
};
use nav_sim_navigation::sensors::outage::Outage;
use nav_sim_navigation::simulation::NEES_DOF;
use serde::{Serialize, Serializer};

/// Version of the layout of `ranking.json`.
const SCHEMA_VERSION: u32 = 1;

/// What was compared, where, and what came of it.
#[derive(Debug, Clone)]
pub(crate) struct ChoiceReport<'a> {
    /// The candidates.
    pub ranking: &'a Ranking,
    /// The recordings that judge no candidate.
    pub abnormal: &'a [String],
    /// The outages at whose ends they are judged.
    pub outages: &'a [Outage],
    /// The trajectory, as it was named.
    pub trajectory: &'a str,
    /// Seed of all random numbers.
    pub seed: u64,
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
}

impl ChoiceReport<'_> {
    /// The verdict: the winner, what cannot be told from it, and how good it is.
    pub(crate) fn verdict(&self) -> Vec<String> {
        const NAMED: usize = 3;
        let (ranking, winner) = (self.ranking, self.ranking.winner());
        let name = &winner.candidate;
        let eligible = ranking.candidates.iter().filter(|p| p.eligible).count();
        let recordings = winner.folds.len();
        let first = match (ranking.tells, eligible) {
            (_, 1) => format!("{name}: there is no other candidate"),
            (true, _) => {
                format!("{name} is the best of {eligible} candidates on {recordings} recordings")
            }
            (false, _) => format!(
                "undecided: {recordings} recordings cannot tell {eligible} candidates apart; {name} scores highest"
            ),
        };
        let mut lines = vec![first];
        let tied: Vec<&str> = self.tied().collect();
        if ranking.tells && !tied.is_empty() {
            let more = if tied.len() > NAMED {
                format!(" and {} more", tied.len() - NAMED)
            } else {
                String::new()
            };
            let named = tied
                .iter()
                .take(NAMED)
                .copied()
                .collect::<Vec<_>>()
                .join("; ");
            lines.push(format!("cannot be told from it: {named}{more}"));
        }
        lines.push(format!(
            "its horizontal error at the ends of outages: {} m, believed {} m, NEES {} (9 if right)",
            readable(winner.rmse_m),
            readable(winner.believed_m),
            readable(winner.nees.value)
        ));
        lines
    }

    /// What else is to be known, the most important first.
    fn notes(&self, document: &mut Document) {
        let ranking = self.ranking;
        if !self.abnormal.is_empty() {
            let (names, verb) = (
                self.abnormal.join(", "),
                if self.abnormal.len() == 1 {
                    "is"
                } else {
                    "are"
                },
            );
            let text = format!(
                "{names} {verb} abnormal, and no judge of candidates: nav-sim calibrate says how"
            );
            document.note(Importance::Warning, text);
        }
        if !ranking.undescribed.is_empty() {
            let names = ranking.undescribed.join(", ");
            let cure = if 2 * ranking.undescribed.len() > ranking.winner().folds.len() {
                "a warm-up? try --skip-s auto"
            } else {
                "look at it with nav-sim calibrate"
            };
            document.note(
                Importance::Warning,
                format!("no candidate describes {names}: {cure}"),
            );
        }
        if !ranking.decisive.is_empty() {
            let names = ranking.decisive.join(", or without ");
            document.note(
                Importance::Warning,
                format!("without {names} another candidate would win"),
            );
        }
        if ranking.winner().folds.iter().any(|fold| fold.windows == 0) {
            document.note(
                Importance::Remark,
                "recordings shorter than the trajectory are judged by covariance analysis, their own N2 as truth",
            );
        }
        document.note(
            Importance::Remark,
            "* best log score, = not told from it, † of one recording; [95 % interval over recordings]",
        );
        let right = NEES_DOF as f64;
        let mut of_kind = |word: &str, is_so: &dyn Fn(&Placed) -> bool| {
            let all = ranking.candidates.iter().filter(|p| p.eligible && is_so(p));
            let names = all
                .map(|p| p.candidate.as_str())
                .collect::<Vec<_>>()
                .join("; ");
            if !names.is_empty() {
                document.note(
                    Importance::Detail,
                    format!("{word} over the recordings: {names}"),
                );
            }
        };
        of_kind("overconfident", &|p| p.nees.ci95.0 > right);
        of_kind("underconfident", &|p| p.nees.ci95.1 < right);
    }

    /// A row for each candidate.
    fn table(&self) -> Table {
        let mut table = Table::new([
            "candidate",
            "log score (nats)",
            "NEES (9)",
            "RMSE (m)",
            "against the best (%)",
        ]);
        for placed in &self.ranking.candidates {
            let is_winner = placed.index == self.ranking.winner().index;
            let mark = match (is_winner, placed.eligible, placed.tied) {
                (true, ..) => " *",
                (_, false, _) => " †",
                (_, _, true) => " =",
                _ => "",
            };
            let against = |mean: &Mean| match mean.value {
                _ if is_winner => "–".to_owned(),
                // an error that the filter held for impossible
                value if value.is_infinite() => "−∞".to_owned(),
                value => interval(value, mean.ci95, &signed_few),
            };
            let score = match is_winner {
                true => few(placed.log_score.value),
                false => against(&placed.difference.log_score),
            };
            table.row([
                format!("{}{mark}", placed.candidate).into(),
                Cell::figures(score),
                Cell::figures(interval(placed.nees.value, placed.nees.ci95, &few)),
                Cell::figures(readable(placed.rmse_m)),
                Cell::figures(against(&placed.difference.rmse_pct)),
            ]);
        }
        table
    }

    /// What each filter believes, and how often it is right.
    fn beliefs(&self) -> Table {
        let mut table = Table::new(["candidate", "RMSE (m)", "believed (m)", "coverage (0.95)"]);
        for (i, p) in self.ranking.candidates.iter().enumerate() {
            let number =
                |value: f64, key: &str| Cell::number(value, &format!("/candidates/{i}/{key}"));
            table.row([
                p.candidate.as_str().into(),
                number(p.rmse_m, "rmse_m"),
                number(p.believed_m, "believed_m"),
                p.coverage
                    .map_or_else(|| Cell::figures("–"), |c| number(c, "coverage")),
            ]);
        }
        table
    }

    /// Recording by recording: NEES and log score of every candidate.
    fn folds(&self) -> Table {
        let heads = self
            .recordings()
            .into_iter()
            .map(|name| format!("{name}: NEES (nats)"));
        let mut table = Table::new(["candidate"]).and(heads);
        for p in &self.ranking.candidates {
            let cell = |fold: &FoldScore| {
                Cell::figures(format!(
                    "{} ({:.1})",
                    readable(fold.score.nees),
                    fold.score.log_score
                ))
            };
            table.row(std::iter::once(p.candidate.as_str().into()).chain(p.folds.iter().map(cell)));
        }
        table
    }

    fn recordings(&self) -> Vec<String> {
        let folds = &self.ranking.winner().folds;
        short_names(
            &folds
                .iter()
                .map(|fold| fold.recording.as_str())
                .collect::<Vec<_>>(),
        )
    }

    /// Log scores, NEES, and errors beside what is believed of them.
    fn charts(&self) -> Vec<Chart> {
        let placed = &self.ranking.candidates;
        let names = || placed.iter().map(|p| p.candidate.clone());
        let of = |value: &dyn Fn(&Placed) -> Mean| {
            let point = |p: &Placed| {
                let Mean {
                    value,
                    ci95: (low, high),
                } = value(p);
                [value, low, high]
            };
            placed.iter().map(point).collect::<Vec<_>>()
        };
        let alone = |value: f64| Mean {
            value,
            ci95: (f64::NAN, f64::NAN),
        };
        let dots = |name, colour, points| Dots {
            name,
            colour,
            points,
        };
        let scores = dots("", Colour::BELIEVED, of(&|p| p.difference.log_score));
        let nees = dots("NEES", Colour::Ink, of(&|p| p.nees));
        let real = dots("true RMSE", Colour::REAL, of(&|p| alone(p.rmse_m)));
        let believed = dots("believed", Colour::BELIEVED, of(&|p| alone(p.believed_m)));
        let right = Some(("right", NEES_DOF as f64));
        vec![
            dot_chart(
                "Log score against the best",
                Axis::linear("nats"),
                names(),
                Some(("best", 0.0)),
                &[scores],
            ),
            dot_chart(
                "Consistency at the ends of outages",
                Axis::log("NEES"),
                names(),
                right,
                &[nees],
            ),
            dot_chart(
                "Accuracy",
                Axis::log("horizontal error (m)"),
                names(),
                None,
                &[real, believed],
            ),
        ]
    }

    fn tied(&self) -> impl Iterator<Item = &str> {
        let others = self.ranking.candidates.iter().skip(1);
        others
            .filter(|p| p.eligible && p.tied)
            .map(|p| p.candidate.as_str())
    }
}

impl Serialize for ChoiceReport<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let file = RankingFile {
            schema_version: SCHEMA_VERSION,
            verdict: self.verdict(),
            winner: &self.ranking.winner().candidate,
            tied: self.tied().collect(),
            trajectory: self.trajectory,
            outages: self.outages,
            seed: self.seed,
            ranking: self.ranking,
        };
        file.serialize(serializer)
    }
}

impl ChoiceReport<'_> {
    /// Ranking, verdict and charts.
    pub(super) fn document(&self) -> Document {
        let tone = if self.ranking.tells {
            Tone::Good
        } else {
            Tone::Undecided
        };
        let mut document = Document::new("Which noise model", tone, self.verdict());
        self.notes(&mut document);
        let ends: Vec<String> = self
            .outages
            .iter()
            .map(|o| window(o.start_s, o.end_s))
            .collect();
        document.facts(&[
            ("trajectory", self.trajectory.to_owned()),
            ("outages", ends.join(", ")),
            ("recordings", self.ranking.winner().folds.len().to_string()),
            ("seed", self.seed.to_string()),
        ]);
        document.lead(self.table());
        document.charts(&self.charts()[..2], SCORE);
        document.section("Accuracy");
        document.chart(&self.charts()[2], "");
        document.table(&self.beliefs());
        document.section("Recording by recording");
        document.text("Each recording judges models of the others; NEES at the ends of outages, in brackets the mean log score (nats).");
        document.chart(
            &fold_chart(&self.ranking.candidates, self.recordings()),
            "A recording whose points all stand high is described by no candidate.",
        );
        document.table(&self.folds());
        document
    }
}

const SCORE: &str = "Log score: the mean log density of the true errors under the filter's covariance, less that of the best. NEES above 9: overconfident. Bars: 95 % intervals over recordings.";

/// NEES of each candidate on each recording.
fn fold_chart(placed: &[Placed], recordings: Vec<String>) -> Chart {
    let mut series = vec![Series::new(
        "right",
        Colour::RIGHT,
        Mark::Level(NEES_DOF as f64),
    )];
    for (hue, p) in placed.iter().enumerate() {
        let beside = 0.6 * ((hue as f64 + 0.5) / placed.len() as f64 - 0.5);
        let point = |(k, fold): (usize, &FoldScore)| {
            let (x, y) = (k as f64 + beside, fold.score.nees);
            Interval {
                x,
                y,
                low: f64::NAN,
                high: f64::NAN,
            }
        };
        let points = p.folds.iter().enumerate().map(point).collect();
        series.push(Series::new(
            &p.candidate,
            Colour::Hue(hue),
            Mark::Points(points),
        ));
    }
    let panel = Panel::new(Axis::log("NEES"), series);
    Chart::new(
        "NEES on the recording left out",
        Axis::names(recordings),
        vec![panel],
    )
}

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

/// `9.1 [8.0, 10.2]`
fn interval(value: f64, (low, high): (f64, f64), shown: &dyn Fn(f64) -> String) -> String {
    format!("{} [{}, {}]", shown(value), shown(low), shown(high))
}
