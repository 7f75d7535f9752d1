# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node that scores the variants while they run.

Subscribes `/ID/odometry` and `/ID/diagnostics` of each variant and the truth; prints and publishes
one table, and keeps OUT/scoreboard.json up to date. A variant whose process is gone is DEAD.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from typing import Any

import numpy as np
import rospy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry, Path
from roslib.message import get_message_class
from std_msgs.msg import Float64, String
from visualization_msgs.msg import Marker, MarkerArray

from d2lio_compare.feed import Feed
from d2lio_compare.launch_file import NODES, node_of
from d2lio_compare.liveness import Liveness
from d2lio_compare.poses import (
    NO_TRUTH,
    NS_PER_S,
    Truth,
    matrix,
    quaternion_of,
    read_tum,
    start_in_map,
    tum_line,
)
from d2lio_compare.rviz_file import LABELS_TOPIC, MARKERS_TOPIC, TRUTH_TOPIC
from d2lio_compare.shared.board import HEADERS, Line, cells, plain
from d2lio_compare.shared.names import Variant, rgb
from d2lio_compare.upstream import DIAGNOSTICS_TOPIC

TICK_S = 0.5
QUIET_S = 2.0  # a bag that is done is drained when no variant said anything for so long
STATE_FILE = "scoreboard.json"
TRUTH_FILE = "truth.tum"  # of a topic, as heard
PATH_POSES = 2000
LABEL_M = 0.8
LEVELS = {"DEGENERATE": DiagnosticStatus.WARN, "LOST": DiagnosticStatus.ERROR}


class Scoreboard:
    """The node."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._out = rospy.get_param("~out", "")
        self._period_s = max(1.0, float(rospy.get_param("~print_period", 2.0)))
        variants = [Variant(**entry) for entry in rospy.get_param("~variants")]
        self._truth = self._read_truth()
        extrinsic = self._extrinsic()
        self._feeds = []
        for variant in variants:
            folder = os.path.join(self._out, NODES, variant.id) if variant.upstream else ""
            lidar = extrinsic if variant.upstream == "lio_sam" else None
            self._feeds.append(Feed(variant, self._truth, folder, lidar))
        self._liveness = Liveness([node_of(variant) for variant in variants])
        self._truth_rows: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._truth_shown = False
        self._printed, self._text = 0.0, ""
        self._drained = False
        self._advertise()
        self._subscribe()
        if any(variant.upstream == "fast_lio" for variant in variants):
            self._frames = _same_frame("map", "camera_init")

    def _read_truth(self) -> Truth:
        file = rospy.get_param("~truth_file", "")
        if not file:
            return NO_TRUTH
        try:
            return read_tum(file)
        except (OSError, ValueError) as err:
            rospy.logerr("ground truth: %s; no APE will be shown", err)
            return NO_TRUTH

    def _extrinsic(self) -> Any:
        """T_imu_lidar of the data description; identity where there is none."""
        try:
            with open(rospy.get_param("~config", ""), encoding="utf-8") as stream:
                return np.array(yaml.safe_load(stream)["T_imu_lidar"], np.float64)
        except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError):
            return np.eye(4)

    def _advertise(self) -> None:
        self._table = rospy.Publisher("~table", String, queue_size=1, latch=True)
        self._scores = rospy.Publisher("~scores", DiagnosticArray, queue_size=1)
        self._labels = rospy.Publisher(LABELS_TOPIC, MarkerArray, queue_size=1)
        self._path = rospy.Publisher(TRUTH_TOPIC, Path, queue_size=1, latch=True)
        self._apes = {
            f.variant.id: rospy.Publisher(f"/{f.variant.id}/ape", Float64, queue_size=1)
            for f in self._feeds
        }

    def _subscribe(self) -> None:
        for feed in self._feeds:
            ns = f"/{feed.variant.id}"
            rospy.Subscriber(f"{ns}/odometry", Odometry, self._on_odometry, feed, tcp_nodelay=True)
            topic = f"{ns}/{DIAGNOSTICS_TOPIC}" if feed.variant.upstream else f"{ns}/diagnostics"
            rospy.Subscriber(topic, DiagnosticArray, self._on_diagnostics, feed)
            coloured = rospy.Publisher(f"{ns}/{MARKERS_TOPIC}", MarkerArray, queue_size=2)
            passed = (feed.variant, coloured)
            rospy.Subscriber(f"{ns}/markers", MarkerArray, _on_markers, passed, queue_size=2)
        topic = rospy.get_param("~truth_topic", "")
        if topic:
            rospy.Subscriber(topic, rospy.AnyMsg, self._on_truth)

    def _on_odometry(self, message: Odometry, feed: Feed) -> None:
        stamp, position, quaternion = _pose(message.header, message.pose.pose)
        with self._lock:
            feed.add_pose(stamp, position, quaternion)

    def _on_diagnostics(self, message: DiagnosticArray, feed: Feed) -> None:
        stamp = message.header.stamp.to_nsec()
        with self._lock:
            for status in message.status:
                row = {pair.key: pair.value for pair in status.values}
                feed.add_status(stamp, status.level, row)

    def _on_truth(self, message: Any) -> None:
        kind = get_message_class(message._connection_header["type"])
        decoded = kind().deserialize(message._buff)
        pose = decoded.pose
        while hasattr(pose, "pose"):  # with covariance
            pose = pose.pose
        row = _pose(decoded.header, pose)
        with self._lock:
            if not self._truth_rows or row[0] > self._truth_rows[-1][0]:
                self._truth_rows.append(row)

    def run(self) -> None:
        """Until the node is told to end."""
        while not rospy.is_shutdown():
            time.sleep(TICK_S)  # not of ROS: a bag's clock stands still when the bag is done
            if not rospy.is_shutdown():
                self._tick()
        with self._lock:
            for feed in self._feeds:
                feed.close()

    def _tick(self) -> None:
        if not rospy.get_param("~stopping", False):
            self._mark(self._liveness.dead())
        with self._lock:
            self._take_truth()
            quiet = all(feed.quiet(QUIET_S) for feed in self._feeds)
        finished = not self._drained and quiet and rospy.get_param("~bag_done", False)
        if finished:
            self._mark(self._liveness.dead(at_once=True))  # one may have died just now
        self._tell()
        if finished:
            self._drained = True
            rospy.set_param("~drained", True)

    def _mark(self, dead: set[str]) -> None:
        """Notes which variants are gone."""
        with self._lock:
            for feed in self._feeds:
                if node_of(feed.variant) in dead and not feed.dead:
                    rospy.logerr("%s is DEAD; the others go on", feed.variant.title)
                    feed.dead = True

    def _tell(self) -> None:
        with self._lock:
            lines = [feed.line() for feed in self._feeds]
            poses = [feed.pose for feed in self._feeds]
        self._publish(lines, poses)
        self._print(lines)
        self._save(lines)

    def _take_truth(self) -> None:
        """Hands on what came by topic, and shows the truth once a variant has begun."""
        if len(self._truth_rows) > len(self._truth.stamps):
            stamps, positions, quaternions = zip(*self._truth_rows)
            self._truth = Truth(
                np.array(stamps, np.int64), np.array(positions), np.array(quaternions)
            )
            for feed in self._feeds:
                feed.ape.set_truth(self._truth.stamps, self._truth.positions)
            self._truth_shown = False
            self._save_truth()
        begun = next((feed.first_pose for feed in self._feeds if feed.first_pose), None)
        if begun is not None and not self._truth_shown and len(self._truth.stamps):
            motion = start_in_map(self._truth, *begun)
            if motion is not None:
                self._path.publish(_path_of(self._truth, *motion))
            self._truth_shown = True

    def _save_truth(self) -> None:
        lines = [tum_line(*row) for row in self._truth_rows]
        _replace(os.path.join(self._out, TRUTH_FILE), "".join(lines))

    def _publish(self, lines: list[Line], poses: list[Any]) -> None:
        self._table.publish(plain(lines))
        message = DiagnosticArray()
        message.header.stamp = rospy.Time.now()
        labels = MarkerArray()
        for number, (feed, line, pose) in enumerate(zip(self._feeds, lines, poses)):
            message.status.append(_status(line))
            if line.ape is not None:
                self._apes[feed.variant.id].publish(line.ape)
            if pose is not None:
                labels.markers.append(_label(number, feed.variant, line, pose[1]))
        self._scores.publish(message)
        self._labels.publish(labels)

    def _print(self, lines: list[Line]) -> None:
        now, text = time.monotonic(), plain(lines)
        if now - self._printed < self._period_s or text == self._text:
            return
        self._printed, self._text = now, text
        sys.stdout.write(f"\n{text}\n")
        sys.stdout.flush()

    def _save(self, lines: list[Line]) -> None:
        if not self._out:
            return
        state = {
            "stamp": time.time(),
            "variants": {f.variant.id: x._asdict() for f, x in zip(self._feeds, lines)},
            "epochs": {f.variant.id: f.epochs for f in self._feeds},
        }
        _replace(os.path.join(self._out, STATE_FILE), json.dumps(state, indent=2) + "\n")


def _on_markers(message: MarkerArray, passed: tuple[Variant, rospy.Publisher]) -> None:
    """Hands a variant's markers on in its colour; texts are left to the labels."""
    variant, publisher = passed
    red, green, blue = (part / 255.0 for part in rgb(variant.colour))
    kept = MarkerArray()
    for marker in message.markers:
        if marker.type != Marker.TEXT_VIEW_FACING:
            marker.color.r, marker.color.g, marker.color.b = red, green, blue
            kept.markers.append(marker)
    publisher.publish(kept)


def _replace(file: str, text: str) -> None:
    partial = f"{file}.tmp"
    with open(partial, "w", encoding="utf-8") as stream:
        stream.write(text)
    os.replace(partial, file)


def _pose(header: Any, pose: Any) -> tuple[int, np.ndarray, np.ndarray]:
    p, q = pose.position, pose.orientation
    return header.stamp.to_nsec(), np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


def _path_of(truth: Truth, rotation: np.ndarray, translation: np.ndarray) -> Path:
    path = Path()
    path.header.frame_id = "map"
    step = max(1, len(truth.stamps) // PATH_POSES)
    for stamp, position, quaternion in zip(*(part[::step] for part in truth)):
        entry = PoseStamped()
        entry.header.frame_id = "map"
        entry.header.stamp = rospy.Time(int(stamp) // NS_PER_S, int(stamp) % NS_PER_S)
        x, y, z = rotation @ position + translation
        entry.pose.position.x, entry.pose.position.y, entry.pose.position.z = x, y, z
        if quaternion.any():
            qx, qy, qz, qw = quaternion_of(rotation @ matrix(quaternion))
            entry.pose.orientation.x, entry.pose.orientation.y = qx, qy
            entry.pose.orientation.z, entry.pose.orientation.w = qz, qw
        path.poses.append(entry)
    return path


def _status(line: Line) -> DiagnosticStatus:
    level = DiagnosticStatus.STALE if line.state == "DEAD" else LEVELS.get(line.state, 0)
    values = [KeyValue(name, text) for name, text in zip(HEADERS, cells(line))]
    return DiagnosticStatus(level, f"scoreboard: {line.title}", line.state, "", values)


def _label(number: int, variant: Variant, line: Line, position: np.ndarray) -> Marker:
    marker = Marker(type=Marker.TEXT_VIEW_FACING, action=Marker.ADD, ns="scoreboard", id=number)
    marker.header.frame_id = "map"
    marker.pose.position.x, marker.pose.position.y = position[0], position[1]
    marker.pose.position.z = position[2] + LABEL_M * (1 + number)
    marker.pose.orientation.w = 1.0
    marker.scale.z = LABEL_M
    marker.color.r, marker.color.g, marker.color.b = (part / 255.0 for part in rgb(variant.colour))
    marker.color.a = 1.0
    marker.text = line.title if line.ape is None else f"{line.title}  {line.ape:.3f} m"
    return marker


def _same_frame(ours: str, theirs: str) -> Any:
    """Publishes that FAST_LIO's map frame is ours: both begin where the sensor does."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        rospy.logwarn("no tf2_msgs: what is in %s is not drawn in %s", theirs, ours)
        return None
    publisher = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    transform = TransformStamped(child_frame_id=theirs)
    transform.header.frame_id = ours
    transform.transform.rotation.w = 1.0
    publisher.publish(TFMessage([transform]))
    return publisher


def main() -> None:
    """Entry point."""
    rospy.init_node("scoreboard")
    Scoreboard().run()
