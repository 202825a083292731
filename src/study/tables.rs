//! The tables of a study as they are written, cell by cell.

use super::cell_tables::CellTables;
use super::description::Metric;
use super::failure::StudyError;
use super::planned::Planned;
use crate::formats::atomic::AtomicDir;
use crate::formats::table_files::TableFiles;
use crate::report;

/// The tables being written.
pub(super) struct Tables {
    outages: TableFiles,
    runs: TableFiles,
    epochs: Option<TableFiles>,
}

impl Tables {
    pub(super) fn create(out: &mut AtomicDir, planned: &Planned) -> Result<Self, StudyError> {
        let outages =
            TableFiles::create(out, "outages", report::outage_columns())?.with_json(out)?;
        let runs = TableFiles::create(out, "runs", report::run_columns())?;
        let epochs = planned
            .plan
            .study
            .keeps(Metric::Epochs)
            .then(|| TableFiles::create(out, "epochs", report::epoch_columns()));
        Ok(Self {
            outages,
            runs,
            epochs: epochs.transpose()?,
        })
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
