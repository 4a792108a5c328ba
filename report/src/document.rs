//! A report: built block by block, rendered as one HTML file that needs nothing else.

use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use crate::html::{escape, json_for_script, prose};
use crate::trace::Thinning;
use crate::{Card, Figure, MAX_POINTS, ReportError, Table};

const STYLE: &str = include_str!("../assets/report.css");
const SCRIPT: &str = include_str!("../assets/report.js");
const PLOTLY: &str = include_str!("../assets/plotly-cartesian.min.js");

/// Nothing is fetched from anywhere: pictures may only be made by the page itself (the download button).
const CONTENT_SECURITY_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; \
     style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'";

/// A report. Text is plain: everything in it is escaped, and what stands between backticks is set as code.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    title: String,
    blocks: Vec<Block>,
    commands: Vec<(String, String)>,
}

/// Whether the run showed what it was to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It did.
    Holds,
    /// It did not.
    Fails,
}

/// The colour of a conclusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Nothing to do.
    Good,
    /// Something to change.
    Bad,
    /// Something to find out.
    Open,
}

impl Tone {
    pub(crate) fn class(self) -> &'static str {
        match self {
            Self::Good => "holds",
            Self::Bad => "fails",
            Self::Open => "open",
        }
    }
}

/// One of several figures side by side (below one another on a narrow screen).
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What distinguishes it from its neighbours.
    pub heading: String,
    /// The figure.
    pub figure: Figure,
}

#[derive(Clone, Debug, PartialEq)]
enum Block {
    Lead(String),
    Conclusion(Tone, String, String),
    Facts(Vec<(String, String)>),
    Section(String),
    Part(String),
    Prose(String),
    List(Vec<String>),
    Table(Table),
    Figure(Vec<Panel>, String),
    Drawing(String, String),
    Card(Card),
}

/// Running numbers of what is referred to.
#[derive(Default)]
struct Numbers {
    tables: usize,
    figures: usize,
    plots: usize,
}

impl Document {
    /// A report with nothing but its title.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new(), commands: Vec::new() }
    }

    /// A paragraph in larger type: what this is about.
    pub fn lead(self, text: impl Into<String>) -> Self {
        self.with(Block::Lead(text.into()))
    }

    /// The conclusion, set apart.
    pub fn verdict(self, verdict: Verdict, text: impl Into<String>) -> Self {
        let (tone, word) = match verdict {
            Verdict::Holds => (Tone::Good, "As predicted."),
            Verdict::Fails => (Tone::Bad, "Not as predicted."),
        };
        self.conclusion(tone, word, text)
    }

    /// A conclusion in a few words, and what there is to say of it, set apart.
    pub fn conclusion(self, tone: Tone, words: impl Into<String>, text: impl Into<String>) -> Self {
        self.with(Block::Conclusion(tone, words.into(), text.into()))
    }

    /// A card.
    pub fn card(self, card: Card) -> Self {
        self.with(Block::Card(card))
    }

    /// A drawing of our own; the caption says what to see in it.
    pub(crate) fn drawing(self, svg: String, caption: impl Into<String>) -> Self {
        self.with(Block::Drawing(svg, caption.into()))
    }

    /// A key and its value; neighbours form one compact list.
    pub fn fact(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        let fact = (key.into(), value.into());
        if let Some(Block::Facts(facts)) = self.blocks.last_mut() {
            facts.push(fact);
            return self;
        }
        self.with(Block::Facts(vec![fact]))
    }

    /// Starts a section.
    pub fn section(self, heading: impl Into<String>) -> Self {
        self.with(Block::Section(heading.into()))
    }

    /// Starts a part of several sections; on paper, a new page.
    pub fn part(self, heading: impl Into<String>) -> Self {
        self.with(Block::Part(heading.into()))
    }

    /// A paragraph.
    pub fn prose(self, text: impl Into<String>) -> Self {
        self.with(Block::Prose(text.into()))
    }

    /// A list; nothing if it has no items.
    pub fn list(self, items: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let items: Vec<String> = items.into_iter().map(Into::into).collect();
        if items.is_empty() { self } else { self.with(Block::List(items)) }
    }

    /// A table.
    pub fn table(self, table: Table) -> Self {
        self.with(Block::Table(table))
    }

    /// A figure; the caption says what to see in it.
    pub fn figure(self, figure: Figure, caption: impl Into<String>) -> Self {
        self.panels(vec![Panel { heading: String::new(), figure }], caption)
    }

    /// Figures side by side under one caption; nothing if there are none.
    pub fn panels(self, panels: Vec<Panel>, caption: impl Into<String>) -> Self {
        if panels.is_empty() { self } else { self.with(Block::Figure(panels, caption.into())) }
    }

    /// A command that reproduces something, for the foot of the report.
    pub fn reproduce(mut self, what: impl Into<String>, command: impl Into<String>) -> Self {
        self.commands.push((what.into(), command.into()));
        self
    }

    /// The report as one HTML file.
    pub fn render(&self) -> String {
        let mut numbers = Numbers::default();
        let body: String = self.blocks.iter().map(|block| block.render(&mut numbers)).collect();
        let (title, foot) = (escape(&self.title), self.foot());
        let plotly = if numbers.plots > 0 { format!("<script>{PLOTLY}</script>\n") } else { String::new() };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{CONTENT_SECURITY_POLICY}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
             <header><h1>{title}</h1>\
             <button type=\"button\" id=\"theme\" title=\"Colour theme\" aria-label=\"Colour theme\" hidden></button></header>\n\
             <noscript><p class=\"verdict fails\">The figures need JavaScript, which is switched off; \
             text and tables are complete.</p></noscript>\n\
             <main>\n{body}</main>\n{foot}{plotly}<script>\n{SCRIPT}</script>\n</body>\n</html>\n"
        )
    }

    /// Writes the report; a reader sees the old file or the new one, never half of it.
    ///
    /// # Errors
    /// [`ReportError::Write`] names the file and what the system said.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        write_atomically(path, &self.render())
    }

    fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    fn foot(&self) -> String {
        let commands = each(&self.commands, |(what, command)| {
            format!("<p>{}</p>\n<pre><code>{}</code></pre>\n", prose(what), escape(command))
        });
        let heading = if commands.is_empty() { "" } else { "<h2>Reproduce</h2>\n" };
        format!(
            "<footer>\n{heading}{commands}<p class=\"fine\">Made by Pleiad. This file is complete in itself and fetches \
             nothing. Colours follow Okabe and Ito and can be told apart with any colour vision. \
             Figures are drawn by Plotly.js (MIT licence); drag to zoom, double-click to reset, click a legend entry to \
             hide it.</p>\n</footer>\n"
        )
    }
}

impl Block {
    fn render(&self, numbers: &mut Numbers) -> String {
        match self {
            Self::Lead(text) => format!("<p class=\"lead\">{}</p>\n", prose(text)),
            Self::Conclusion(tone, words, text) => {
                let class = tone.class();
                format!("<p class=\"verdict {class}\"><b>{}</b> {}</p>\n", escape(words), prose(text))
            }
            Self::Facts(facts) => {
                let items = each(facts, |(key, value)| {
                    format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(key), prose(value))
                });
                format!("<dl>\n{items}</dl>\n")
            }
            Self::Section(heading) => format!("<h2>{}</h2>\n", escape(heading)),
            Self::Part(heading) => format!("<h2 class=\"part\">{}</h2>\n", escape(heading)),
            Self::Card(card) => card.render(),
            Self::Drawing(svg, caption) => {
                numbers.figures += 1;
                let number = numbers.figures;
                format!(
                    "<figure id=\"figure-{number}\">\n<div class=\"drawing\">{svg}</div>\n\
                     <figcaption><b>Figure {number}.</b> {}</figcaption>\n</figure>\n",
                    prose(caption)
                )
            }
            Self::Prose(text) => format!("<p>{}</p>\n", prose(text)),
            Self::List(items) => {
                let items = each(items, |item| format!("<li>{}</li>\n", prose(item)));
                format!("<ul>\n{items}</ul>\n")
            }
            Self::Table(table) => {
                numbers.tables += 1;
                table.render(numbers.tables)
            }
            Self::Figure(panels, caption) => {
                numbers.figures += 1;
                render_figure(panels, caption, numbers)
            }
        }
    }
}

/// The HTML of every item, joined.
pub(crate) fn each<T>(items: &[T], html: impl Fn(&T) -> String) -> String {
    items.iter().map(html).collect()
}

fn render_figure(panels: &[Panel], caption: &str, numbers: &mut Numbers) -> String {
    let number = numbers.figures;
    let spoken = escape(caption);
    let mut drawn = String::new();
    for panel in panels {
        numbers.plots += 1;
        drawn += &render_panel(panel, numbers.plots, &spoken);
    }
    let any = |thinning| panels.iter().any(|panel| panel.figure.has(thinning));
    let thinned = if any(Thinning::ToExtremes) {
        format!(" Long series are thinned to at most {MAX_POINTS} points each; every peak is kept.")
    } else {
        String::new()
    };
    let sampled = if any(Thinning::EvenSample) {
        format!(" Of very many points an even sample of {MAX_POINTS} is drawn.")
    } else {
        String::new()
    };
    format!(
        "<figure id=\"figure-{number}\">\n<div class=\"panels panels-{}\">\n{drawn}</div>\n\
         <figcaption><b>Figure {number}.</b> {}{thinned}{sampled}</figcaption>\n</figure>\n",
        panels.len().min(3),
        prose(caption)
    )
}

fn render_panel(panel: &Panel, plot: usize, spoken: &str) -> String {
    let (class, heading) = if panel.heading.is_empty() {
        ("panel", String::new())
    } else {
        ("panel headed", format!("<h3>{}</h3>", escape(&panel.heading)))
    };
    format!(
        "<div class=\"{class}\">{heading}\
         <div class=\"plot\" id=\"plot-{plot}\" role=\"img\" aria-label=\"{spoken}\"></div>\
         <script type=\"application/json\">{}</script></div>\n",
        json_for_script(&panel.figure.to_json())
    )
}

/// Writes beside `path` and renames, so that no half-written file is ever seen under its name.
pub(crate) fn write_atomically(path: &Path, text: &str) -> Result<(), ReportError> {
    let mut name = OsString::from(path);
    name.push(".part");
    let part = Path::new(&name);
    let written = File::create(part)
        .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(part, path));
    written.map_err(|source| ReportError::Write { path: path.to_owned(), source })
}
