//! Making text harmless inside HTML, inside a script element and inside a Plotly label.

use serde_json::Value;

/// Text for element content and for double- or single-quoted attributes.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// Escaped prose in which what stands between two backticks is set as code.
pub(crate) fn prose(text: &str) -> String {
    let pieces: Vec<&str> = text.split('`').collect();
    let balanced = pieces.len() % 2 == 1;
    let mut html = String::with_capacity(text.len());
    for (position, piece) in pieces.iter().enumerate() {
        match (balanced, position % 2) {
            (true, 1) => {
                html.push_str("<code>");
                html.push_str(&escape(piece));
                html.push_str("</code>");
            }
            (false, _) if position > 0 => {
                html.push('`');
                html.push_str(&escape(piece));
            }
            _ => html.push_str(&escape(piece)),
        }
    }
    html
}

/// JSON for a script element: with no `<` in it, neither `</script>` nor `<!--` can end or change it.
pub(crate) fn json_for_script(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Text for a Plotly label, which reads some HTML of its own.
pub(crate) fn label(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_text_becomes_text() {
        assert_eq!(
            escape(r#"<img src='x' onerror="a&b">"#),
            "&lt;img src=&#39;x&#39; onerror=&quot;a&amp;b&quot;&gt;"
        );
        assert_eq!(label("a<b>&c"), "a&lt;b&gt;&amp;c");
    }

    #[test]
    fn backticks_set_code_and_a_lone_one_stays() {
        assert_eq!(prose("run `a <b>` now"), "run <code>a &lt;b&gt;</code> now");
        assert_eq!(prose("a ` b"), "a ` b");
    }

    #[test]
    fn a_script_end_inside_json_cannot_end_the_script() {
        let value = Value::from("</script><script>alert(1)</script><!--");
        let json = json_for_script(&value);
        assert!(!json.contains('<'));
        assert_eq!(serde_json::from_str::<Value>(&json).unwrap(), value);
    }
}
