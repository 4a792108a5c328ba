"""Reads a file that Pleiad wrote with the Python packages mcap and rosbags, and prints as JSON what it found.

Messages in Foxglove's schemas are held against Foxglove's own definitions of them, as foxglove-schemas-protobuf has them.

    read_run.py FILE
"""

import importlib
import json
import sys
import time

from google.protobuf import json_format
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore, get_types_from_msg


def official(title):
    """The definition of foxglove.NAME."""
    name = title.removeprefix("foxglove.")
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)


def check_schema(schema):
    """Every object of a schema that Foxglove names has the fields that Foxglove gives it."""
    if schema["type"] == "array":
        return check_schema(schema["items"])
    if schema["type"] != "object" or not schema.get("title", "").startswith("foxglove."):
        return 0
    fields = [field.name for field in official(schema["title"]).DESCRIPTOR.fields]
    assert sorted(fields) == sorted(schema["properties"]), (schema["title"], fields)
    return 1 + sum(check_schema(of) for of in schema["properties"].values())


def as_protobuf(value, key=""):
    """Instants and durations as the JSON form of protobuf has them."""
    if isinstance(value, list):
        return [as_protobuf(element) for element in value]
    if not isinstance(value, dict):
        return value
    if set(value) == {"sec", "nsec"}:
        if key == "lifetime":
            return f"{value['sec']}.{value['nsec']:09d}s"
        return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(value["sec"])) + f".{value['nsec']:09d}Z"
    return {name: as_protobuf(of, name) for name, of in value.items()}


# The message definitions in the file are all that is known of its types.
store = get_typestore(Stores.EMPTY)
found = {"foxglove": {}, "velocity": [], "odometry": [], "estimate": [], "counts": {}, "schemas": {}}
with open(sys.argv[1], "rb") as stream:
    reader = make_reader(stream, validate_crcs=True)
    summary = reader.get_summary()
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        found["counts"][channel.topic] = found["counts"].get(channel.topic, 0) + 1
        found["schemas"][channel.topic] = [schema.name, schema.encoding, channel.message_encoding]
        if channel.message_encoding == "json":
            value = json.loads(message.data)
            if schema.name.startswith("foxglove."):
                assert check_schema(json.loads(schema.data)) > 0
                # Refuses a field that the definition does not have, and a value of another type.
                json_format.ParseDict(as_protobuf(value), official(schema.name)())
                found["foxglove"][schema.name] = found["foxglove"].get(schema.name, 0) + 1
            stamp = value.get("t") or value.get("timestamp")
            if stamp:
                nanos = stamp["sec"] * 10**9 + stamp["nsec"]
                assert nanos == message.log_time, (channel.topic, nanos, message.log_time)
        if channel.topic == "/robot1/velocity":
            found["velocity"].append([nanos, value["v"].hex(), value["w"].hex()])
        if channel.topic == "/robot1/estimate":
            at = value["pose"]["position"]
            found["estimate"].append([nanos, at["x"].hex(), at["y"].hex()])
        if channel.message_encoding == "cdr":
            if schema.name not in store.types:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            value = store.deserialize_cdr(message.data, schema.name)
            stamp = value.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == message.log_time
            covariance = value.pose.covariance
            found["odometry"].append([
                value.header.frame_id,
                value.child_frame_id,
                value.pose.pose.position.x.hex(),
                value.pose.pose.position.y.hex(),
                [float(covariance[at]).hex() for at in (0, 1, 7, 5, 11, 35)],
            ])
    counted = {summary.channels[id].topic: count for id, count in summary.statistics.channel_message_counts.items()}
    assert counted == found["counts"], counted
    found["metadata"] = [[record.name, record.metadata] for record in reader.iter_metadata()]
    found["attachments"] = [[file.name, file.data.decode()] for file in reader.iter_attachments()]
print(json.dumps(found))
