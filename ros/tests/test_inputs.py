# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Every kind of LiDAR message: the node reads it as `d2lio run` does, to the same trajectory."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import fault_bags
import numpy as np
import packets
import pytest
import yaml
from conftest import IMU_TOPIC, LIDAR_TOPIC
from d2lio.datasets import open_source
from d2lio.runner import RunOptions, run
from rosbags.rosbag1 import Writer
from rosbags.typesys import get_types_from_msg

NS = fault_bags.NS
POINT_TYPE, LIVOX_TYPE = "livox_ros_driver/msg/CustomPoint", "livox_ros_driver/msg/CustomMsg"
MESSAGES = Path(__file__).resolve().parents[1] / "livox_ros_driver" / "msg"


def cloud_points(cloud) -> np.ndarray:
    from d2lio.simulator.bag import POINT

    return np.frombuffer(np.array(cloud.data).tobytes(), POINT)


def livox(simulated) -> Iterator[fault_bags.Message]:
    store = fault_bags.STORE
    point_text = (MESSAGES / "CustomPoint.msg").read_text()
    message_text = (MESSAGES / "CustomMsg.msg").read_text()
    message_text = message_text.replace("Header header", "std_msgs/Header header")
    store.register(
        get_types_from_msg(point_text, POINT_TYPE) | get_types_from_msg(message_text, LIVOX_TYPE)
    )
    point, message = store.types[POINT_TYPE], store.types[LIVOX_TYPE]
    for kind, stamp, m in simulated.messages:
        if kind != fault_bags.CLOUD:
            yield kind, stamp, m
            continue
        points = [
            point(round(float(p["time"]) * NS), p["x"], p["y"], p["z"], 100, 16, int(p["ring"]))
            for p in cloud_points(m)[::4]
        ]
        head = m.header
        base = head.stamp.sec * NS + head.stamp.nanosec
        yield LIVOX_TYPE, stamp, message(head, base, len(points), 0, np.zeros(3, np.uint8), points)


OUSTER = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "t", "reflectivity", "ring", "range"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", "<u2", "u1", "<u4"],
        "offsets": [0, 4, 8, 16, 20, 24, 26, 28],
        "itemsize": 48,
    }
)
OUSTER_TYPES = (7, 7, 7, 7, 6, 4, 2, 6)


def ouster(simulated) -> Iterator[fault_bags.Message]:
    field = fault_bags.STORE.types["sensor_msgs/msg/PointField"]
    for kind, stamp, m in simulated.messages:
        if kind == fault_bags.CLOUD:
            points = cloud_points(m)
            points = points[: len(points) // 16 * 16]
            out = np.zeros(len(points), OUSTER)
            for name in ("x", "y", "z", "intensity", "ring"):
                out[name] = points[name]
            out["t"] = np.round(points["time"].astype(float) * NS)
            m = type(m)(
                header=m.header,
                height=16,
                width=len(out) // 16,
                fields=[
                    field(name=n, offset=OUSTER.fields[n][1], datatype=t, count=1)
                    for n, t in zip(OUSTER.names, OUSTER_TYPES, strict=True)
                ],
                is_bigendian=False,
                point_step=48,
                row_step=48 * (len(out) // 16),
                data=out.view(np.uint8),
                is_dense=True,
            )
        yield kind, stamp, m


def box_sweep(number: int) -> packets.Sweep:
    """What a VLP-16 sees that stands still in a room of 16 m x 10 m x 4 m."""
    shape = (76, 12, 32)
    unit = packets.Sweep(packets.VLP16, np.ones(shape), np.full(shape, 50), 90.0)
    away = unit.xyz()
    walls = np.where(away > 0, np.array([9.0, 4.5, 2.5]), np.array([7.0, 5.5, 1.5]))
    ranges = (walls / np.maximum(np.abs(away), 1e-9)).min(axis=-1)
    noise = np.random.default_rng(number).normal(0.0, 0.01, shape)
    ranges = 0.002 * np.round((ranges + noise) / 0.002)
    return packets.Sweep(packets.VLP16, ranges, unit.reflectivity, 90.0)


def velodyne(simulated) -> Iterator[fault_bags.Message]:
    store = packets.register(fault_bags.STORE)
    imu = next(m for kind, _, m in simulated.messages if kind == fault_bags.IMU)
    begin, events = 1_700_000_000 * NS, []
    for i in range(620):
        stamp = begin + i * 5_000_000
        time_type = store.types["builtin_interfaces/msg/Time"]
        head = type(imu.header)(i, time_type(stamp // NS, stamp % NS), "imu")
        vector = type(imu.angular_velocity)
        sample = type(imu)(
            head, imu.orientation, imu.orientation_covariance, vector(0.0, 0.0, 0.0),
            imu.angular_velocity_covariance, vector(0.0, 0.0, 9.81),
            imu.linear_acceleration_covariance,
        )  # fmt: skip
        events.append((fault_bags.IMU, stamp, sample))
    for i in range(29):
        stamp = begin + i * 101_000_000
        data = packets.encode_packets(packets.VLP16, box_sweep(i), stamp)
        message = packets.scan_message(store, stamp, data)
        events.append((packets.SCAN_TYPE, stamp + 101_000_000, message))
    yield from sorted(events, key=lambda event: event[1])


KINDS = {
    "livox": (livox, LIVOX_TYPE, {"model": "avia", "rings": 16}),
    "ouster": (ouster, fault_bags.CLOUD, {"model": "os1_64", "rings": 16}),
    "velodyne_packets": (velodyne, packets.SCAN_TYPE, {"model": "vlp16", "rings": 16}),
}


@pytest.mark.parametrize("kind", list(KINDS))
def test_node_reads_the_messages_as_the_offline_run(kind, ros, simulated, assert_same, tmp_path):
    make, message_type, lidar = KINDS[kind]
    bag = tmp_path / "data.bag"
    with Writer(bag) as writer:
        store = fault_bags.STORE
        messages = make(simulated)
        first = next(messages)  # registers the types
        topics = {message_type: LIDAR_TOPIC, fault_bags.IMU: IMU_TOPIC}
        places = {k: writer.add_connection(t, k, typestore=store) for k, t in topics.items()}
        for name, stamp, message in (first, *messages):
            writer.write(places[name], stamp, store.serialize_ros1(message, name))
    sequence = yaml.safe_load(simulated.config.read_text())
    config = tmp_path / "config.yaml"
    extrinsic = sequence["T_imu_lidar"] if kind != "velodyne_packets" else np.eye(4).tolist()
    config.write_text(
        yaml.safe_dump(
            {
                "T_imu_lidar": extrinsic,
                "lidar": lidar | {"topic": LIDAR_TOPIC},
                "imu": {"topic": IMU_TOPIC},
                "host": {"filter_size_surf": 0.4},
            }
        )
    )
    expected = tmp_path / "offline"
    run(open_source(bag, config), RunOptions(), expected)
    node = ros.node(
        "d2lio_fastlio",
        kind,
        sequence_config=config,
        lidar_type=kind if kind != "ouster" else "pointcloud2",
        save_dir=tmp_path / "node",
        queue_scans=0,
    )
    ros.play(bag, 3.0)
    time.sleep(1.0)
    assert ros.end(node) == 0
    assert_same(tmp_path / "node", expected)
    assert len(np.loadtxt(expected / "trajectory.tum")) > 20
