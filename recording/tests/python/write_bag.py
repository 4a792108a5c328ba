"""Writes a ROS 2 bag with rosbags, and as JSON what is in it.

    write_bag.py FOLDER none|storage
"""

import json
import math
import random
import sys

import numpy
import pymap3d
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

folder, compression = sys.argv[1:3]
store = get_typestore(Stores.ROS2_JAZZY)
types = store.types
chance = random.Random(7)
ORIGIN = (48.2, 11.6, 520.0)
expected = {"velocity": [], "truth": [], "gyro": [], "heading": [], "gps": [], "wheel_odometry": [], "command": []}


def header(nanos, frame):
    stamp = types["builtin_interfaces/msg/Time"](sec=nanos // 10**9, nanosec=nanos % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def vector(x, y, z):
    return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)


def turned(yaw):
    return types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))


def twist(v, w):
    return types["geometry_msgs/msg/Twist"](linear=vector(v, 0.0, 0.0), angular=vector(0.0, 0.0, w))


bag = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
if compression == "storage":
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
with bag:
    names = {
        "/odom": "nav_msgs/msg/Odometry",
        "/cmd_vel": "geometry_msgs/msg/TwistStamped",
        "/imu": "sensor_msgs/msg/Imu",
        "/fix": "sensor_msgs/msg/NavSatFix",
        "/joints": "sensor_msgs/msg/JointState",
        "/tf": "tf2_msgs/msg/TFMessage",
    }
    topics = {topic: bag.add_connection(topic, name, typestore=store) for topic, name in names.items()}

    def put(topic, message):
        bag.write(topics[topic], log, store.serialize_cdr(message, names[topic]))

    for step in range(200):
        nanos = 1_700_000_000_123_456_789 + step * 20_000_001
        log = nanos + 5_000_000
        v, w, yaw = (chance.uniform(-3.0, 3.0) for _ in range(3))
        x, y = chance.gauss(0.0, 30.0), chance.gauss(0.0, 30.0)
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=x, y=y, z=0.1), orientation=turned(yaw)
        )
        put("/odom", types["nav_msgs/msg/Odometry"](
            header=header(nanos, "odom"),
            child_frame_id="base_link" + "x" * (step % 9),
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=numpy.arange(36.0)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist(v, w), covariance=numpy.arange(36.0)),
        ))
        expected["velocity"].append([nanos, v, w])
        put("/cmd_vel", types["geometry_msgs/msg/TwistStamped"](header=header(nanos, ""), twist=twist(w, v)))
        expected["command"].append([nanos, w, v])
        put("/imu", types["sensor_msgs/msg/Imu"](
            header=header(nanos, "imu"),
            orientation=turned(yaw),
            orientation_covariance=numpy.zeros(9),
            angular_velocity=vector(1.0, 2.0, w),
            angular_velocity_covariance=numpy.zeros(9),
            linear_acceleration=vector(0.0, 0.0, 9.81),
            linear_acceleration_covariance=numpy.zeros(9),
        ))
        expected["gyro"].append([nanos, w])
        expected["heading"].append([nanos, yaw])
        latitude, longitude = ORIGIN[0] + 0.02 * math.sin(step), ORIGIN[1] + 0.03 * math.cos(step)
        altitude = ORIGIN[2] + step
        put("/fix", types["sensor_msgs/msg/NavSatFix"](
            header=header(nanos, "gps"),
            status=types["sensor_msgs/msg/NavSatStatus"](status=step % 3, service=1),
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            position_covariance=numpy.zeros(9),
            position_covariance_type=0,
        ))
        east, north, _ = pymap3d.geodetic2enu(latitude, longitude, altitude, *ORIGIN)
        expected["gps"].append([nanos, float(east), float(north)])
        left, right = chance.uniform(-100.0, 100.0), chance.uniform(-100.0, 100.0)
        put("/joints", types["sensor_msgs/msg/JointState"](
            header=header(nanos, ""),
            name=["arm", "wheel_right_joint", "wheel_left_joint"],
            position=numpy.array([0.5, right, left]),
            velocity=numpy.array([]),
            effort=numpy.array([]),
        ))
        expected["wheel_odometry"].append([nanos, left, right])

        def transform(frame, child, x, y, yaw):
            return types["geometry_msgs/msg/TransformStamped"](
                header=header(nanos, frame),
                child_frame_id=child,
                transform=types["geometry_msgs/msg/Transform"](translation=vector(x, y, 0.0), rotation=turned(yaw)),
            )

        placed = [transform("odom", "base", 1.0, 2.0, 3.0), transform("map", "mocap/robot", x, y, yaw)]
        put("/tf", types["tf2_msgs/msg/TFMessage"](transforms=placed))
        expected["truth"].append([nanos, x, y, yaw])
print(json.dumps(expected))
