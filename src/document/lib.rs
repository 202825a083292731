//! Results as documents. A [`Document`] is data: a verdict, tables, charts, texts and notes. It is rendered as text for a
//! terminal, as a self-contained HTML page and as an SVG picture; its tables also as CSV, LaTeX and Markdown.
//!
//! ```
//! use nav_sim_document::{Cell, Document, Importance, Table, Tone};
//!
//! let mut document = Document::new("Drift", Tone::Good, ["met: p95 4.2 m after 60 s"]);
//! let mut table = Table::new(["outage", "p95 (m)"]);
//! table.row(["300–360 s".into(), Cell::number(4.2, "/outages/0/p95_m")]);
//! document.lead(table);
//! document.note(Importance::Remark, "the trajectory has one turn");
//! assert!(document.terminal(100).starts_with("met: p95 4.2 m after 60 s\n"));
//! assert!(document.html().contains("data-json=\"/outages/0/p95_m\">4.20</td>"));
//! ```

// L0: names, numbers
mod escape;
mod names;
mod number;
// L1: charts
mod chart;
// L2
mod axis;
mod canvas;
// L3
mod legend;
mod marks;
// L4
mod draw;
#[cfg(feature = "pictures")]
mod png;
// L5
mod picture;
// L6: tables
mod table;
// L7
mod table_text;
// L8: documents
mod document;
// L9
mod terminal;
// L10
mod page;

pub use chart::{Axis, Chart, Colour, Interval, Mark, Panel, Scale, Series, Size, Stroke};
pub use document::{Banner, Block, Document, Importance, Note, Tone};
pub use escape::{escape, turns};
pub use names::short_names;
pub use number::{percent, readable, seconds, shortest, six_digits, window};
pub use picture::{Form, encode, svg};
pub use table::{Cell, Table};
pub use terminal::NOTES;
