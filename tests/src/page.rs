//! Tables that a benchmark writes into a page of `docs/benchmarks/`.

/// What the table stands between.
const MARKS: [&str; 2] = ["<!-- table -->", "<!-- end -->"];

/// Puts the table between the marks of a page.
///
/// # Errors
///
/// A page that cannot be read or written, or has no marks, in words.
pub fn replace(file: &str, table: &str) -> Result<(), String> {
    let page = std::fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
    let [begin, end] = MARKS;
    let (before, rest) = page.split_once(begin).ok_or_else(|| format!("{file}: no line {begin}"))?;
    let (_, after) = rest.split_once(end).ok_or_else(|| format!("{file}: no line {end}"))?;
    let page = format!("{before}{begin}\n\n{table}\n{end}{after}");
    std::fs::write(file, page).map_err(|error| format!("{file}: {error}"))
}
