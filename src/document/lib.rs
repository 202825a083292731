//! Results as documents. A [`Document`] is data: a verdict, tables, charts, texts and notes. It is rendered as text for a
//! terminal, as a self-contained HTML page and as an SVG picture; its tables also as CSV, LaTeX and Markdown.
//!
//! ```
//! use nav_sim_document::{Cell, Document, Importance, Table, Tone};
//!
//! let mut document = Document::new("Drift", Tone::Good, ["met: p95 4.2 m after 60 s"]);
//! let mut table = Table::new(["outage", "p95 (m)"]);
//! table.row(["300–360 s".into(), Cell::number(4.2, "/outages/0/p95_m")]);
//! document.table(table);
//! document.note(Importance::Remark, "the trajectory has one turn");
//! assert!(document.terminal(100).starts_with("met: p95 4.2 m after 60 s\n"));
//! assert!(document.html().contains("data-json=\"/outages/0/p95_m\">4.20</td>"));
//! ```

// L0: numbers and names
mod number;
// L1: charts
mod chart;
// L2
mod draw;
#[cfg(feature = "pictures")]
mod png;
// L3
mod picture;
// L4: tables
mod table;
// L5: documents
mod document;

pub use chart::{Chart, ChartAxis, Colour, Mark, Panel, PointInterval, Series, Size, Stroke};
pub use document::{Block, Document, Importance, NOTES, Note, Tone};
pub use draw::{escape, one_line};
pub use number::{counted, readable, seconds, short_names, shortest, six_digits, window};
pub use picture::{FORMS, encode, svg};
pub use table::{Cell, Table};
