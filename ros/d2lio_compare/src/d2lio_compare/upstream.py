# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Upstream FAST_LIO and LIO-SAM as variants: their launch and configuration, our namespace.

What is known of the recording takes the place of their sensor's settings; everything else stays as
the user's checkout has it, so also the `d2lio` block of a patched one.
"""

from __future__ import annotations

from typing import Any, Callable, Dict
from xml.etree import ElementTree

import numpy as np

# The node of each that gives the odometry.
NODES = {"fast_lio": "laserMapping", "lio_sam": "lio_sam_mapOptmization"}
# Names of FAST_LIO's topics, absolute, and ours.
FAST_LIO_TOPICS = {
    "/Odometry": "odometry",
    "/path": "path",
    "/cloud_registered": "cloud_registered",
    "/cloud_registered_body": "cloud_registered_body",
    "/cloud_effected": "cloud_effected",
    "/Laser_map": "Laser_map",
}
LIO_SAM_TOPICS = {
    "lio_sam/mapping/odometry": "odometry",
    "lio_sam/mapping/path": "path",
    "lio_sam/mapping/cloud_registered": "cloud_registered",
}
DIAGNOSTICS_TOPIC = "d2lio/diagnostics"
TIME_UNITS = {"s": 0, "ms": 1, "us": 2, "ns": 3}
VELODYNE, OUSTER, LIVOX = 2, 3, 1  # FAST_LIO's numbers

Description = Dict[str, Any]  # of a recording: sequence.yaml, or what `d2lio run --config` takes


def add(group: ElementTree.Element, package: str, lidar: str, imu: str, known: Description) -> None:
    """Puts an upstream package into a group.

    Args:
        lidar, imu: topics, empty for those of its configuration.
        known: description of the recording, empty for none.
    """
    _ADD[package](group, lidar, imu, known)


def _fast_lio(group: ElementTree.Element, lidar: str, imu: str, known: Description) -> None:
    _remap(group, FAST_LIO_TOPICS)
    launch = "$(find fast_lio)/launch/mapping_velodyne.launch"
    include = ElementTree.SubElement(group, "include", file=launch)
    ElementTree.SubElement(include, "arg", name="rviz", value="false")
    values: dict[str, Any] = {"common/lid_topic": lidar, "common/imu_topic": imu}
    values.update({"publish/path_en": True, "pcd_save/pcd_save_en": False})
    if known:
        sensor = known.get("lidar") or {}
        transform = _extrinsic(known)
        values.update(
            {
                "preprocess/lidar_type": _kind(sensor),
                "preprocess/scan_line": sensor.get("rings") or None,
                "preprocess/timestamp_unit": TIME_UNITS.get(str(sensor.get("time_unit"))),
                "preprocess/blind": sensor.get("min_range_m"),
                "mapping/extrinsic_T": transform[:3, 3].tolist(),
                "mapping/extrinsic_R": transform[:3, :3].ravel().tolist(),
            }
        )
    _settings(group, values)


def _lio_sam(group: ElementTree.Element, lidar: str, imu: str, known: Description) -> None:
    """Without its own RViz; extrinsicTrans and -Rot are of the IMU in the LiDAR's frame."""
    _remap(group, LIO_SAM_TOPICS)
    file = "$(find lio_sam)/config/params.yaml"
    ElementTree.SubElement(group, "rosparam", file=file, command="load")
    values: dict[str, Any] = {"lio_sam/pointCloudTopic": lidar, "lio_sam/imuTopic": imu}
    if known:
        sensor = known.get("lidar") or {}
        inverse = np.linalg.inv(_extrinsic(known))
        rotation = inverse[:3, :3].ravel().tolist()
        values.update(
            {
                "lio_sam/sensor": {LIVOX: "livox", OUSTER: "ouster"}.get(_kind(sensor), "velodyne"),
                "lio_sam/N_SCAN": sensor.get("rings") or None,
                "lio_sam/lidarMinRange": sensor.get("min_range_m"),
                "lio_sam/lidarMaxRange": sensor.get("max_range_m"),
                "lio_sam/extrinsicTrans": inverse[:3, 3].tolist(),
                "lio_sam/extrinsicRot": rotation,
                "lio_sam/extrinsicRPY": rotation,
            }
        )
    _settings(group, values)
    launch = "$(find lio_sam)/launch/include/module_loam.launch"
    ElementTree.SubElement(group, "include", file=launch)


_ADD: dict[str, Callable[..., None]] = {"fast_lio": _fast_lio, "lio_sam": _lio_sam}


def _kind(sensor: Description) -> int:
    model = str(sensor.get("model", "")).lower()
    if "livox" in model or "avia" in model:
        return LIVOX
    return OUSTER if model.startswith("os") else VELODYNE


def _extrinsic(known: Description) -> np.ndarray:
    """T_imu_lidar [4, 4], identity where nothing is said."""
    return np.array(known.get("T_imu_lidar") or np.eye(4), np.float64)


def _remap(group: ElementTree.Element, topics: dict[str, str]) -> None:
    for theirs, ours in topics.items():
        ElementTree.SubElement(group, "remap", {"from": theirs, "to": ours})


def _settings(group: ElementTree.Element, values: dict[str, Any]) -> None:
    """Parameters of the group's namespace; the last one of a name counts."""
    # A patched one tells its eigenvalues, whatever its mode; an unpatched one reads no such thing.
    values["d2lio/diagnostics/topic"] = DIAGNOSTICS_TOPIC
    for name, value in values.items():
        if value is None or value == "":
            continue
        element = ElementTree.SubElement(group, "rosparam", param=name)
        element.text = str(value).lower() if isinstance(value, bool) else str(value)
