//! A card: one conclusion set apart, with what there is to know about it.

use crate::document::{Tone, each};
use crate::html::{escape, prose};

/// One conclusion with its particulars.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Card {
    tone: Tone,
    badge: String,
    heading: String,
    sentences: Vec<String>,
    particulars: Vec<(String, Particular)>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Particular {
    Text(String),
    Code(String),
}

impl Card {
    /// A card with nothing but its heading; the badge is a word or two on its kind.
    pub fn new(tone: Tone, badge: impl Into<String>, heading: impl Into<String>) -> Self {
        Self {
            tone,
            badge: badge.into(),
            heading: heading.into(),
            sentences: Vec::new(),
            particulars: Vec::new(),
        }
    }

    /// A sentence in larger type.
    pub fn sentence(mut self, text: impl Into<String>) -> Self {
        self.sentences.push(text.into());
        self
    }

    /// A particular: what, and what about it. Nothing if the text is empty.
    pub fn particular(mut self, key: impl Into<String>, text: impl Into<String>) -> Self {
        let text = text.into();
        if !text.is_empty() {
            self.particulars.push((key.into(), Particular::Text(text)));
        }
        self
    }

    /// Lines to copy. Nothing if there are none.
    pub fn code(mut self, key: impl Into<String>, lines: &str) -> Self {
        if !lines.trim().is_empty() {
            self.particulars.push((key.into(), Particular::Code(lines.trim_end().to_owned())));
        }
        self
    }

    pub(crate) fn render(&self) -> String {
        let sentences = each(&self.sentences, |text| format!("<p class=\"says\">{}</p>\n", prose(text)));
        let particulars = each(&self.particulars, |(key, particular)| {
            let body = match particular {
                Particular::Text(text) => prose(text),
                Particular::Code(lines) => format!("<pre><code>{}</code></pre>", escape(lines)),
            };
            format!("<div><dt>{}</dt><dd>{body}</dd></div>\n", escape(key))
        });
        format!(
            "<section class=\"card {}\">\n<h3>{} <span class=\"badge\">{}</span></h3>\n{sentences}\
             <dl class=\"rows\">\n{particulars}</dl>\n</section>\n",
            self.tone.class(),
            escape(&self.heading),
            escape(&self.badge)
        )
    }
}
