//! Tables for a terminal.

use super::markdown::plain_table;

/// Characters of a line that a table takes at most, where it can be cut.
const WIDTH: usize = 100;

/// A table without lines, whose first row is its head.
pub(crate) fn columns(rows: &[Vec<String>]) -> String {
    let widths = widths(rows);
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}")).collect();
        format!("  {}", cells.join("  ")).trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The same, cut where a line would be too long, each part with the first column.
pub(crate) fn terminal_columns(rows: &[Vec<String>]) -> String {
    cut(rows, 1, 2).iter().map(|part| columns(part)).collect::<Vec<_>>().join("\n\n")
}

/// A table in Markdown, cut where a line would be too long, each part with the first `lead` columns.
pub(crate) fn terminal_table(rows: &[Vec<String>], lead: usize) -> String {
    cut(rows, lead, 3).iter().map(|part| plain_table(part)).collect::<Vec<_>>().join("\n\n")
}

/// A table as several that a terminal has room for, with `gap` characters between two columns.
fn cut(rows: &[Vec<String>], lead: usize, gap: usize) -> Vec<Vec<Vec<String>>> {
    let widths = widths(rows);
    let (leading, others): (Vec<usize>, Vec<usize>) = (0..widths.len()).partition(|column| *column < lead);
    if others.is_empty() {
        return vec![rows.to_vec()];
    }
    let width = |columns: &[usize]| columns.iter().map(|c| widths[*c] + gap).sum::<usize>() + 1;
    let fits = |size: &usize| others.chunks(*size).all(|part| width(&leading) + width(part) - 1 <= WIDTH);
    let most = (1..=others.len()).rev().find(fits).unwrap_or(1);
    // as many columns in each as in the others, about: those of one state stay together
    let size = others.len().div_ceil(others.len().div_ceil(most));
    let part = |columns: &[usize]| {
        let cells = |row: &Vec<String>| leading.iter().chain(columns).map(|c| row[*c].clone()).collect();
        rows.iter().map(cells).collect()
    };
    others.chunks(size).map(part).collect()
}

/// Characters of each column.
fn widths(rows: &[Vec<String>]) -> Vec<usize> {
    let count = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
    (0..count).map(width).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of 20 characters, 23 with their gap: with the lead of 10 four of them take 13 + 92 + 1 = 106, five 129. Nine are
    /// three times three.
    #[test]
    fn wide_tables_are_cut_and_lose_nothing() {
        let row = |k: usize| {
            let cells = (0..9).map(|c| format!("{:>20}", format!("{k}.{c}")));
            std::iter::once(format!("{k:>10}")).chain(cells).collect::<Vec<String>>()
        };
        let rows: Vec<Vec<String>> = (0..3).map(row).collect();
        let parts = cut(&rows, 1, 3);
        assert_eq!(parts.iter().map(|part| part[0].len()).collect::<Vec<_>>(), [4, 4, 4]);
        assert!(parts.iter().all(|part| part.iter().zip(&rows).all(|(cells, row)| cells[0] == row[0])));
        let put_together: Vec<&String> = parts.iter().flat_map(|part| &part[2][1..]).collect();
        assert_eq!(put_together, rows[2][1..].iter().collect::<Vec<_>>());
        let is_narrow = |text: &str| text.lines().all(|line| line.chars().count() <= WIDTH);
        assert!(is_narrow(&terminal_table(&rows, 1)) && is_narrow(&terminal_columns(&rows)));
        assert_eq!(terminal_table(&parts[0], 1), plain_table(&parts[0]), "what has room is one table");
        // nothing can be done about a column that is wider than a terminal
        assert_eq!(cut(&[vec!["a".repeat(100), "b".repeat(100)]], 1, 3).len(), 1);
    }
}
