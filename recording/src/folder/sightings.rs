//! `relative.csv`: which cells say where a target was seen, in both directions.
//!
//! Without a column `relative_kind` every row fills every column, and which columns there are says what
//! was measured: `range,bearing` (format version 1), `range`, `bearing`, `x,y` or `x,y,yaw`. With the
//! column each row names its own kind and fills the cells of that kind.

use pleiad_estimation::sample::{Relative, Target};
use pleiad_estimation::{LandmarkId, Pose2, RobotId};

use crate::table::{Row, Table};

/// Columns after the required ones, in the order of the file.
pub(crate) const OPTIONAL: [&str; 6] = ["relative_kind", "range", "bearing", "x", "y", "yaw"];

const TARGET_KIND: usize = 1;
const TARGET_ID: usize = 2;
const RELATIVE_KIND: usize = 3;
const RANGE: usize = 4;
const BEARING: usize = 5;
const X: usize = 6;
const Y: usize = 7;
const YAW: usize = 8;

/// What a sighting measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    RangeBearing,
    Range,
    Bearing,
    Position,
    Pose,
}

impl Kind {
    const ALL: [Self; 5] = [Self::RangeBearing, Self::Range, Self::Bearing, Self::Position, Self::Pose];

    /// The kind of a measurement.
    pub(crate) fn of(relative: &Relative) -> Self {
        match relative {
            Relative::RangeBearing { .. } => Self::RangeBearing,
            Relative::Range { .. } => Self::Range,
            Relative::Bearing { .. } => Self::Bearing,
            Relative::Position { .. } => Self::Position,
            Relative::Pose(_) => Self::Pose,
        }
    }

    /// Its name in the column `relative_kind`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::RangeBearing => "range_bearing",
            Self::Range => "range",
            Self::Bearing => "bearing",
            Self::Position => "position",
            Self::Pose => "pose",
        }
    }

    /// The kind called `name`.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The columns that it fills.
    fn columns(self) -> &'static [usize] {
        match self {
            Self::RangeBearing => &[RANGE, BEARING],
            Self::Range => &[RANGE],
            Self::Bearing => &[BEARING],
            Self::Position => &[X, Y],
            Self::Pose => &[X, Y, YAW],
        }
    }
}

/// How a file tells the kind of each row.
pub(crate) enum Layout {
    /// All rows are of one kind.
    Uniform(Kind),
    /// Each row names its kind.
    PerRow,
}

/// The layout that a header asks for, or what was expected of it.
pub(crate) fn layout_of(table: &Table) -> Result<Layout, String> {
    if table.has(RELATIVE_KIND) {
        return Ok(Layout::PerRow);
    }
    let present: Vec<usize> = (RANGE..=YAW).filter(|&column| table.has(column)).collect();
    let kind = Kind::ALL.into_iter().find(|kind| kind.columns() == present);
    kind.map(Layout::Uniform).ok_or_else(|| {
        "the columns t,target_kind,target_id and then range,bearing or range or bearing or x,y or x,y,yaw, \
         or a column relative_kind that tells them apart"
            .to_owned()
    })
}

/// Who was seen in a row.
pub(crate) fn target(row: &Row<'_>) -> Result<Target, String> {
    match row.text(TARGET_KIND) {
        "robot" => Ok(Target::Robot(RobotId(row.identifier(TARGET_ID, Some('r'))?))),
        "landmark" => Ok(Target::Landmark(LandmarkId(row.identifier(TARGET_ID, Some('L'))?))),
        other => Err(format!("`robot` or `landmark` in column `target_kind`, not `{other}`")),
    }
}

/// Where it was seen.
pub(crate) fn relative(row: &Row<'_>, layout: &Layout) -> Result<Relative, String> {
    let kind = match layout {
        Layout::Uniform(kind) => *kind,
        Layout::PerRow => {
            let name = row.text(RELATIVE_KIND);
            let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
                let names = Kind::ALL.map(Kind::name).join(", ");
                format!("one of {names} in column `relative_kind`, not `{name}`")
            })?;
            if (RANGE..=YAW).any(|column| row.is_filled(column) && !kind.columns().contains(&column)) {
                return Err(format!("only the cells of a sighting of kind `{name}` to be filled"));
            }
            kind
        }
    };
    Ok(match kind {
        Kind::RangeBearing => {
            Relative::RangeBearing { range_m: row.distance(RANGE)?, bearing_rad: row.number(BEARING)? }
        }
        Kind::Range => Relative::Range { range_m: row.distance(RANGE)? },
        Kind::Bearing => Relative::Bearing { bearing_rad: row.number(BEARING)? },
        Kind::Position => Relative::Position { x_m: row.number(X)?, y_m: row.number(Y)? },
        Kind::Pose => Relative::Pose(Pose2::new(row.number(X)?, row.number(Y)?, row.number(YAW)?)),
    })
}

/// The numbers of a measurement by optional column, `range` first; `None` where its kind has none.
pub(crate) fn cells(relative: &Relative) -> [Option<f64>; 5] {
    match *relative {
        Relative::RangeBearing { range_m, bearing_rad } => {
            [Some(range_m), Some(bearing_rad), None, None, None]
        }
        Relative::Range { range_m } => [Some(range_m), None, None, None, None],
        Relative::Bearing { bearing_rad } => [None, Some(bearing_rad), None, None, None],
        Relative::Position { x_m, y_m } => [None, None, Some(x_m), Some(y_m), None],
        Relative::Pose(pose) => [None, None, Some(pose.x_m()), Some(pose.y_m()), Some(pose.yaw_rad())],
    }
}
