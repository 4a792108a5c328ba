//! Tables.

use crate::html::{escape, prose};

/// A table with a caption. Columns are text at first; [`Table::numeric`] aligns one to the right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    numeric: Vec<bool>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new(caption: impl Into<String>, header: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let header: Vec<String> = header.into_iter().map(Into::into).collect();
        let numeric = vec![false; header.len()];
        Self { caption: caption.into(), header, numeric, rows: Vec::new() }
    }

    /// Aligns all columns but the first to the right, with figures of equal width.
    pub fn numeric(mut self) -> Self {
        self.numeric.iter_mut().skip(1).for_each(|column| *column = true);
        self
    }

    /// Adds a row; cells beyond the header are left out, missing ones stay empty.
    pub fn row(mut self, cells: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.header.len(), String::new());
        self.rows.push(cells);
        self
    }

    /// The table as HTML, numbered for reference.
    pub(crate) fn render(&self, number: usize) -> String {
        let class = |column: usize| if self.numeric[column] { " class=\"number\"" } else { "" };
        let mut html = format!(
            "<div class=\"table\"><table id=\"table-{number}\">\n<caption><b>Table {number}.</b> {}</caption>\n\
             <thead><tr>",
            prose(&self.caption)
        );
        for (column, title) in self.header.iter().enumerate() {
            html += &format!("<th scope=\"col\"{}>{}</th>", class(column), escape(title));
        }
        html += "</tr></thead>\n<tbody>\n";
        for row in &self.rows {
            html += "<tr>";
            for (column, cell) in row.iter().enumerate() {
                let text = prose(cell);
                html += &if column == 0 {
                    format!("<th scope=\"row\">{text}</th>")
                } else {
                    format!("<td{}>{text}</td>", class(column))
                };
            }
            html += "</tr>\n";
        }
        html + "</tbody>\n</table></div>\n"
    }
}
