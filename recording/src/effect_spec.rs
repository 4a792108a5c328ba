//! An effect as it is written in `nominal.toml`, `corrected.toml` and scenarios.

use std::ops::Range;

use pleiad_physics::{ActiveEffect, Effect, EffectInfo, Fit, Parameter, Region, Scope};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::suggest::nearest;

/// An effect in a file. Parameters go by their names in the catalogue; those with components are arrays in
/// the order of the components.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectSpec {
    /// The effect's name in the catalogue.
    pub name: String,
    /// Values by parameter. A parameter that is left out has its off value.
    pub parameters: Table,
    /// 95 % intervals `[from, to]` by parameter, where they are known.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    pub ci95: Table,
    /// Where and when it acts; everywhere and always if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<ScopeSpec>,
}

/// Where and when an effect acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScopeSpec {
    /// Only in this rectangle of the map: `[x0, x1, y0, y1]`, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_m: Option<[f64; 4]>,
    /// Only from the first to before the second, seconds of the recording's time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<[f64; 2]>,
}

/// An effect of a model, with what is known of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct DeclaredEffect {
    /// The effect, its values and its scope.
    pub active: ActiveEffect<f64>,
    /// 95 % interval of each parameter, in the order of the parameters; `None` where it is not known.
    pub ci95: Vec<Option<[f64; 2]>>,
}

impl DeclaredEffect {
    /// An effect of whose intervals nothing is known.
    pub fn new(active: ActiveEffect<f64>) -> Self {
        Self { active, ci95: vec![None; active.values().len()] }
    }
}

/// What is wrong with an [`EffectSpec`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("key `{key}`: found {found}, expected {expected}")]
pub struct SpecError {
    /// The key within the effect, such as `parameters.offset_body_m`.
    pub key: String,
    /// What is there.
    pub found: String,
    /// What should be there.
    pub expected: String,
}

impl EffectSpec {
    /// The effect that this describes.
    ///
    /// # Errors
    /// The catalogue has no such effect, the effect no such parameter, or none is given; a value is no
    /// number, makes no sense for its parameter, or there are too few or too many for its components; an
    /// interval or a scope is reversed.
    pub fn declared(&self) -> Result<DeclaredEffect, SpecError> {
        let effect = Effect::from_name(&self.name).ok_or_else(|| unknown_effect(&self.name))?;
        let info = effect.info();
        let mut declared = DeclaredEffect::new(ActiveEffect::off(effect));
        let mut values: Vec<f64> = info.parameters.iter().map(|parameter| parameter.off).collect();
        if self.parameters.is_empty() {
            return Err(refused("parameters", "no value".to_owned(), &list(info)));
        }
        for (name, value) in &self.parameters {
            let (key, range) = place(info, "parameters", name)?;
            let given = components(value, range.len(), |value| number(value).filter(|value| !value.is_nan()))
                .ok_or_else(|| {
                    refused(&key, format!("`{value}`"), &shape(info, range.clone(), "a number"))
                })?;
            for (index, given) in range.zip(given) {
                let parameter = &info.parameters[index];
                if let Some(expected) = out_of_domain(parameter, given) {
                    return Err(refused(&key, format!("`{value}`"), &expected));
                }
                values[index] = given;
            }
        }
        for (name, value) in &self.ci95 {
            let (key, range) = place(info, "ci95", name)?;
            let given = components(value, range.len(), interval).ok_or_else(|| {
                let expected = shape(info, range.clone(), "an interval [from, to] with from <= to");
                refused(&key, format!("`{value}`"), &expected)
            })?;
            for (index, [from, to]) in range.zip(given) {
                // An interval without ends says nothing: it stands for a component that has none.
                let known = from.is_finite() || to.is_finite();
                declared.ci95[index] = known.then_some([from, to]);
            }
        }
        let active = ActiveEffect::new(effect, &values)
            .map_err(|error| refused("parameters", error.to_string(), "finite numbers"))?;
        declared.active = active.within(self.within.unwrap_or_default().scope()?);
        Ok(declared)
    }
}

impl ScopeSpec {
    /// The scope that this describes.
    ///
    /// # Errors
    /// A bound is no number, or the bounds are reversed.
    pub fn scope(&self) -> Result<Scope, SpecError> {
        let region = match self.region_m {
            Some([x0, x1, y0, y1]) if x0 < x1 && y0 < y1 => Some(Region::from_bounds([x0, x1, y0, y1])),
            Some(bounds) => {
                let expected = "[x0, x1, y0, y1] with x0 < x1 and y0 < y1";
                return Err(refused("within.region_m", format!("`{bounds:?}`"), expected));
            }
            None => None,
        };
        let window_s = match self.time_s {
            Some([from, to]) if from < to => Some((from, to)),
            Some(times) => {
                return Err(refused("within.time_s", format!("`{times:?}`"), "[from, to] with from < to"));
            }
            None => None,
        };
        Ok(Scope { region, window_s })
    }
}

impl From<&Scope> for ScopeSpec {
    fn from(scope: &Scope) -> Self {
        let bounds = |region: Region| [region.x_m.0, region.x_m.1, region.y_m.0, region.y_m.1];
        Self { region_m: scope.region.map(bounds), time_s: scope.window_s.map(|(from, to)| [from, to]) }
    }
}

impl From<&DeclaredEffect> for EffectSpec {
    fn from(declared: &DeclaredEffect) -> Self {
        let active = &declared.active;
        let info = active.effect().info();
        let mut spec = Self { name: info.name.to_owned(), ..Self::default() };
        let mut index = 0;
        while index < info.parameters.len() {
            let name = info.parameters[index].name;
            let range = range_of(info, name).unwrap_or(index..index + 1);
            let values = active.values()[range.clone()].iter().map(|&value| Value::Float(value));
            spec.parameters.insert(name.to_owned(), written(info, &range, values.collect()));
            let intervals = &declared.ci95[range.clone()];
            if intervals.iter().any(Option::is_some) {
                let unknown = [f64::NEG_INFINITY, f64::INFINITY];
                let ends =
                    |own: &Option<[f64; 2]>| Value::Array(own.unwrap_or(unknown).map(Value::Float).to_vec());
                let intervals = intervals.iter().map(ends).collect();
                spec.ci95.insert(name.to_owned(), written(info, &range, intervals));
            }
            index = range.end;
        }
        let scope = ScopeSpec::from(&active.scope);
        spec.within = (scope != ScopeSpec::default()).then_some(scope);
        spec
    }
}

/// A value as such, or several as an array.
fn written(info: &EffectInfo, range: &Range<usize>, mut values: Vec<Value>) -> Value {
    match values.pop() {
        Some(only) if is_scalar(info, range) => only,
        Some(last) => {
            values.push(last);
            Value::Array(values)
        }
        None => Value::Array(values),
    }
}

fn is_scalar(info: &EffectInfo, range: &Range<usize>) -> bool {
    range.len() == 1 && info.parameters[range.start].component.is_none()
}

/// Which parameters go by this name: their components follow one another.
fn range_of(info: &EffectInfo, name: &str) -> Option<Range<usize>> {
    let first = info.parameters.iter().position(|parameter| parameter.name == name)?;
    let count = info.parameters[first..].iter().take_while(|parameter| parameter.name == name).count();
    Some(first..first + count)
}

/// The key of a parameter in a table, and which components it has.
fn place(info: &EffectInfo, table: &str, name: &str) -> Result<(String, Range<usize>), SpecError> {
    let key = format!("{table}.{name}");
    match range_of(info, name) {
        Some(range) => Ok((key, range)),
        None => Err(refused(&key, "this parameter".to_owned(), &list(info))),
    }
}

/// One item, or an array of `count`.
fn components<T>(value: &Value, count: usize, read: impl Fn(&Value) -> Option<T>) -> Option<Vec<T>> {
    if count == 1 {
        return read(value).map(|item| vec![item]);
    }
    let items = value.as_array().filter(|items| items.len() == count)?;
    items.iter().map(read).collect()
}

/// What makes no sense for a parameter: what to give instead.
fn out_of_domain(parameter: &Parameter, value: f64) -> Option<String> {
    let (least, greatest) = parameter.plausible;
    let whole = value.fract() == 0.0 && (least..=greatest).contains(&value);
    if parameter.fit == Fit::Choice && !whole {
        return Some(format!("a whole number from {least} to {greatest}"));
    }
    // A length or a time over which something dies out, a limit.
    if least > 0.0 && value <= 0.0 {
        return Some("a number above 0".to_owned());
    }
    // A part of something that stays positive.
    if parameter.unit == "1" && (-1.0..0.0).contains(&least) && value <= -1.0 {
        return Some("a number above -1".to_owned());
    }
    (value.is_infinite() && parameter.off.is_finite()).then(|| "a finite number".to_owned())
}

/// A number, written as integer or decimal.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(value) => Some(*value),
        // Labels and sizes, far below the 2^53 from which an integer would lose digits.
        Value::Integer(value) => Some(*value as f64),
        _ => None,
    }
}

fn interval(value: &Value) -> Option<[f64; 2]> {
    let [from, to] = value.as_array()?.as_slice() else { return None };
    let (from, to) = (number(from)?, number(to)?);
    (from <= to).then_some([from, to])
}

/// What a parameter expects: one item or so many.
fn shape(info: &EffectInfo, range: Range<usize>, item: &str) -> String {
    if is_scalar(info, &range) {
        return format!("{item} ({})", info.parameters[range.start].unit);
    }
    let named = info.parameters[range].iter().map(|own| {
        let component = own.component.unwrap_or(own.name);
        format!("{component} ({})", own.unit)
    });
    format!("an array with {item} for each of {}", named.collect::<Vec<_>>().join(", "))
}

/// The names of an effect's parameters.
fn list(info: &EffectInfo) -> String {
    let mut names: Vec<&str> = info.parameters.iter().map(|parameter| parameter.name).collect();
    names.dedup();
    format!("a value for a parameter of `{}`, which has: {}", info.name, names.join(", "))
}

fn unknown_effect(name: &str) -> SpecError {
    let known = Effect::ALL.iter().map(|effect| effect.name());
    let expected = match nearest(name, known) {
        Some(nearest) => format!("an effect of the catalogue, perhaps \"{nearest}\""),
        None => "an effect of the catalogue, which `pleiad effects` lists".to_owned(),
    };
    refused("name", format!("\"{name}\""), &expected)
}

fn refused(key: &str, found: String, expected: &str) -> SpecError {
    SpecError { key: key.to_owned(), found, expected: expected.to_owned() }
}

#[cfg(test)]
mod tests;
