//! Comparisons of single numbers.

use crate::{Axis, Colour, Figure, ReportError, Trace};

/// Bars of several groups over named categories; a group is its name, its colour and
/// one value per category.
///
/// # Errors
/// [`ReportError::BarCount`] if a group has another number of values than there are categories.
pub fn bar_figure(
    category: &str,
    categories: &[String],
    value: Axis,
    groups: &[(&str, Colour, Vec<f64>)],
) -> Result<Figure, ReportError> {
    let mut figure = Figure::new(Axis::category(category), value.from_zero()).height(340);
    for (name, colour, values) in groups {
        if values.len() != categories.len() {
            return Err(ReportError::BarCount {
                name: (*name).to_owned(),
                found: values.len(),
                expected: categories.len(),
            });
        }
        figure = figure.trace(Trace::bars(name, categories, values, *colour));
    }
    Ok(figure)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_of_another_length_is_refused() {
        let categories = ["a".to_owned(), "b".to_owned()];
        let error =
            bar_figure("robot", &categories, Axis::new("RMSE", "m"), &[("online", Colour::Ink, vec![1.0])])
                .unwrap_err();
        assert!(error.to_string().contains("1 values for 2 categories"), "{error}");
    }
}
