//! Reading a scenario file: defaults, then each robot's own settings over them.

use std::collections::BTreeMap;
use std::path::Path;

use pleiad_bus::FaultPlan;
use pleiad_estimation::{LandmarkId, RobotId};
use pleiad_physics::ActiveEffect;
use pleiad_recording::EffectSpec;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::keys::{self, Lines};
use super::validate::Invalid;
use super::{Arena, RobotSettings, Scenario};
use crate::Error;

/// The settings of every robot.
const DEFAULTS: &str = "defaults";
/// The effects of the defaults or of a robot.
pub(super) const EFFECTS: &str = "effects";

/// The file as it is written.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    name: String,
    #[serde(default = "first_seed")]
    seed: i64,
    duration_s: f64,
    #[serde(default)]
    arena: Arena,
    #[serde(default = "truth_rate_hz")]
    truth_rate_hz: f64,
    #[serde(default)]
    truth_sigma_m: f64,
    #[serde(default)]
    truth_sigma_rad: f64,
    #[serde(default)]
    team_size: u32,
    #[serde(default)]
    random_landmarks: u32,
    #[serde(default)]
    walls_m: Vec<[f64; 4]>,
    #[serde(default)]
    landmarks: Vec<Landmark>,
    #[serde(default)]
    defaults: Table,
    #[serde(default)]
    robots: Vec<Table>,
    /// Read by [`FaultPlan::from_toml`].
    #[serde(default)]
    fault: Vec<Table>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Landmark {
    id: u32,
    x_m: f64,
    y_m: f64,
    #[serde(default)]
    kind: u32,
}

/// Seed of a scenario that names none.
fn first_seed() -> i64 {
    1
}

/// Rate of the ground truth of a scenario that names none, Hz; that of the sample recordings.
fn truth_rate_hz() -> f64 {
    50.0
}

impl Document {
    /// One that has every key.
    pub(super) fn example(defaults: Table, robot: Table) -> Self {
        Self {
            name: String::new(),
            seed: first_seed(),
            duration_s: 0.0,
            arena: Arena::default(),
            truth_rate_hz: truth_rate_hz(),
            truth_sigma_m: 0.0,
            truth_sigma_rad: 0.0,
            team_size: 0,
            random_landmarks: 0,
            walls_m: vec![[0.0; 4]],
            landmarks: vec![Landmark { id: 0, x_m: 0.0, y_m: 0.0, kind: 0 }],
            defaults,
            robots: vec![robot],
            fault: Vec::new(),
        }
    }
}

impl Scenario {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// As [`Scenario::from_toml`], and [`Error::Read`].
    pub fn load(path: &Path) -> Result<Self, Error> {
        let text =
            std::fs::read_to_string(path).map_err(|source| Error::Read { file: path.to_owned(), source })?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Reads a scenario from text; `file` is the name that errors give it.
    ///
    /// # Errors
    /// [`Error::Syntax`], [`Error::UnknownKey`], [`Error::Value`], each with file and, where the key is
    /// written out, its line.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, Error> {
        let lines = keys::check(text, file)?;
        let faults = FaultPlan::from_toml(text, file)?;
        let document: Document = toml::from_str(text).map_err(|error| Error::Syntax {
            place: keys::place(file, error.span().map(|span| 1 + text[..span.start].matches('\n').count())),
            message: error.message().to_owned(),
        })?;
        Loader { file, lines }.scenario(document, faults)
    }
}

struct Loader<'a> {
    file: &'a str,
    lines: Lines,
}

impl Loader<'_> {
    fn scenario(&self, document: Document, faults: FaultPlan) -> Result<Scenario, Error> {
        let seed = u64::try_from(document.seed)
            .map_err(|_| self.error("seed", &document.seed, "a whole number from 0"))?;
        let mut robots = BTreeMap::new();
        let mut listed = BTreeMap::new();
        for id in 1..=document.team_size {
            robots.insert(RobotId(id), self.settings(&document.defaults, None)?);
        }
        for (index, table) in document.robots.iter().enumerate() {
            let path = format!("robots[{index}]");
            let id = self.robot_id(table, &path)?;
            if listed.insert(id, path.clone()).is_some() {
                let expected = "every robot to be listed once".to_owned();
                return Err(self.error(&format!("{path}.id"), &format!("{id} again"), &expected));
            }
            let mut own = table.clone();
            own.remove("id");
            robots.insert(id, self.settings(&document.defaults, Some((&own, &path)))?);
        }
        let mut landmarks = BTreeMap::new();
        let mut landmark_kinds = BTreeMap::new();
        for (index, landmark) in document.landmarks.iter().enumerate() {
            let position = [landmark.x_m, landmark.y_m];
            landmark_kinds.insert(LandmarkId(landmark.id), landmark.kind);
            if landmarks.insert(LandmarkId(landmark.id), position).is_some() {
                let path = format!("landmarks[{index}].id");
                let found = format!("{} again", landmark.id);
                return Err(self.error(&path, &found, "every landmark to be listed once"));
            }
        }
        let scenario = Scenario {
            name: document.name,
            seed,
            duration_s: document.duration_s,
            arena: document.arena,
            truth_rate_hz: document.truth_rate_hz,
            truth_sigma_m: document.truth_sigma_m,
            truth_sigma_rad: document.truth_sigma_rad,
            walls_m: document.walls_m,
            landmarks,
            landmark_kinds,
            random_landmarks: document.random_landmarks,
            robots,
            faults,
        };
        scenario.check().map_err(|invalid| self.locate(invalid, &listed))?;
        Ok(scenario)
    }

    fn robot_id(&self, table: &Table, path: &str) -> Result<RobotId, Error> {
        let path = format!("{path}.id");
        let expected = "a whole number from 1";
        let Some(id) = table.get("id").and_then(Value::as_integer) else {
            return Err(self.error(&path, &"missing", expected));
        };
        match u32::try_from(id) {
            Ok(number) if number > 0 => Ok(RobotId(number)),
            _ => Err(self.error(&path, &id, expected)),
        }
    }

    /// The defaults with a robot's own keys over them; its effects come after those of the defaults.
    fn settings(&self, defaults: &Table, own: Option<(&Table, &str)>) -> Result<RobotSettings, Error> {
        let mut effects = self.effects(defaults, DEFAULTS)?;
        let mut table = defaults.clone();
        if let Some((own, path)) = own {
            effects.extend(self.effects(own, path)?);
            table = merge(defaults, own);
        }
        table.remove(EFFECTS);
        let path = own.map_or(DEFAULTS, |(_, path)| path);
        let mut settings: RobotSettings = table.try_into().map_err(|error| self.syntax(path, &error))?;
        settings.effects = effects;
        Ok(settings)
    }

    fn effects(&self, table: &Table, path: &str) -> Result<Vec<ActiveEffect<f64>>, Error> {
        let listed = table.get(EFFECTS).and_then(Value::as_array).into_iter().flatten();
        let effect = |(index, value): (usize, &Value)| {
            let path = format!("{path}.{EFFECTS}[{index}]");
            let spec: EffectSpec = value.clone().try_into().map_err(|error| self.syntax(&path, &error))?;
            let declared = spec.declared().map_err(|wrong| {
                let key = format!("{path}.{}", wrong.key);
                let place = keys::place(self.file, self.lines.find(&key));
                Error::Effect { place, key, found: wrong.found, expected: wrong.expected }
            })?;
            Ok(declared.active)
        };
        listed.enumerate().map(effect).collect()
    }

    fn syntax(&self, path: &str, error: &toml::de::Error) -> Error {
        Error::Syntax {
            place: keys::place(self.file, self.lines.find(path)),
            message: error.to_string().trim().replace('\n', " "),
        }
    }

    fn error(&self, path: &str, found: &impl ToString, expected: &str) -> Error {
        Error::Value {
            place: keys::place(self.file, self.lines.find(path)),
            key: path.to_owned(),
            found: found.to_string(),
            expected: expected.to_owned(),
        }
    }

    /// Gives an invalid value its line: where the robot's own table has the key, else the defaults.
    fn locate(&self, invalid: Invalid, listed: &BTreeMap<RobotId, String>) -> Error {
        let Invalid { robot, key, found, expected } = invalid;
        let own = robot.and_then(|robot| listed.get(&robot)).map(|table| format!("{table}.{key}"));
        let of_defaults = format!("defaults.{key}");
        let (line, shown) = match own {
            Some(path) if self.lines.exact(&path).is_some() => (self.lines.exact(&path), path),
            _ if robot.is_some() => match self.lines.exact(&of_defaults) {
                Some(line) => (Some(line), of_defaults),
                None => (None, key.clone()),
            },
            _ => (self.lines.find(&key), key.clone()),
        };
        Error::Value { place: keys::place(self.file, line), key: shown, found, expected }
    }
}

/// `over` on top of `base`, table by table; anything but a table replaces what was there.
fn merge(base: &Table, over: &Table) -> Table {
    let mut merged = base.clone();
    for (key, value) in over {
        let value = match (merged.get(key), value) {
            (Some(Value::Table(base)), Value::Table(over)) => Value::Table(merge(base, over)),
            _ => value.clone(),
        };
        merged.insert(key.clone(), value);
    }
    merged
}
