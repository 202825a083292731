//! Document of a tuning: factors and their cost, the filters beside one another.

use super::result::{TuneResult, kind};
use crate::report::Answer;
use nav_sim_document::{Cell, Document, Importance, Table, Tone, readable, seconds, short_names};
use nav_sim_navigation::metrics::VerdictKind;
use nav_sim_navigation::simulation::lincov::{Aim, FilterConsistency};
use nav_sim_navigation::simulation::{NEES_DOF, REPORTED_NAMES};

impl Answer for TuneResult {
    fn document(&self) -> Document {
        let found = kind(&self.after);
        let tone = match self.unmet() {
            Some(_) => Tone::Bad,
            None if self.is_unchanged() && found == VerdictKind::Consistent => Tone::Good,
            None => Tone::Doubtful,
        };
        let mut document = Document::new("Factors on a noise model", tone, self.verdict());
        if found == VerdictKind::Underconfident && self.aim == Aim::Worst {
            let why = "no error exceeds its sigma in any truth; --for mean aims at the right NEES in the mean";
            document.note(Importance::Remark, why);
        }
        if self
            .of_run
            .as_ref()
            .is_some_and(|of_run| kind(of_run) == VerdictKind::Overconfident)
        {
            let states = self.filter_of_run;
            document.note(
                Importance::Remark,
                format!("--filter {states} tunes the default of run"),
            );
        }
        if self.is_drawn {
            let counted = "errors count up to the upper end of the 95 % interval that run states";
            document.note(Importance::Remark, counted);
        }
        let truths: Vec<&str> = self.truths.iter().map(String::as_str).collect();
        document.facts(&[("truths", short_names(&truths).join(", "))]);
        document.section("Filters");
        document.lead(self.table());
        document.text("RMSE/sigma: largest error over what the filter states. RMSE: horizontal, at the end of an outage.");
        document.section("Factors");
        document.table(&self.factor_table());
        document.checked("covariance analysis against 2000 Monte-Carlo runs: docs/validation.md.");
        document
    }
}

impl TuneResult {
    fn table(&self) -> Table {
        let ends = self
            .before
            .end_s
            .iter()
            .map(|t| format!("RMSE {} s (m)", seconds(*t)));
        let nees = format!("NEES ({NEES_DOF})");
        let mut table = Table::new(["filter", "verdict", &nees, "RMSE/sigma", "in"]).and(ends);
        for (i, (name, found)) in self.filters().enumerate() {
            let number =
                |value: f64, key: String| Cell::number(value, &format!("/filters/{i}/{key}"));
            let mut row = vec![
                name.into(),
                kind(found).to_string().into(),
                number(found.nees, "nees".to_owned()),
                number(found.largest.ratio, "largest_ratio".to_owned()),
                self.place(found).into(),
            ];
            let ends = found.horizontal_m().enumerate();
            row.extend(
                ends.map(|(k, rmse)| number(rmse, format!("outage_end/{k}/horizontal_rmse_m"))),
            );
            table.row(row);
        }
        table
    }

    /// State, time and truth of the largest error.
    pub(super) fn place(&self, found: &FilterConsistency) -> String {
        let mut place = REPORTED_NAMES[found.largest.state].to_owned();
        match found.largest.outage {
            Some(outage) if found.end_s.len() > 1 => {
                place += &format!(" at {} s", seconds(found.end_s[outage]))
            }
            None if !found.end_s.is_empty() => place += " over the run",
            _ => {}
        }
        if self.truths.len() > 1 {
            format!("{place}, {}", self.worst_truth(found))
        } else {
            place
        }
    }

    fn factor_table(&self) -> Table {
        let mut table = Table::new([
            "sensor",
            "factor on the variance",
            "on the standard deviation",
        ]);
        for (i, f) in self.factors.iter().enumerate() {
            table.row([
                f.sensor.name().into(),
                Cell::number(f.on_variance, &format!("/factors/{i}/on_variance")),
                Cell::figures(readable(f.on_variance.sqrt())),
            ]);
        }
        table
    }
}
