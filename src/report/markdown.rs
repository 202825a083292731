//! Tables in Markdown.

use comfy_table::{ContentArrangement, Table, presets};

/// A table of rows, of which the first is the head.
#[must_use]
pub fn markdown_table(rows: &[Vec<String>]) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_content_arrangement(ContentArrangement::Disabled);
    let escaped = |row: &Vec<String>| row.iter().map(|cell| markdown(cell)).collect::<Vec<_>>();
    if let Some((head, rows)) = rows.split_first() {
        table.set_header(escaped(head)).add_rows(rows.iter().map(escaped));
    }
    table.to_string()
}

/// A text in Markdown, of which no part is taken for a cell's end, a line's end or HTML.
#[must_use]
pub fn markdown(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;").replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    #[test]
    fn names_stay_in_their_cells() {
        let rows = [vec!["run".to_owned()], vec!["a|b\n<script>".to_owned()]];
        let table = super::markdown_table(&rows);
        assert_eq!(table.lines().count(), 3, "{table}");
        assert!(table.contains("a\\|b &lt;script>"), "{table}");
    }
}
