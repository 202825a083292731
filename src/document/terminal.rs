//! Documents for a terminal.

use crate::document::{Block, Document, Importance, Note};

/// Notes that a terminal shows without being asked for more.
pub const NOTES: usize = 3;
/// Lines that a terminal shows without being asked for more, before the notes.
const LINES: usize = 16;

impl Document {
    /// The verdict, and as much of the lead table as a screen has room for.
    #[must_use]
    pub fn terminal(&self, width: usize) -> String {
        let verdict = self.verdict.lines.join("\n");
        let lead = self.blocks.iter().find_map(|block| match block {
            Block::Table {
                table,
                is_lead: true,
            } => Some(table),
            _ => None,
        });
        let Some(table) = lead else {
            return verdict + "\n";
        };
        let mut shown = table.clone();
        let room = LINES.saturating_sub(self.verdict.lines.len());
        while shown.columns(width).lines().count() > room && shown.rows.len() > 1 {
            shown.rows.pop();
        }
        let hidden = table.rows.len() - shown.rows.len();
        let more = if hidden > 0 {
            format!("  … {hidden} more rows (--verbose)\n")
        } else {
            String::new()
        };
        format!("{verdict}\n\n{}\n{more}", shown.columns(width))
    }

    /// All that can be said without figures.
    #[must_use]
    pub fn verbose(&self, width: usize) -> String {
        let mut text = self.verdict.lines.join("\n") + "\n";
        blocks(&self.blocks, width, &mut text);
        text
    }

    /// The notes that a terminal shows, the most important first; all of them to those who ask for more.
    pub fn spoken(&self, is_verbose: bool) -> impl Iterator<Item = &Note> {
        let is_spoken = move |note: &&Note| is_verbose || note.importance < Importance::Detail;
        self.notes()
            .iter()
            .filter(is_spoken)
            .take(if is_verbose { usize::MAX } else { NOTES })
    }
}

fn blocks(all: &[Block], width: usize, text: &mut String) {
    for block in all {
        match block {
            Block::Section(title) => *text += &format!("\n{}\n", title.to_uppercase()),
            Block::Heading(words) | Block::Text(words) => *text += &format!("\n{words}\n"),
            Block::Facts(facts) => {
                let lines = facts
                    .iter()
                    .map(|(name, value)| format!("\n  {name}: {value}"));
                *text += &(lines.collect::<String>() + "\n");
            }
            Block::Table { table, .. } => *text += &format!("\n{}\n", table.columns(width)),
            Block::Code(code) => *text += &format!("\n{}\n", code.trim_end()),
            Block::Folded(title, inside) => {
                *text += &format!("\n{title}\n");
                blocks(inside, width, text);
            }
            Block::Charts(..) | Block::Links(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Document, Importance, Table, Tone};

    #[test]
    fn a_screen_has_verdict_lead_and_three_notes() {
        let mut document = Document::new(
            "t",
            Tone::Undecided,
            ["undecided: 8 runs", "100 runs decide"],
        );
        let mut table = Table::new(["row"]);
        (0..40).for_each(|k| table.row([k.to_string().into()]));
        document.table(&Table::new(["other"]));
        document.lead(table);
        for k in 0..3 {
            document.note(Importance::Detail, format!("detail {k}"));
            document.note(Importance::Remark, format!("remark {k}"));
        }
        document.note(Importance::Warning, "last said, first told");
        let text = document.terminal(100);
        assert!(
            text.starts_with("undecided: 8 runs\n100 runs decide\n\n  row\n  0\n"),
            "{text}"
        );
        assert!(
            text.ends_with("  12\n  … 27 more rows (--verbose)\n") && text.lines().count() <= 18,
            "{text}"
        );
        let spoken: Vec<&str> = document.spoken(false).map(|n| n.text.as_str()).collect();
        assert_eq!(spoken, ["last said, first told", "remark 0", "remark 1"]);
        assert_eq!(document.spoken(true).count(), 7);
        assert!(document.verbose(100).contains("\n  39\n"));
    }
}
