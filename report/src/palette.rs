//! Colours that people with any colour vision tell apart, and line patterns for a second distinction.

/// The palette of Okabe & Ito 2008 ("Color Universal Design"), in the order in which robots take it:
/// darkest and most saturated first. Its yellow and black are left out, for they vanish on a white and
/// on a dark page.
pub const OKABE_ITO: [&str; 6] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"];

/// The colour of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// The how-manieth of the palette; beyond its end it starts again.
    Series(usize),
    /// The page's text colour, whatever the theme.
    Ink,
    /// A quieter text colour, for references and bounds.
    Muted,
}

impl Colour {
    /// As Plotly takes it; names with `@` are replaced in the page by the colours of its theme.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Self::Series(index) => OKABE_ITO[index % OKABE_ITO.len()],
            Self::Ink => "@ink",
            Self::Muted => "@muted",
        }
    }
}

/// The pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// Unbroken.
    Solid,
    /// Dashes.
    Dash,
    /// Dots.
    Dot,
    /// Dashes and dots in turn.
    DashDot,
}

impl Dash {
    /// The pattern of the how-manieth case; beyond the fourth it starts again.
    pub fn of_case(index: usize) -> Self {
        [Self::Dash, Self::Solid, Self::Dot, Self::DashDot][index % 4]
    }

    /// For people.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Dash => "dashed",
            Self::Dot => "dotted",
            Self::DashDot => "dash-dotted",
        }
    }

    /// As Plotly takes it.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Self::Solid => "solid",
            Self::Dash => "dash",
            Self::Dot => "dot",
            Self::DashDot => "dashdot",
        }
    }
}
