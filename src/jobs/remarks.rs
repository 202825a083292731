//! Words on what was read.

use crate::app::Context;
use crate::formats::recordings::Report;
use nav_sim_document::Importance;

/// Files of more than this number are told in one line, unless all is to be said.
const FEW: usize = 2;

/// Notes what was found in the recordings, and what is doubtful about them.
pub(crate) fn note_report(report: &Report, context: &Context<'_>) {
    let is_many = report.files.len() > FEW;
    if is_many {
        context.remark(format!("{} (--verbose: each of them)", report.summary()));
    }
    let each = match is_many {
        true => Importance::Detail,
        false => Importance::Remark,
    };
    for file in &report.files {
        context.note(each, file);
        if !file.ignored.is_empty() {
            let ignored = file.ignored.join(", ");
            context.detail(format!("{}: passed over: {ignored}", file.file));
        }
    }
    let doubts = report.all_warnings();
    doubts.iter().for_each(|doubt| context.warn(doubt));
}
