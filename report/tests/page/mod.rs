//! What a rendered page holds.

use serde_json::Value;

pub const PLOTLY: &str = include_str!("../../assets/plotly-cartesian.min.js");

/// The data of every figure of a rendered report.
pub fn figures(html: &str) -> Vec<Value> {
    html.split("<script type=\"application/json\">")
        .skip(1)
        .map(|rest| serde_json::from_str(rest.split("</script>").next().unwrap()).unwrap())
        .collect()
}

pub fn check_figures(html: &str) {
    let figures = figures(html);
    assert!(!figures.is_empty());
    for figure in figures {
        let axes = figure["layout"].as_object().unwrap().iter().filter(|(key, _)| key.contains("axis"));
        for (key, axis) in axes {
            let title = axis["title"]["text"].as_str().unwrap();
            let has_unit = title.ends_with(')') && title.contains(" (");
            assert!(has_unit || axis["type"] == "category", "{key} without unit: {title}");
        }
        for trace in figure["data"].as_array().unwrap() {
            let (x, y) = (trace["x"].as_array().unwrap(), trace["y"].as_array().unwrap());
            if trace["type"] == "heatmap" {
                let z = trace["z"].as_array().unwrap();
                assert_eq!(z.len(), y.len(), "{}", trace["name"]);
                assert!(z.iter().all(|line| line.as_array().unwrap().len() == x.len()), "{}", trace["name"]);
                let numbers = z.iter().flat_map(|line| line.as_array().unwrap()).filter(|z| z.is_number());
                assert!(numbers.count() > 0, "nothing to see in {}", trace["name"]);
                continue;
            }
            assert_eq!(x.len(), y.len(), "{}", trace["name"]);
            let numbers = |axis: &str, values: &[Value]| {
                let category = figure["layout"][axis]["type"] == "category";
                values.iter().any(|value| value.is_number() || (category && value.is_string()))
            };
            let axis = trace["yaxis"].as_str().unwrap().replace('y', "yaxis");
            assert!(numbers("xaxis", x) && numbers(&axis, y), "nothing to see in {}", trace["name"]);
            assert!(x.iter().chain(y).any(Value::is_number), "nothing to see in {}", trace["name"]);
            assert!(!trace["name"].as_str().unwrap().is_empty());
        }
    }
}

/// What would make a browser leave the file: none of it may occur outside the library.
pub fn outside_references(html: &str) -> Vec<String> {
    let own = html.replace(PLOTLY, "");
    let calls =
        ["fetch(", "XMLHttpRequest", "WebSocket", "EventSource", "sendBeacon", "import(", "@import", "url("];
    let attributes = [" src=", " href=", "<link", "<iframe", "<base", "<object", "<embed"];
    let mut found: Vec<String> = calls
        .iter()
        .chain(&attributes)
        .filter(|&&sign| own.contains(sign))
        .map(|&sign| sign.to_owned())
        .collect();
    found.extend(
        own.match_indices("://")
            .map(|(at, _)| own[at.saturating_sub(8)..].chars().take(40).collect::<String>()),
    );
    found
}
