//! Tables in Markdown, CSV and LaTeX.

use comfy_table::{ContentArrangement, Table, presets};

/// A table of rows, of which the first is the head.
pub(crate) fn markdown_table(rows: &[Vec<String>]) -> String {
    table(rows, markdown)
}

/// The same for eyes: names as they are.
pub(crate) fn plain_table(rows: &[Vec<String>]) -> String {
    table(rows, |text| text.replace(['\n', '\r'], " "))
}

fn table(rows: &[Vec<String>], shown: impl Fn(&str) -> String) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_content_arrangement(ContentArrangement::Disabled);
    let escaped = |row: &Vec<String>| row.iter().map(|cell| shown(cell)).collect::<Vec<_>>();
    if let Some((head, rows)) = rows.split_first() {
        table.set_header(escaped(head)).add_rows(rows.iter().map(escaped));
    }
    table.to_string()
}

/// A text in Markdown, of which no part is taken for a cell's end, a line's end or HTML.
pub(crate) fn markdown(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;").replace(['\n', '\r'], " ")
}

/// A table of rows, of which the first is the head, as CSV.
pub(crate) fn csv_table(rows: &[Vec<String>]) -> String {
    let mut writer = csv::WriterBuilder::new().flexible(true).from_writer(Vec::new());
    let written = rows.iter().try_for_each(|row| writer.write_record(row)).and_then(|()| Ok(writer.flush()?));
    written.expect("memory takes every row");
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// A table of rows, of which the first is the head, as a `tabular` of LaTeX (package booktabs), the first column to the left.
pub(crate) fn latex_table(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let line = |row: &Vec<String>| {
        let cells: Vec<String> = row.iter().map(|cell| latex_cell(cell)).collect();
        format!("{} \\\\\n", cells.join(" & "))
    };
    let (head, body) = rows
        .split_first()
        .map_or((String::new(), String::new()), |(head, rows)| (line(head), rows.iter().map(line).collect()));
    let layout = format!("l{}", "r".repeat(columns.saturating_sub(1)));
    format!(
        "\\begin{{tabular}}{{{layout}}}\n\\toprule\n{head}\\midrule\n{body}\\bottomrule\n\\end{{tabular}}\n"
    )
}

/// A cell in LaTeX: its numbers as numbers are set, the rest as text.
fn latex_cell(text: &str) -> String {
    let word = |word: &str| {
        let number = word.trim_start_matches('(').trim_end_matches([')', ',']);
        latex_number(number).map_or_else(|| latex(word), |set| word.replacen(number, &set, 1))
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// A number with a sign or a power of ten in LaTeX: a hyphen is no minus.
fn latex_number(text: &str) -> Option<String> {
    text.parse::<f64>().ok().filter(|number| number.is_finite())?;
    match (text.split_once('e'), text.strip_prefix('-')) {
        (Some((factor, power)), _) => Some(format!("${factor}\\times10^{{{power}}}$")),
        (None, Some(size)) => Some(format!("$-${size}")),
        (None, None) => None,
    }
}

/// A text in LaTeX.
fn latex(text: &str) -> String {
    let letter = |c: char| match c {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '±' => "$\\pm$".to_owned(),
        '−' => "$-$".to_owned(),
        '–' => "--".to_owned(),
        '\n' | '\r' => " ".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(letter).collect()
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
    #[test]
    fn tables_of_other_programs_are_escaped() {
        let rows =
            [vec!["run".to_owned(), "a, b".to_owned()], vec!["x_1 & 5 %".to_owned(), "1 ± 2".to_owned()]];
        assert_eq!(super::csv_table(&rows), "run,\"a, b\"\nx_1 & 5 %,1 ± 2\n");
        let latex = super::latex_table(&rows);
        assert!(
            latex.starts_with("\\begin{tabular}{lr}\n\\toprule\nrun & a, b \\\\\n\\midrule\n"),
            "{latex}"
        );
        assert!(latex.contains("x\\_1 \\& 5 \\% & 1 $\\pm$ 2 \\\\\n\\bottomrule"), "{latex}");
        let set = ["-1.67 ± 5e-4 (1.67)", "9.50, -2e-3", "a-4 -b 1e400"].map(super::latex_cell);
        let expected =
            ["$-$1.67 $\\pm$ $5\\times10^{-4}$ (1.67)", "9.50, $-2\\times10^{-3}$", "a-4 -b 1e400"];
        assert_eq!(set, expected);
    }
}
