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
        let heading = |(column, title): (usize, &String)| {
            format!("<th scope=\"col\"{}>{}</th>", class(column), escape(title))
        };
        let cell = |(column, text): (usize, &String)| match column {
            0 => format!("<th scope=\"row\">{}</th>", prose(text)),
            _ => format!("<td{}>{}</td>", class(column), prose(text)),
        };
        let row = |cells: &Vec<String>| {
            format!("<tr>{}</tr>\n", cells.iter().enumerate().map(cell).collect::<String>())
        };
        let header: String = self.header.iter().enumerate().map(heading).collect();
        let rows: String = self.rows.iter().map(row).collect();
        // The caption stands below the table and not inside it: on a narrow screen the table scrolls.
        format!(
            "<div class=\"table\"><table id=\"table-{number}\" aria-labelledby=\"caption-{number}\">\n\
             <thead><tr>{header}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n\
             <p class=\"caption\" id=\"caption-{number}\"><b>Table {number}.</b> {}</p>\n",
            prose(&self.caption)
        )
    }
}
