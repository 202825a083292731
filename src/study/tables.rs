//! The tables of a study as they are written, cell by cell.

use super::cell_tables::CellTables;
use super::description::Metric;
use super::failure::StudyError;
use super::planned::Planned;
use crate::formats::atomic::AtomicDir;
use crate::formats::table_files::TableFiles;
use crate::report::{self, RankedPlace, ShownCell, markdown, markdown_table};

/// The tables being written.
pub(super) struct Tables {
    outages: TableFiles,
    runs: TableFiles,
    epochs: Option<TableFiles>,
}

impl Tables {
    pub(super) fn create(out: &mut AtomicDir, planned: &Planned) -> Result<Self, StudyError> {
        let outages = TableFiles::create(out, "outages", report::outage_columns())?.with_json(out)?;
        let runs = TableFiles::create(out, "runs", report::run_columns())?;
        let epochs = planned
            .plan
            .study
            .keeps(Metric::Epochs)
            .then(|| TableFiles::create(out, "epochs", report::epoch_columns()));
        Ok(Self { outages, runs, epochs: epochs.transpose()? })
    }

    pub(super) fn add(&mut self, cell: &CellTables) -> Result<(), StudyError> {
        self.outages.add(cell.outages.iter().cloned())?;
        self.runs.add(cell.runs.iter().cloned())?;
        match &mut self.epochs {
            Some(epochs) => Ok(epochs.add(cell.epochs.iter().cloned())?),
            None => Ok(()),
        }
    }

    pub(super) fn finish(self) -> Result<(), StudyError> {
        self.outages.finish()?;
        self.runs.finish()?;
        Ok(self.epochs.map_or(Ok(()), TableFiles::finish)?)
    }
}

/// What people read: of the first cells only, the files have all.
pub(super) struct Texts {
    /// What ratios refer to, in words.
    reference: String,
    /// The words for its Monte-Carlo intervals, where there are any.
    intervals: &'static str,
    cells: Vec<ShownCell>,
    more: usize,
    /// Where recordings are left out: which candidate is best, place by place.
    pub(super) rankings: Vec<RankedPlace>,
}

const SHOWN: usize = 24;

impl Texts {
    pub(super) fn new(planned: &Planned) -> Self {
        let same = if planned.plan.study.filters.len() > 1 { " with the same filter" } else { "" };
        let reference = format!("{}{same}", planned.reference().1);
        let intervals = if planned.plan.study.is_sampled() { " ± half the 95 % interval" } else { "" };
        Self { reference, intervals, cells: Vec::new(), more: 0, rankings: Vec::new() }
    }

    pub(super) fn add(&mut self, cell: ShownCell) {
        if self.cells.len() < SHOWN {
            self.cells.push(cell);
        } else {
            self.more += 1;
        }
    }

    pub(super) fn page(&self, states: &[usize]) -> String {
        report::study_page(&self.cells, &self.reference, states, self.more, &self.rankings)
    }

    pub(super) fn render(&self, states: &[usize]) -> String {
        let mut text = String::new();
        for place in &self.rankings {
            let RankedPlace { name, verdict, rows, legend, .. } = place;
            let said = verdict.join("\n");
            text += &format!("{}\n\n{said}\n\n{}\n{legend}\n\n", markdown(name), markdown_table(rows));
        }
        text += "Verdict on each filter: NEES over the run (9 if right), error over its standard deviation in the \
                 state that is farthest off\n\n";
        text += &markdown_table(&report::verdict_table(&self.cells));
        text += "\n\nHorizontal error before the first fix after the outage, median (95 %), m\n\n";
        text += &markdown_table(&report::drift_table(&self.cells));
        let has_ratios = |cell: &&ShownCell| cell.columns.len() > 1 && cell.columns[0].comparison.is_some();
        for cell in self.cells.iter().filter(has_ratios) {
            text += &format!(
                "\n\n{}: ASEE relative to {}, mean over the outage of (ratio − 1)·100{} (mean of the absolute value), %\n\n",
                markdown(&cell.name),
                markdown(&self.reference),
                self.intervals
            );
            text += &markdown_table(&report::ratio_table(cell, states));
        }
        if self.more > 0 {
            text += &format!("\n\n{} more cells are in outages.csv", self.more);
        }
        text
    }
}
