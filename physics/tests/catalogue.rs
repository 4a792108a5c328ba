//! The written catalogue, `docs/effects.md`, says what the code says; and every effect has its closed form.

use std::fmt::Write;

use pleiad_physics::{Effect, Parameter};

const DOCUMENT: &str = include_str!("../../docs/effects.md");
const CLOSED_FORMS: &[&str] = &[
    include_str!("closed_forms_actuator.rs"),
    include_str!("closed_forms_body.rs"),
    include_str!("closed_forms_sensors.rs"),
];

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn parameter(parameter: &Parameter, typical: f64) -> String {
    format!("{} [{}] {typical}", parameter.label(), parameter.unit)
}

/// The table as it should be.
fn table() -> String {
    let mut text = String::from(
        "| # | name | effect | parameters [unit], typical size | stage | channels | model | confounded with | broken by |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for effect in Effect::ALL {
        let info = effect.info();
        let typical = effect.typical_values();
        let parameters: Vec<_> =
            info.parameters.iter().zip(typical).map(|(own, size)| parameter(own, size)).collect();
        let channels: Vec<_> = info.channels.iter().map(|channel| channel.name()).collect();
        let stage = info.stage.name();
        let data = if info.bad_data { ", bad data" } else { "" };
        let cells = [
            info.number.to_string(),
            format!("`{}`", info.name),
            info.summary.to_owned(),
            parameters.join("; "),
            format!("{stage}{data}"),
            channels.join(", "),
            info.equation.to_owned(),
            info.confounded_with.to_owned(),
            info.broken_by.to_owned(),
        ];
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {} |", cells.map(|text| cell(&text)).join(" | "));
    }
    text
}

#[test]
fn the_document_holds_the_table_of_the_catalogue() {
    let expected = table();
    let written = DOCUMENT.find("| # |").map_or("", |start| &DOCUMENT[start..]);
    assert!(written == expected, "docs/effects.md should end with this table:\n{expected}");
}

#[test]
fn every_effect_is_compared_with_a_closed_form() {
    for effect in Effect::ALL {
        let variant = format!("Effect::{effect:?},");
        assert!(CLOSED_FORMS.iter().any(|text| text.contains(&variant)), "{variant} is in no test");
    }
}
