//! Tables for a terminal.

use std::fmt::Write as _;

use console::measure_text_width;

use super::cell::cell;
use super::notes::notes;
use super::number::shorten;
use super::results::Results;

/// Space between two columns.
const GAP: usize = 2;

/// Side on which a column's cells are flush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

/// A column of a [`Table`].
#[derive(Debug, Clone)]
pub struct Column {
    /// Heading, one entry a line.
    pub heading: Vec<String>,
    /// Side on which the cells are flush.
    pub align: Align,
    /// Width the column may shrink to; `None` when its cells must stay whole.
    pub min_width: Option<usize>,
    /// Cells from top to bottom.
    pub cells: Vec<String>,
}

/// Columns of equal length that know how to fit a width.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Columns from left to right.
    pub columns: Vec<Column>,
}

impl Table {
    /// The table in lines of at most `width` columns.
    ///
    /// Shrinkable columns give way first, the widest before the others.
    /// If that is not enough, whole-cell columns are left out from the right and counted in a last line.
    #[must_use]
    pub fn render(&self, width: usize) -> String {
        let mut columns: Vec<&Column> = self.columns.iter().collect();
        let mut num_hidden = 0;
        let widths = loop {
            if let Some(widths) = fit(&columns, width) {
                break widths;
            }
            match columns.iter().rposition(|column| column.min_width.is_none()) {
                // The first column names the row and stays.
                Some(index) if index > 0 => {
                    columns.remove(index);
                    num_hidden += 1;
                }
                _ => break columns.iter().map(|column| natural_width(column)).collect(),
            }
        };
        let mut text = String::new();
        let num_heading_lines = columns.iter().map(|column| column.heading.len()).max().unwrap_or(0);
        for line in 0..num_heading_lines {
            push_line(&mut text, &columns, &widths, |column| column.heading.get(line));
        }
        let total = widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1);
        text.push_str(&"-".repeat(total));
        text.push('\n');
        let num_rows = columns.iter().map(|column| column.cells.len()).max().unwrap_or(0);
        for row in 0..num_rows {
            push_line(&mut text, &columns, &widths, |column| column.cells.get(row));
        }
        if num_hidden > 0 {
            let _ = writeln!(text, "({num_hidden} columns do not fit here; the files have them)");
        }
        text
    }
}

fn natural_width(column: &Column) -> usize {
    column.heading.iter().chain(&column.cells).map(|text| measure_text_width(text)).max().unwrap_or(0)
}

/// Column widths that fill at most `width`, or `None` when even the narrowest do not fit.
fn fit(columns: &[&Column], width: usize) -> Option<Vec<usize>> {
    let mut widths: Vec<usize> = columns.iter().map(|column| natural_width(column)).collect();
    let gaps = GAP * columns.len().saturating_sub(1);
    while widths.iter().sum::<usize>() + gaps > width {
        let (widest, _) = columns
            .iter()
            .zip(&widths)
            .enumerate()
            .filter(|(_, (column, now))| column.min_width.is_some_and(|min| **now > min))
            .max_by_key(|(_, (_, now))| **now)?;
        widths[widest] -= 1;
    }
    Some(widths)
}

fn push_line<'a>(
    text: &mut String,
    columns: &[&'a Column],
    widths: &[usize],
    cell: impl Fn(&'a Column) -> Option<&'a String>,
) {
    let start = text.len();
    for (index, (column, &width)) in columns.iter().zip(widths).enumerate() {
        if index > 0 {
            text.push_str(&" ".repeat(GAP));
        }
        let content = shorten(cell(column).map_or("", String::as_str), width);
        let padding = " ".repeat(width.saturating_sub(measure_text_width(&content)));
        match column.align {
            Align::Left => text.extend([content.as_str(), padding.as_str()]),
            Align::Right => text.extend([padding.as_str(), content.as_str()]),
        }
    }
    let trimmed = start + text[start..].trim_end().len();
    text.truncate(trimmed);
    text.push('\n');
}

/// The cases of a run as a table: id, caption, duration, the metrics in `keys`, notes.
///
/// A metric that no case has is left out; a case without a value shows `-`.
#[must_use]
pub fn results_table(results: &Results, keys: &[&str], width: usize) -> String {
    let cases = &results.cases;
    let words = |heading: &str, min_width, cells: Vec<String>| Column {
        heading: vec![String::new(), String::new(), heading.to_owned(), String::new()],
        align: Align::Left,
        min_width,
        cells,
    };
    let mut columns = vec![
        words("case", None, cases.iter().map(|case| shorten(&case.id, 48)).collect()),
        words("caption", Some(12), cases.iter().map(|case| shorten(case.caption(), 28)).collect()),
        Column {
            heading: vec![String::new(), String::new(), "length".to_owned(), "s".to_owned()],
            align: Align::Right,
            min_width: None,
            cells: cases.iter().map(|case| format!("{:.1}", case.duration_secs)).collect(),
        },
    ];
    for metric in results.shown_metrics(keys) {
        // A title of several words takes two lines, so that it does not widen its column.
        let (above, title) = metric.title.rsplit_once(' ').unwrap_or(("", &metric.title));
        columns.push(Column {
            heading: [&metric.level.to_string(), above, title, &metric.unit].map(str::to_owned).to_vec(),
            align: Align::Right,
            min_width: None,
            cells: cases.iter().map(|case| cell(case, &metric.key)).collect(),
        });
    }
    let noted = cases.iter().map(|case| {
        let texts: Vec<String> = notes(case).into_iter().map(|note| note.text).collect();
        texts.join(", ")
    });
    columns.push(words("notes", Some(16), noted.collect()));
    Table { columns }.render(width)
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::super::results::samples::results;
    use super::*;

    fn column(heading: &str, min_width: Option<usize>, cell: &str) -> Column {
        Column {
            heading: vec![heading.to_owned()],
            align: Align::Left,
            min_width,
            cells: vec![cell.to_owned()],
        }
    }

    #[test]
    fn wide_cells_give_way_to_numbers() {
        let table = Table {
            columns: vec![
                column("id", None, "walk"),
                column("text", Some(4), "a person walks"),
                column("n", None, "12345"),
            ],
        };
        assert_eq!(
            table.render(80),
            "id    text            n\n---------------------------\nwalk  a person walks  12345\n"
        );
        assert_eq!(table.render(21), "id    text      n\n---------------------\nwalk  a perso…  12345\n");
        assert_eq!(
            table.render(12),
            "id    text\n------------\nwalk  a per…\n(1 columns do not fit here; the files have them)\n"
        );
    }

    #[test]
    fn every_line_fits_the_width() {
        let mut walk = case("a-rather-long-identity-of-a-case", &[("l0/skate", 1.5), ("l2/mpjpe", 20.0)]);
        walk.captions = vec!["歩く人 ".repeat(20)];
        let keys = ["l0/skate", "l2/mpjpe", "l3/upright"];
        let all = results(vec![walk]);
        for width in [60, 80, 120, 200] {
            for line in results_table(&all, &keys, width).lines().filter(|line| !line.starts_with('(')) {
                assert!(measure_text_width(line) <= width, "{width}: {line}");
            }
        }
        assert!(!results_table(&all, &keys, 200).contains("upright"), "no case has it");
    }

    #[test]
    fn a_missing_value_is_a_dash() {
        let text = results_table(
            &results(vec![case("a", &[("l0/skate", 1.5)]), case("b", &[])]),
            &["l0/skate"],
            200,
        );
        let row = text.lines().find(|line| line.starts_with('b')).unwrap();
        assert!(row.trim_end().ends_with('-'), "{row}");
    }
}
