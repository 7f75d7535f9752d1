# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Simulation of one sequence: scene, sensors and trajectory in, a directory out."""

from __future__ import annotations

import errno
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from d2lio.errors import ConfigError, DataError
from d2lio.sequence import FILE_NAME as SEQUENCE_FILE
from d2lio.sequence import ImuInfo, LidarInfo, Sequence
from d2lio.simulator import imu as imu_model
from d2lio.simulator import returns
from d2lio.simulator.bag import POINT, BagWriter, Orientation
from d2lio.simulator.imu import IMU_GRADES, ImuGrade
from d2lio.simulator.lidar import SCAN_NS, SENSORS, Rays, Sensor
from d2lio.simulator.scenes import SCENES
from d2lio.simulator.trajectory import Trajectory, euler_to_matrix
from d2lio.simulator.world import World

EPOCH_NS = 1_700_000_000_123_456_789  # stamp of t = 0
LEAD_NS = 150_000_000  # the IMU runs this much longer than the lidar, at both ends
BAG_FILE, TRUTH_FILE = "data.bag", "gt.tum"
OWN_FILES = {BAG_FILE, TRUTH_FILE, SEQUENCE_FILE}
LIDAR_TOPIC = "/lidar/points"
IMU_TOPIC = "/imu/data"
LEVER_ARM = (0.03, 0.05, 0.08)  # m, lidar origin in the IMU frame
MOUNT_DEG = (1.2, -0.8, 0.5)  # yaw, pitch, roll of the lidar in the IMU frame
MIN_DURATION = 2 * LEAD_NS * 1e-9 + 0.2
MAX_DURATION = 3600.0

Progress = Callable[[int, int], None]
T = TypeVar("T")


@dataclass(frozen=True)
class Seeds:
    """Independent seeds of the scene's detail, of the motion, and of all sensor noise."""

    scene: int = 0
    motion: int = 0
    noise: int = 0


@dataclass(frozen=True)
class Scan:
    """One scan: points (n,) of dtype POINT in the lidar frame; start, end in ns from t = 0."""

    start: int
    end: int
    points: np.ndarray


def extrinsic() -> np.ndarray:
    """T_imu_lidar (4, 4) of the simulated rig."""
    matrix = np.eye(4)
    matrix[:3, :3] = euler_to_matrix(np.deg2rad([MOUNT_DEG]))[0]
    matrix[:3, 3] = LEVER_ARM
    return matrix


def simulate(
    scene: str,
    out: Path | str,
    *,
    sensor: str = "vlp16",
    seed: int | Seeds = 0,
    duration: float | None = None,
    imu: str = "industrial",
    range_noise: float | None = None,
    orientation: bool = False,
    progress: Progress | None = None,
) -> Sequence:
    """Simulate a sequence into the directory out: data.bag, gt.tum, sequence.yaml.

    The directory appears in one step at the end; a former sequence there is replaced.

    Args:
        scene: a key of SCENES.
        out: directory to make.
        sensor: a key of SENSORS.
        seed: one seed for everything, or one each for scene, motion and noise.
        duration: s, standstill included; None takes the scene's own.
        imu: a key of IMU_GRADES.
        range_noise: 1 σ in m; None takes the sensor's own. 0 also turns range quantisation off.
        orientation: the IMU has nine axes and gives its attitude, with an attitude filter's errors.
        progress: called with (scans done, scans in all).

    Raises:
        ConfigError: a name is unknown or a number out of range.
        DataError: the directory holds something else, or cannot be written.
    """
    spec = _choose("scene", scene, SCENES)
    lidar = _choose("sensor", sensor, SENSORS)
    grade = _choose("imu", imu, IMU_GRADES)
    length = _number("duration", spec.duration if duration is None else duration,
                     MIN_DURATION, MAX_DURATION)  # fmt: skip
    sigma = _number("range_noise", lidar.range_noise if range_noise is None else range_noise,
                    0.0, 10.0)  # fmt: skip
    seeds = _seeds(seed)
    world = build_world(scene, seeds, length)
    sequence = _describe(f"{scene}_{sensor}_s{seeds.noise}", lidar, sensor, grade)
    scans = scan_world(world, lidar, sigma, _rng(scene, "range", seeds.noise), length)
    samples = _imu_samples(world.trajectory, grade, scene, seeds, length, orientation)

    def write(directory: Path) -> None:
        _write_bag(directory / BAG_FILE, samples, scans, _tell(progress, _scan_count(length)))
        _write_truth(directory / TRUTH_FILE, world.trajectory, length)
        sequence.save(directory)

    target = Path(out)
    _replace_directory(target, write)
    return Sequence.load(target)


def build_world(scene: str, seeds: Seeds, duration: float | None = None) -> World:
    """The scene and the trajectory of a sequence, as `simulate` makes them.

    Args:
        scene: a key of SCENES.
        seeds: of the scene's detail and of the motion.
        duration: s; None takes the scene's own.

    Raises:
        ConfigError: the name is unknown.
    """
    spec = _choose("scene", scene, SCENES)
    return spec.build(
        _rng(scene, "scene", seeds.scene),
        _rng(scene, "motion", seeds.motion),
        spec.duration if duration is None else duration,
    )


def scan_world(
    world: World, sensor: Sensor, range_noise: float, rng: np.random.Generator, duration: float
) -> Iterator[Scan]:
    """All scans of a drive of duration s through the world; range_noise is 1 σ in m."""
    for index in range(_scan_count(duration)):
        yield take_scan(world, sensor, index, range_noise, rng)


def take_scan(
    world: World, sensor: Sensor, index: int, range_noise: float, rng: np.random.Generator
) -> Scan:
    """Scan number index, every ray from the sensor's pose at its own firing time."""
    rays = sensor.rays(index)
    t_ns = rays.t_ns + LEAD_NS
    origin, direction = _rays_in_world(world.trajectory, rays, t_ns, extrinsic())
    hits = world.cast(t_ns * 1e-9, origin, direction, sensor.max_range)
    kept, distance, value = returns.measure(hits, sensor, range_noise, rng)
    points = np.empty(len(kept), dtype=POINT)
    for axis, name in enumerate("xyz"):
        points[name] = rays.directions[kept, axis] * distance
    points["intensity"] = value
    points["ring"] = rays.ring[kept]
    points["time"] = (t_ns[kept] - t_ns[0]) * 1e-9
    return Scan(int(t_ns[0]), LEAD_NS + (index + 1) * SCAN_NS, points)


def _rays_in_world(
    trajectory: Trajectory, rays: Rays, t_ns: np.ndarray, mount: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    moments, back = np.unique(t_ns, return_inverse=True)
    position, rotation = trajectory.pose(moments * 1e-9)
    lidar_rotation = np.einsum("nij,jk->nik", rotation, mount[:3, :3])
    lidar_position = position + np.einsum("nij,j->ni", rotation, mount[:3, 3])
    direction = np.einsum("nij,nj->ni", lidar_rotation[back], rays.directions)
    return lidar_position[back], direction


def _scan_count(duration: float) -> int:
    return (round(duration * 1e9) - 2 * LEAD_NS) // SCAN_NS


def _describe(name: str, lidar: Sensor, model: str, grade: ImuGrade) -> Sequence:
    return Sequence(
        name=name,
        bag=BAG_FILE,
        ground_truth=TRUTH_FILE,
        T_imu_lidar=[[float(value) for value in row] for row in extrinsic()],
        lidar=LidarInfo(
            topic=LIDAR_TOPIC,
            model=model,
            rings=lidar.rings,
            rate_hz=lidar.rate_hz,
            min_range_m=lidar.min_range,
            max_range_m=lidar.max_range,
            time_field="time",
            time_unit="s",
        ),
        imu=ImuInfo(
            topic=IMU_TOPIC,
            rate_hz=float(imu_model.RATE_HZ),
            gyro_noise=grade.gyro_noise,
            accel_noise=grade.accel_noise,
            gyro_walk=grade.gyro_walk,
            accel_walk=grade.accel_walk,
        ),
    )


@dataclass(frozen=True)
class _ImuSamples:
    """Stamps (n,) ns; rate rad/s, force m/s² (n, 3); variances; attitude x y z w (n, 4) or None."""

    stamps: np.ndarray
    rate: np.ndarray
    force: np.ndarray
    variance: tuple[float, float]
    attitude: np.ndarray | None

    def write(self, bag: BagWriter, i: int) -> None:
        orientation = None
        if self.attitude is not None:
            error = imu_model.AhrsErrors()
            variance = (error.tilt**2, error.tilt**2, error.heading**2)
            orientation = Orientation(self.attitude[i], variance)
        stamp = EPOCH_NS + int(self.stamps[i])
        bag.imu(stamp, self.rate[i], self.force[i], self.variance, orientation)


def _imu_samples(
    trajectory: Trajectory,
    grade: ImuGrade,
    scene: str,
    seeds: Seeds,
    duration: float,
    orientation: bool,
) -> _ImuSamples:
    stamps = imu_model.sample_times(duration)
    rate, force = imu_model.measure(trajectory, stamps, grade, _rng(scene, "imu", seeds.noise))
    variance = (
        grade.gyro_noise**2 * imu_model.RATE_HZ,
        grade.accel_noise**2 * imu_model.RATE_HZ,
    )
    attitude = None
    if orientation:
        attitude = imu_model.attitude(trajectory, stamps, _rng(scene, "attitude", seeds.noise))
    return _ImuSamples(stamps, rate, force, variance, attitude)


def _write_bag(
    path: Path, samples: _ImuSamples, scans: Iterator[Scan], tell: Callable[[int], None]
) -> None:
    stamps = samples.stamps
    with BagWriter(path, LIDAR_TOPIC, IMU_TOPIC) as bag:
        sent = 0

        def send_imu(until: int) -> None:
            nonlocal sent
            while sent < len(stamps) and stamps[sent] <= until:
                samples.write(bag, sent)
                sent += 1

        for index, scan in enumerate(scans):
            send_imu(scan.end)
            bag.cloud(EPOCH_NS + scan.start, EPOCH_NS + scan.end, scan.points)
            tell(index + 1)
        send_imu(int(stamps[-1]))


def _write_truth(path: Path, trajectory: Trajectory, duration: float) -> None:
    stamps = imu_model.sample_times(duration)
    t = stamps * 1e-9
    position, _ = trajectory.pose(t)
    rows = np.column_stack([position, trajectory.quaternion(t)])
    with path.open("w", encoding="ascii", newline="\n") as file:
        for stamp, row in zip(stamps, rows, strict=True):
            seconds, rest = divmod(EPOCH_NS + int(stamp), 1_000_000_000)
            numbers = " ".join(f"{value:.9f}" for value in row)
            file.write(f"{seconds}.{rest:09d} {numbers}\n")


def _tell(progress: Progress | None, total: int) -> Callable[[int], None]:
    if progress is None:
        return lambda done: None
    return lambda done: progress(done, total)


def _choose(key: str, name: str, choices: Mapping[str, T]) -> T:
    if name not in choices:
        raise ConfigError(key, name, "one of " + ", ".join(choices))
    return choices[name]


def _number(key: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:  # also refuses NaN
        raise ConfigError(key, value, f"{low:g} … {high:g}")
    return float(value)


def _seeds(seed: int | Seeds) -> Seeds:
    seeds = seed if isinstance(seed, Seeds) else Seeds(seed, seed, seed)
    for key in ("scene", "motion", "noise"):
        value = getattr(seeds, key)
        if not isinstance(value, int | np.integer) or value < 0:
            raise ConfigError(f"seed.{key}", value, "an integer >= 0")
    return seeds


def _rng(scene: str, stream: str, seed: int) -> np.random.Generator:
    # The motion and noise of one seed should differ between scenes, too.
    name = zlib.crc32(f"{scene}/{stream}".encode())
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, name])))


def _replace_directory(target: Path, write: Callable[[Path], None]) -> None:
    if target.exists() and not _replaceable(target):
        raise DataError(f"{target}: exists and holds more than a simulated sequence; left as it is")
    scratch: Path | None = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
        write(scratch)
        scratch.chmod(0o755)
        _swap(scratch, target)
    except OSError as error:
        reason = "the disk is full" if error.errno == errno.ENOSPC else error.strerror or str(error)
        raise DataError(f"{target}: cannot be written: {reason}") from error
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)


def _swap(scratch: Path, target: Path) -> None:
    old = scratch.with_name(scratch.name + ".old")
    if target.exists():
        target.rename(old)
    try:
        scratch.rename(target)
    except BaseException:
        if old.exists():
            old.rename(target)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _replaceable(target: Path) -> bool:
    # A directory with anything beside our own three files, such as results, is never removed.
    return target.is_dir() and {file.name for file in target.iterdir()} <= OWN_FILES
