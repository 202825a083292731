//! The ranking of candidates as a document.

use super::ChoiceMade;
use super::ranking::{Mean, Placed};
use nav_sim_document::{
    Axis, Chart, Colour, Document, Importance, Panel, Series, Table, Tone, readable, window,
};
use serde_json::json;

impl super::Ranking {
    /// The winner, what cannot be told from it, and how good it is.
    pub(super) fn verdict(&self) -> Vec<String> {
        const NAMED: usize = 3;
        let (winner, recordings) = (&self.candidates[0], self.candidates[0].folds.len());
        let name = &winner.candidate;
        let eligible = self.candidates.iter().filter(|p| p.eligible).count();
        let mut lines = vec![match (self.tells, eligible) {
            (_, 1) => format!("{name}: there is no other candidate"),
            (true, _) => {
                format!("{name} is the best of {eligible} candidates on {recordings} recordings")
            }
            (false, _) => format!(
                "undecided: {recordings} recordings cannot tell {eligible} candidates apart; {name} scores highest"
            ),
        }];
        if self.tells && !self.tied.is_empty() {
            let named: Vec<&str> = self.tied.iter().map(String::as_str).take(NAMED).collect();
            let more = match self.tied.len() - named.len() {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            lines.push(format!(
                "cannot be told from it: {}{more}",
                named.join("; ")
            ));
        }
        lines.push(format!(
            "its horizontal error at the ends of outages: {} m, believed {} m, NEES {} (9 if right)",
            readable(winner.rmse_m),
            readable(winner.believed_m),
            readable(winner.nees.value)
        ));
        lines
    }
}

impl ChoiceMade {
    pub(super) fn ranked(&self) -> Document {
        let (ranking, json) = (&self.ranking, json!(self));
        let tone = if ranking.tells {
            Tone::Good
        } else {
            Tone::Undecided
        };
        let mut document = Document::new("Which noise model", tone, self.verdict.iter());
        self.notes(&mut document);
        let ends: Vec<String> = self
            .outages
            .iter()
            .map(|o| window(o.start_s, o.end_s))
            .collect();
        document.facts(&[
            ("trajectory", self.trajectory.clone()),
            ("outages", ends.join(", ")),
            ("seed", self.seed.to_string()),
        ]);
        let columns = [
            ("candidate", "candidate"),
            ("", "place"),
            ("log score (nats)", "log_score/value"),
            ("to the best", "difference/log_score/value"),
            ("95 %", "difference/log_score/ci95"),
            ("NEES (9)", "nees/value"),
            ("95 %", "nees/ci95"),
            ("RMSE (m)", "rmse_m"),
        ];
        document.lead(Table::of(&json, "/candidates/*", &columns));
        document.chart(&self.chart(), CAPTION);
        let columns = [
            ("candidate", "candidate"),
            ("RMSE (m)", "rmse_m"),
            ("to the best (%)", "difference/rmse_pct/value"),
            ("95 %", "difference/rmse_pct/ci95"),
            ("believed (m)", "believed_m"),
            ("coverage (0.95)", "coverage"),
        ];
        document.table(&Table::of(&json, "/candidates/*", &columns));
        let columns = [
            ("recording left out", "recording"),
            ("candidate", "../../candidate"),
            ("windows", "windows"),
            ("NEES (9)", "nees"),
            ("log score (nats)", "log_score"),
            ("RMSE (m)", "rmse_m"),
        ];
        let folds = Table::of(&json, "/candidates/*/folds/*", &columns);
        document.folded("Recording by recording", |inside| inside.table(&folds));
        document
    }

    /// Notes, the most important first.
    fn notes(&self, document: &mut Document) {
        let (ranking, folds) = (&self.ranking, &self.ranking.candidates[0].folds);
        let mut warn = |names: &[String], text: &dyn Fn(String) -> String| {
            if !names.is_empty() {
                document.note(Importance::Warning, text(names.join(", ")));
            }
        };
        warn(&self.abnormal, &|names| {
            let verb = if self.abnormal.len() == 1 {
                "is"
            } else {
                "are"
            };
            format!(
                "{names} {verb} abnormal, and no judge of candidates: nav-sim calibrate says how"
            )
        });
        let is_common = 2 * ranking.undescribed.len() > folds.len();
        warn(&ranking.undescribed, &|names| {
            if is_common {
                format!("no candidate describes {names}: a warm-up? try --skip-s auto")
            } else {
                format!("no candidate describes {names}: look at it with nav-sim calibrate")
            }
        });
        warn(&ranking.decisive, &|names| {
            format!("without any one of {names} another candidate would win")
        });
        if folds.iter().any(|fold| fold.windows == 0) {
            document.note(
                Importance::Remark,
                "recordings shorter than the trajectory are judged by covariance analysis, their own N2 as truth",
            );
        }
    }

    /// Log scores against the best, a row a candidate.
    fn chart(&self) -> Chart {
        let placed = self.ranking.candidates.iter().rev().enumerate();
        let (mut names, mut points, mut bars) = (Vec::new(), Vec::new(), Vec::new());
        for (
            row,
            Placed {
                candidate,
                difference,
                ..
            },
        ) in placed
        {
            let Mean {
                value,
                ci95: (low, high),
            } = difference.log_score;
            let height = row as f64;
            names.push(candidate.clone());
            points.push((value, height, f64::NAN));
            bars.extend([(low, height), (high, height), (f64::NAN, f64::NAN)]);
        }
        let rows = names.len() as f64;
        let series = vec![
            Series::dashed("best", Colour::RIGHT, vec![(0.0, -0.5), (0.0, rows - 0.5)]),
            Series::line("", Colour::BELIEVED, bars),
            Series::points("", Colour::BELIEVED, points),
        ];
        Chart::new(
            "Log score against the best",
            Axis::linear("nats"),
            vec![Panel {
                height: 0.1 * (rows + 1.0),
                ..Panel::new(Axis::names(names), series)
            }],
        )
    }
}

const CAPTION: &str = "Log score: the mean log density of the true errors under the filter's covariance, less that of the best. Bars: 95 % intervals over recordings.";
