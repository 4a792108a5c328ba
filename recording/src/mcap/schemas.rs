//! Schemas of the topics as JSON Schema. Viewers know those of Foxglove by their names; the fields are those of
//! <https://docs.foxglove.dev/docs/sdk/schemas>, as far as they are written here.

use serde_json::{Value, json};

use crate::folder::{self, RELATIVE};

/// How the schemas are written.
pub(super) const ENCODING: &str = "jsonschema";

fn object(title: &str, properties: &Value) -> Value {
    json!({ "title": title, "type": "object", "properties": properties })
}

fn list(of: &Value) -> Value {
    json!({ "type": "array", "items": of })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn instant(title: &str) -> Value {
    object(title, &json!({ "sec": { "type": "integer" }, "nsec": { "type": "integer" } }))
}

/// A named tuple of numbers.
fn numbers(title: &str, names: &[&str]) -> Value {
    let properties = names.iter().map(|name| ((*name).to_owned(), number())).collect();
    object(title, &Value::Object(properties))
}

fn vector(title: &str) -> Value {
    numbers(title, &["x", "y", "z"])
}

fn pose() -> Value {
    object(
        "foxglove.Pose",
        &json!({
            "position": vector("foxglove.Vector3"),
            "orientation": numbers("foxglove.Quaternion", &["x", "y", "z", "w"]),
        }),
    )
}

/// `foxglove.PoseInFrame`.
pub(super) fn pose_in_frame() -> Value {
    object(
        "foxglove.PoseInFrame",
        &json!({ "timestamp": instant("time"), "frame_id": text(), "pose": pose() }),
    )
}

/// `foxglove.FrameTransform`.
pub(super) fn frame_transform() -> Value {
    object(
        "foxglove.FrameTransform",
        &json!({
            "timestamp": instant("time"),
            "parent_frame_id": text(),
            "child_frame_id": text(),
            "translation": vector("foxglove.Vector3"),
            "rotation": numbers("foxglove.Quaternion", &["x", "y", "z", "w"]),
        }),
    )
}

/// `foxglove.SceneUpdate`, with lines and texts.
pub(super) fn scene_update() -> Value {
    let color = numbers("foxglove.Color", &["r", "g", "b", "a"]);
    let line = object(
        "foxglove.LinePrimitive",
        &json!({
            "type": { "type": "integer" },
            "pose": pose(),
            "thickness": number(),
            "scale_invariant": { "type": "boolean" },
            "points": list(&vector("foxglove.Point3")),
            "color": color,
            "colors": list(&color),
            "indices": list(&json!({ "type": "integer" })),
        }),
    );
    let label = object(
        "foxglove.TextPrimitive",
        &json!({
            "pose": pose(),
            "billboard": { "type": "boolean" },
            "font_size": number(),
            "scale_invariant": { "type": "boolean" },
            "color": color,
            "text": text(),
        }),
    );
    // Primitives that are never written stand as lists of anything: viewers expect every list.
    let none = list(&json!({ "type": "object" }));
    let entity = object(
        "foxglove.SceneEntity",
        &json!({
            "timestamp": instant("time"),
            "frame_id": text(),
            "id": text(),
            "lifetime": instant("duration"),
            "frame_locked": { "type": "boolean" },
            "metadata": none,
            "arrows": none,
            "cubes": none,
            "spheres": none,
            "cylinders": none,
            "lines": list(&line),
            "triangles": none,
            "texts": list(&label),
            "models": none,
        }),
    );
    let deletion = object(
        "foxglove.SceneEntityDeletion",
        &json!({ "timestamp": instant("time"), "type": { "type": "integer" }, "id": text() }),
    );
    object("foxglove.SceneUpdate", &json!({ "deletions": list(&deletion), "entities": list(&entity) }))
}

/// `foxglove.Log`.
pub(super) fn log() -> Value {
    object(
        "foxglove.Log",
        &json!({
            "timestamp": instant("time"),
            "level": { "type": "integer" },
            "message": text(),
            "name": text(),
            "file": text(),
            "line": { "type": "integer" },
        }),
    )
}

/// Of a channel of the recording: its stamp and its columns.
pub(super) fn channel(channel: folder::Channel) -> Value {
    let mut properties = serde_json::Map::new();
    properties.insert("t".to_owned(), instant("time"));
    if channel == RELATIVE {
        for name in ["target_kind", "relative_kind"] {
            properties.insert(name.to_owned(), text());
        }
        properties.insert("target_id".to_owned(), json!({ "type": "integer" }));
        for name in ["range", "bearing", "x", "y", "yaw"] {
            properties.insert(name.to_owned(), number());
        }
    } else {
        for name in channel.columns.iter().skip(1) {
            properties.insert((*name).to_owned(), number());
        }
    }
    object(&format!("{}{}", super::read::SCHEMA_PREFIX, channel.name), &Value::Object(properties))
}

/// Of landmarks and walls.
pub(super) fn map() -> Value {
    let mut landmark = numbers("landmark", &["x", "y"]);
    landmark["properties"]["id"] = json!({ "type": "integer" });
    object(
        &format!("{}map", super::read::SCHEMA_PREFIX),
        &json!({ "landmarks": list(&landmark), "walls": list(&numbers("wall", &["x0", "y0", "x1", "y1"])) }),
    )
}
