# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Starts the variants, plays the bag, waits, ends everything, and has the results written.

It is no node of its own: it writes a launch file and an RViz layout for the variants wanted, runs
roslaunch on it, and plays the bag when all of them listen.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any

import rospkg
import yaml

from d2lio_compare import graph, launch_file, rviz_file
from d2lio_compare.launch_file import NODES, PLAYER, Setting, node_of
from d2lio_compare.shared.names import UPSTREAMS, Variant, VariantError, parse

EXIT_USAGE, EXIT_FAILED, EXIT_INTERRUPTED = 2, 4, 130
META_FILE = "compare.json"
LAUNCH_FILE, RVIZ_FILE = "variants.launch", "compare.rviz"
START_UP_S = 30.0
DRAIN_S = 1800.0
NODE_STOP_S = 10.0  # roslaunch grants us 15 in all; nodes write while they run
STOP_S = 20.0
TICK_S = 0.2
QUEUE = 2000  # messages a subscriber may be behind before the player drops some
PR_SET_PDEATHSIG = 1
SEQUENCE_FILE = "sequence.yaml"


class UsageError(Exception):
    """Arguments that cannot be used."""


def say(text: str) -> None:
    """A line for the user."""
    print(f"compare: {text}", flush=True)


def main(arguments: list[str]) -> int:
    """Exit code: 0, 2 bad arguments, 4 no variant gave a trajectory, 130 interrupted."""
    try:
        return Comparison(_arguments(arguments)).run()
    except (UsageError, VariantError) as err:
        print(f"compare: error: {err}", file=sys.stderr, flush=True)
        return EXIT_USAGE


def _arguments(arguments: list[str]) -> argparse.Namespace:
    own = [text for text in arguments if ":=" not in text]  # roslaunch adds remappings
    parser = argparse.ArgumentParser(prog="compare.py", description=__doc__)
    texts = ("bag", "out", "config", "truth", "truth-topic", "lidar-topic", "imu-topic")
    for name in texts:
        parser.add_argument(f"--{name}", default="")
    parser.add_argument("--variants", default="")
    parser.add_argument("--host", default="fastlio")
    parser.add_argument("--lidar-type", default="auto")
    parser.add_argument("--rate", type=float, default=1.0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--queue-scans", type=int, default=0)
    parser.add_argument("--rviz", type=_switch, default=True)
    parser.add_argument("--hold", type=_switch, default=False)
    return parser.parse_args(own)


def _switch(text: str) -> bool:
    if text.lower() not in ("true", "false", "1", "0"):
        raise argparse.ArgumentTypeError(f"{text}: true or false")
    return text.lower() in ("true", "1")


class Comparison:
    """One call."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        if not options.rate > 0.0:
            raise UsageError(f"rate: {options.rate}; allowed: > 0")
        self._variants = _available(parse(options.variants, options.host))
        self._bag, self._config, self._description = _material(options.bag, options.config)
        description = self._description
        self._truth = options.truth or _truth_of(self._config, description)
        for kind, file in (("truth", self._truth), ("config", self._config)):
            if file and not os.path.isfile(file):
                raise UsageError(f"{kind}: {file}: no such file")
        self._lidar = options.lidar_topic or _topic(description, "lidar")
        self._imu = options.imu_topic or _topic(description, "imu")
        self._name = str(description.get("name") or "") or _stem(self._bag) or "live"
        home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
        self._out = os.path.abspath(options.out or os.path.join(home, "d2lio_compare"))
        self._stop: int | None = None
        self._roslaunch: subprocess.Popen[bytes] | None = None
        self._player: subprocess.Popen[bytes] | None = None
        self._rviz: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """Does it all."""
        self._write_files()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        try:
            self._start()
            if self._options.rviz and self._going():
                self._show()
            if self._bag:
                self._play()
            self._wait()
        finally:
            self._end()
            code = self._collect()
            self._hold()
        return code if self._stop is None else EXIT_INTERRUPTED

    def _on_signal(self, number: int, _: Any) -> None:
        self._stop = number

    def _write_files(self) -> None:
        options = self._options
        nodes = os.path.join(self._out, NODES)
        try:
            shutil.rmtree(nodes, ignore_errors=True)  # of an earlier comparison
            os.makedirs(nodes)
        except OSError as err:
            raise UsageError(f"out: {self._out}: {err.strerror}") from None
        for name in ("scoreboard.json", "truth.tum"):
            if os.path.exists(os.path.join(self._out, name)):
                os.remove(os.path.join(self._out, name))
        setting = Setting(
            out=self._out,
            config=self._config,
            description=self._description,
            truth_file=self._truth,
            truth_topic=options.truth_topic,
            lidar_topic=self._lidar,
            imu_topic=self._imu,
            lidar_type=options.lidar_type,
            threads=options.threads,
            queue_scans=options.queue_scans,
            sim_time=bool(self._bag),
        )
        meta = {
            "sequence": self._name,
            "bag": self._bag,
            "config": self._config,
            "truth": self._truth or (f"{self._out}/truth.tum" if options.truth_topic else ""),
            "variants": [dict(variant._asdict()) for variant in self._variants],
        }
        self._write(META_FILE, json.dumps(meta, indent=2) + "\n")
        self._write(RVIZ_FILE, rviz_file.write(self._variants))
        self._write(LAUNCH_FILE, launch_file.write(self._variants, setting))

    def _write(self, name: str, text: str) -> None:
        with open(os.path.join(self._out, name), "w", encoding="utf-8") as stream:
            stream.write(text)

    def _start(self) -> None:
        say(f"variants: {', '.join(variant.title for variant in self._variants)}")
        command = ["roslaunch", "--no-summary", "--skip-log-check", "--disable-title"]
        command.append(f"--sigint-timeout={NODE_STOP_S:g}")
        self._roslaunch = subprocess.Popen(
            [*command, os.path.join(self._out, LAUNCH_FILE)],
            start_new_session=True,  # Ctrl-C reaches it through us, once
            preexec_fn=_end_with_us,
        )
        own = [node_of(variant) for variant in self._variants]
        self._until(lambda: graph.listening([*own, "/scoreboard"]), START_UP_S)
        late = [name for name in own if not graph.listening([name])]
        if late and self._going():
            say(f"not up after {START_UP_S:g} s: {', '.join(late)}")

    def _show(self) -> None:
        """Opens RViz; it outlives the variants, and they outlive it."""
        if shutil.which("rviz") is None:
            say("no rviz on PATH; going on without")
            return
        command = ["rviz", "-d", os.path.join(self._out, RVIZ_FILE), "__name:=compare_rviz"]
        self._rviz = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=_end_with_us,
        )

    def _play(self) -> None:
        if not self._going():
            return
        options = self._options
        topics = [topic for topic in (self._lidar, self._imu) if topic]
        command = ["rosbag", "play", "--clock", "--pause", "--quiet", f"--queue={QUEUE}"]
        command += [f"--rate={options.rate:g}", self._bag, f"__name:={PLAYER[1:]}"]
        if len(topics) == 2:
            more = [options.truth_topic] if options.truth_topic else []
            command[-1:-1] = ["--topics", *topics, *more, "--bags", self._bag]
            command.remove(self._bag)
        self._player = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,  # keys to press, which reach nobody
            start_new_session=True,
            preexec_fn=_end_with_us,
        )
        self._until(lambda: graph.connected(PLAYER, topics), START_UP_S)
        if not self._going():
            return
        say(f"playing {self._bag} at {options.rate:g} x")
        if not self._until(lambda: graph.resume(PLAYER), START_UP_S) and self._going():
            say("error: the bag cannot be played")
            self._stop = signal.SIGINT

    def _wait(self) -> None:
        """Until the bag is done and worked off, or someone ends it."""
        if self._player is not None:
            self._until(lambda: self._player.poll() is not None, float("inf"))
            if self._going():
                graph.set_param("/scoreboard/bag_done", True)
                say("the bag is done; waiting for the variants")
                self._until(lambda: graph.get_param("/scoreboard/drained"), DRAIN_S)
        else:
            say("Ctrl-C ends it and writes results and report")
            self._until(lambda: False, float("inf"))

    def _going(self) -> bool:
        return self._stop is None and self._roslaunch.poll() is None

    def _until(self, done: Any, limit_s: float) -> bool:
        """Waits for `done()`; false when time is up or everything is to end."""
        end = time.monotonic() + limit_s
        while self._going() and time.monotonic() < end:
            if done():
                return True
            time.sleep(TICK_S)
        return False

    def _end(self) -> None:
        """Ends the player and the nodes; they save what they have."""
        graph.set_param("/scoreboard/stopping", True)
        for process, patience_s in ((self._player, 5.0), (self._roslaunch, STOP_S)):
            if process is not None:
                _stop(process, patience_s)

    def _hold(self) -> None:
        """Leaves RViz open until it is closed, or somebody ends us."""
        if self._rviz is None:
            return
        if self._options.hold and self._stop is None and self._rviz.poll() is None:
            say("done; close RViz or press Ctrl-C")
            while self._stop is None and self._rviz.poll() is None:
                time.sleep(TICK_S)
            self._stop = None  # everything was done already
        _stop(self._rviz, 5.0)

    def _collect(self) -> int:
        """Results and report by the same code as `d2lio ablate`; it goes on if we are killed."""
        program = _program()
        if program is None:
            say(
                f"trajectories and diagnostics lie in {self._out}/{NODES}; the d2lio command was "
                f"not found: install it and run `d2lio compare-collect {self._out}`"
            )
            return 0
        return subprocess.call(
            [*program, "compare-collect", self._out],
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )


def _end_with_us() -> None:
    """Has the child told to end when we are killed (Linux alone can)."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)


def _stop(process: subprocess.Popen[bytes], patience_s: float) -> None:
    for number, wait_s in ((signal.SIGINT, patience_s), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5)):
        if process.poll() is not None:
            return
        try:
            process.send_signal(number)
            process.wait(wait_s)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            continue


def _available(variants: list[Variant]) -> list[Variant]:
    """Without upstream nodes that the workspace does not have; says so."""
    packages = rospkg.RosPack()
    kept = []
    for variant in variants:
        if variant.upstream:
            try:
                packages.get_path(variant.upstream)
            except rospkg.ResourceNotFound:
                say(
                    f"{UPSTREAMS[variant.upstream]} left out: no package {variant.upstream} on "
                    "ROS_PACKAGE_PATH; build it in a workspace and source that first"
                )
                continue
        kept.append(variant)
    if not kept:
        raise UsageError("variants: none of them can run here")
    return kept


def _material(bag: str, config: str) -> tuple[str, str, dict[str, Any]]:
    """Bag, data description and its content, of a bag, a sequence directory, or neither."""
    if bag and os.path.isdir(bag):
        config = config or os.path.join(bag, SEQUENCE_FILE)
        description = _yaml(config)
        bag = os.path.join(bag, str(description.get("bag", "")))
    elif bag and not config:
        beside = os.path.join(os.path.dirname(os.path.abspath(bag)), SEQUENCE_FILE)
        named = _yaml(beside) if os.path.isfile(beside) else {}
        config = beside if named.get("bag") == os.path.basename(bag) else ""
    if bag and not os.path.isfile(bag):
        raise UsageError(f"bag: {bag}: no such file")
    paths = [os.path.abspath(path) if path else "" for path in (bag, config)]
    return paths[0], paths[1], _yaml(paths[1]) if paths[1] else {}


def _yaml(file: str) -> dict[str, Any]:
    try:
        with open(file, encoding="utf-8") as stream:
            data = yaml.safe_load(stream)
    except (OSError, yaml.YAMLError) as err:
        raise UsageError(f"{file}: {' '.join(str(err).split())}") from None
    if not isinstance(data, dict):
        raise UsageError(f"{file}: not a description of a recording")
    return data


def _topic(description: dict[str, Any], sensor: str) -> str:
    return str((description.get(sensor) or {}).get("topic") or "")


def _truth_of(config: str, description: dict[str, Any]) -> str:
    """The TUM file that the description names, where it is there."""
    name = description.get("ground_truth")
    file = os.path.join(os.path.dirname(config), str(name)) if name else ""
    return file if os.path.isfile(file) else ""


def _stem(file: str) -> str:
    return os.path.splitext(os.path.basename(file))[0]


def _program() -> list[str] | None:
    """The d2lio command: $D2LIO_PROGRAM, on PATH, or of the checkout that this file is in."""
    given = os.environ.get("D2LIO_PROGRAM")
    if given:
        return shlex.split(given)
    found = shutil.which("d2lio")
    here = os.path.realpath(__file__)
    for _ in range(5):
        here = os.path.dirname(here)
        candidate = os.path.join(here, ".venv", "bin", "d2lio")
        if found is None and os.access(candidate, os.X_OK):
            found = candidate
    return None if found is None else [found]
