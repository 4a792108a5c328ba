"""Writes golden.txt: for every message type its hash, and one message in both byte orders, by rosbags.

    "$(.ci/python-venv)" ros/tests/data/make_golden.py > ros/tests/data/golden.txt

Numbers count upwards from 1 in the order of the fields (floating-point ones with a half added), texts are "s" and the
next number, sequences have two elements.
"""

import sys

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

TYPES = """
builtin_interfaces/msg/Time std_msgs/msg/Header geometry_msgs/msg/Point geometry_msgs/msg/Vector3
geometry_msgs/msg/Quaternion geometry_msgs/msg/Pose geometry_msgs/msg/PoseStamped
geometry_msgs/msg/PoseWithCovariance geometry_msgs/msg/PoseWithCovarianceStamped geometry_msgs/msg/Twist
geometry_msgs/msg/TwistStamped geometry_msgs/msg/TwistWithCovariance
geometry_msgs/msg/TwistWithCovarianceStamped geometry_msgs/msg/Transform geometry_msgs/msg/TransformStamped
nav_msgs/msg/Odometry sensor_msgs/msg/Imu sensor_msgs/msg/NavSatStatus sensor_msgs/msg/NavSatFix
sensor_msgs/msg/JointState tf2_msgs/msg/TFMessage
""".split()

store = get_typestore(Stores.ROS2_JAZZY)


class Counter:
    def __init__(self):
        self.value = 0

    def next(self):
        self.value += 1
        return self.value


def primitive(name, counter):
    number = counter.next()
    if name == "string":
        return f"s{number}"
    return number + 0.5 if name.startswith("float") else number


def value(description, counter):
    kind, detail = description
    if kind == Nodetype.BASE:
        return primitive(detail[0], counter)
    if kind == Nodetype.NAME:
        return message(detail, counter)
    inner, count = detail
    elements = [value(inner, counter) for _ in range(count or 2)]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return numpy.array(elements, dtype=inner[1][0])
    return elements


def message(name, counter):
    fields = store.fielddefs[name][1]
    return store.types[name](**{field: value(description, counter) for field, description in fields})


for name in TYPES:
    built = message(name, Counter())
    both = [bytes(store.serialize_cdr(built, name, little_endian=little)).hex() for little in (True, False)]
    sys.stdout.write(" ".join([name, store.hash_rihs01(name), *both]) + "\n")
