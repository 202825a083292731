//! Results as files: tables, JSON, self-contained pages (`page`). The module computes no statistic and touches
//! no file: every function returns a text, and the command line writes it.

mod beyond_linear;
mod brief;
mod choose;
mod closure;
mod columns;
mod comparison;
mod comparison_table;
mod curves;
mod describe;
mod design;
mod displaced;
mod efficiency;
mod fits;
mod fusion;
mod fusion_files;
mod manifest;
mod markdown;
mod number;
pub(crate) mod page;
mod pages;
mod practical;
mod recording;
mod replicates;
pub(crate) mod require;
pub(crate) mod requirement;
mod run_directory;
pub(crate) mod run_words;
#[cfg(test)]
pub(crate) mod sample;
mod short;
mod signals;
mod smoothed;
mod study;
pub(crate) mod tables;
mod trajectory;
mod tune;
mod turn_on;
mod verdict;
mod warm_up;

pub(crate) use beyond_linear::{BeyondLinear, BeyondLinearPlaces, OF_A_VERDICT};
pub(crate) use brief::brief;
pub(crate) use choose::{ChoiceReport, RankedPlace};
pub(crate) use closure::TrajectoryCheck;
pub(crate) use columns::{columns, terminal_columns, terminal_table};
pub(crate) use comparison::{CandidateResult, ComparisonFile, Label, meaning_of_intervals, verdict_lines};
pub(crate) use comparison_table::{consistency_rows, ratio_rows, table_rows, with_times};
pub(crate) use curves::{CurvesFile, FittedCurve, ReplicateCurve, SignalCurves, SignalsFile};
pub(crate) use describe::describe;
pub(crate) use design::{Design, DesignedParameter, DesignedQuantile, design_rows, design_verdict};
pub(crate) use displaced::displaced_words;
pub(crate) use efficiency::{EfficiencyFile, EfficiencyRow, efficiency_csv, efficiency_table};
pub(crate) use fits::FitsFile;
pub(crate) use fusion::FusionSummary;
pub(crate) use fusion_files::{FUSION_FILES, fusion_directory};
pub(crate) use manifest::{FusionConfiguration, FusionKind, FusionManifest};
pub use manifest::{Input, Manifest, ModelNote};
pub(crate) use markdown::{csv_table, latex_table, markdown, markdown_table};
pub use number::readable;
pub(crate) use number::{seconds, six_digits, window};
pub(crate) use pages::{
    PaperFigure, RatioCurves, ShownComparison, StudyCurves, calibration_page, calibration_svg,
    catalogue_page, choice_page, design_page, efficiency_page, efficiency_svg, fusion_page, model_page,
    needed_page, paper_figures, paper_page, run_svg, run_text, study_page, tune_page, wavelet_page,
    wavelet_text,
};
pub(crate) use recording::{gnss_csv, imu_csv, initial_toml};
pub(crate) use replicates::describe_replicates;
pub use run_directory::{OutputFile, run_directory};
pub(crate) use run_directory::{RUN_FILES, json, summary_json};
pub(crate) use short::short_names;
pub(crate) use signals::{intervals_note, signal_rows, signals_csv, signals_digest, signals_per_file};
pub(crate) use study::{
    ColumnResult, ShownCell, ShownColumn, TableColumn, TableRow, Value, ValueKind, drift_table,
    epoch_columns, epoch_rows, outage_columns, outage_rows, ratio_table, run_columns, run_rows,
    verdict_table,
};
pub use trajectory::TrajectorySeries;
pub(crate) use trajectory::trajectory_svg;
pub(crate) use tune::{FactorEntry, TuneResult};
pub(crate) use turn_on::{turn_on_lines, turn_on_remark};
pub use warm_up::BeginsOtherwise;
pub(crate) use warm_up::{warm_up_in_short, warm_up_lines};
