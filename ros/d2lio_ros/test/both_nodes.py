#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""rostest: what both nodes publish is what `d2lio run` wrote, scan by scan."""

import threading
import time
import unittest

import rosbag
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry

TOLERANCE = 1e-9
LIMIT_S = 60.0
NODES = ("fastlio", "liosam")


class Listener:
    """Everything that a node says."""

    def __init__(self, node):
        self.lock = threading.Lock()
        self.poses = []
        self.scans = []
        rospy.Subscriber(f"/{node}/odometry", Odometry, self.on_pose, queue_size=None)
        rospy.Subscriber(f"/{node}/diagnostics", DiagnosticArray, self.on_status, queue_size=None)

    def on_pose(self, message):
        """Keeps stamp, position and quaternion."""
        p, q = message.pose.pose.position, message.pose.pose.orientation
        with self.lock:
            self.poses.append((message.header.stamp.to_nsec(), p.x, p.y, p.z, q.x, q.y, q.z, q.w))

    def on_status(self, message):
        """Keeps the statuses of scans."""
        with self.lock:
            self.scans += [s for s in message.status if s.name.endswith(": scan")]

    def count(self):
        """Scans answered so far."""
        with self.lock:
            return len(self.scans)


def read_tum(path):
    """Rows of a TUM file; stamps in ns."""
    rows = []
    with open(path, encoding="utf-8") as file:
        for line in file:
            stamp, *values = line.split()
            rows.append((int(stamp.replace(".", "")), *(float(v) for v in values)))
    return rows


class BothNodes(unittest.TestCase):
    """One bag, two nodes."""

    @classmethod
    def setUpClass(cls):
        """Listens until both nodes have answered every scan."""
        listeners = {node: Listener(node) for node in NODES}
        with rosbag.Bag(rospy.get_param("~bag")) as bag:
            cls.scans = bag.get_message_count("/lidar/points")
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end and any(
            listener.count() < cls.scans for listener in listeners.values()
        ):
            time.sleep(0.2)
        cls.listeners = listeners

    def check(self, node):
        """Every scan answered, none dropped, every pose as expected."""
        listener = self.listeners[node]
        assert listener.count() == self.scans
        values = {v.key: v.value for v in listener.scans[-1].values}
        assert values["dropped"] == "0"
        expected = read_tum(rospy.get_param("~" + node))
        assert [p[0] for p in listener.poses] == [row[0] for row in expected]
        for pose, row in zip(listener.poses, expected):
            sign = 1.0 if pose[7] * row[7] >= 0.0 else -1.0
            found = pose[1:4] + tuple(sign * v for v in pose[4:])
            for a, b in zip(found, row[1:]):
                assert abs(a - b) <= TOLERANCE, (pose[0], a, b)

    def test_fastlio(self):
        """FAST-LIO2's node."""
        self.check("fastlio")

    def test_liosam(self):
        """LIO-SAM's node."""
        self.check("liosam")


if __name__ == "__main__":
    rospy.init_node("both_nodes")
    rostest.rosrun("d2lio_ros", "both_nodes", BothNodes)
