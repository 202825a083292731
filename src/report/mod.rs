//! Results as files: tables, JSON, self-contained pages ([`page`]). It computes no statistic and touches no file:
//! every function makes a text, the command line writes it.

mod brief;
mod choose;
mod columns;
mod comparison;
mod curves;
mod describe;
mod design;
mod efficiency;
mod fits;
mod fusion;
mod manifest;
mod markdown;
mod number;
pub mod page;
mod pages;
mod practical;
mod recording;
mod replicates;
pub mod require;
mod run_directory;
pub mod run_words;
#[cfg(test)]
pub(crate) mod sample;
mod signals;
mod study;
mod tables;
mod trajectory;
mod tune;
mod turn_on;
mod verdict;

pub use brief::brief;
pub use choose::{ChoiceReport, RankedPlace};
pub use columns::columns;
pub use comparison::{
    CandidateResult, ComparisonFile, Label, consistency_rows, meaning_of_intervals, table_rows,
    verdict_lines, with_times,
};
pub use curves::{Band, CONFIDENCE, CurvesFile, FittedCurve, ReplicateCurve, SignalCurves, SignalsFile};
pub use describe::describe;
pub use design::{Design, DesignedParameter, DesignedQuantile, design_rows, design_verdict};
pub use efficiency::{EfficiencyFile, EfficiencyRow, efficiency_csv, efficiency_table};
pub use fits::{CandidateEntry, FitEntry, FitsFile, MissEntry};
pub use fusion::{FUSION_FILES, FusionKind, FusionManifest, FusionSummary, fusion_directory, solution_csv};
pub use manifest::{Input, Manifest, ModelNote};
pub use markdown::{csv_table, latex_table, markdown, markdown_table};
pub use number::{readable, seconds, window};
pub use pages::{
    PaperFigure, RatioCurves, StudyCurves, calibration_page, calibration_svg, catalogue_page, choice_page,
    comparison_figure, comparison_page, comparison_svg, design_page, efficiency_page, efficiency_svg,
    model_page, needed_page, paper_figures, paper_page, run_svg, run_text, study_page, tune_page,
    wavelet_page, wavelet_svg, wavelet_text,
};
pub use recording::{gnss_csv, imu_csv, initial_toml};
pub use replicates::{AlarmEntry, LeftOutEntry, ReplicateEntry, ScoresEntry, describe_replicates};
pub use run_directory::{OutputFile, RUN_FILES, json, run_directory, summary_json};
pub use signals::{intervals_note, signal_rows, signals_csv, signals_digest, signals_per_file};
pub use study::{
    ColumnResult, ShownCell, ShownColumn, TableColumn, TableRow, Value, ValueKind, drift_table,
    epoch_columns, epoch_rows, outage_columns, outage_rows, ratio_table, run_columns, run_rows,
    verdict_table,
};
pub use tables::{epochs_csv, runs_csv};
pub use trajectory::{TrajectorySeries, trajectory_svg};
pub use tune::{FactorEntry, TuneResult};
pub use turn_on::{MeansEntry, TurnOnEntry, turn_on_lines, turn_on_remark};
pub use verdict::{verdict_in_short, verdict_line, verdict_word};
