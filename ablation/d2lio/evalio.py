# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Our estimators as evalio pipelines and our sequences as an evalio data set.

A plug-in: `EVALIO_CUSTOM=d2lio.evalio evalio run -p d2lio -d d2lio/NAME -o OUT`. Sequences are the
directories with a sequence.yaml in $D2LIO_SEQUENCES, else in $EVALIO_DATA/d2lio. evalio must be
installed beside d2lio; nothing else of d2lio imports this module.

evalio registers every pipeline and data set it finds in the module, hence the base classes are
deleted or kept out of it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import evalio
import numpy as np
from evalio import datasets as evalio_datasets
from evalio import types as et

from d2lio.datasets import ImuBlock, open_source, timed_events
from d2lio.datasets.config import LidarSource, SourceConfig
from d2lio.datasets.events import NS_PER_S
from d2lio.datasets.timing import scan_end
from d2lio.hosts import HOSTS, describe, liosam_missing, load_host
from d2lio.metrics.tum import read_tum
from d2lio.peers.workers.evalio_cloud import Grid, to_stamp
from d2lio.sequence import FILE_NAME, LidarInfo
from d2lio.sequence import Sequence as Description
from d2lio.source_params import COLUMNS, LIVOX, all_params, columns_of

URL = "-"
GRAVITY = np.array([0.0, 0.0, -9.81])
THREADS = "threads"
FIRING_NS = {"vlp16": 55_296, "hdl32e": 46_080}  # these lasers keep their rate whatever the motor's
PREFIX = "d2lio_"  # of the hosts that are not D²-LIO itself

Param = bool | int | float | str


def sequences_root() -> Path:
    """Where the sequences lie."""
    given = os.environ.get("D2LIO_SEQUENCES")
    return Path(given) if given else Path(evalio_datasets.get_data_dir()) / "d2lio"


def grid_of(lidar: LidarInfo) -> Grid:
    """The cells that hold every firing of a LiDAR once."""
    model, period_ns = lidar.model.lower(), round(NS_PER_S / lidar.rate_hz)
    columns = columns_of(LidarSource(model=model))
    if model in FIRING_NS:
        columns = period_ns // FIRING_NS[model] + 2  # one for the rest, one for the last turn's
        period_ns = columns * FIRING_NS[model]
    return Grid(lidar.rings, columns, period_ns, model in LIVOX)


def _param(entry: dict[str, str]) -> Param:
    """A default with the type evalio shall ask for."""
    kind, text = entry["type"], entry["default"]
    if kind == "bool":
        return text == "true"
    try:
        return int(text) if kind == "int" else float(text) if kind == "float" else text
    except ValueError:
        return text


def _text(value: Param) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _points(scan: et.LidarMeasurement) -> dict[str, np.ndarray]:
    """Arrays of the points that are there, in the order they were fired."""
    xyz = np.asarray(scan.to_vec_positions(), np.float64).reshape(-1, 3)
    rest = np.array([(p.t.to_nsec(), p.row, p.intensity) for p in scan.points], np.float64)
    rest = rest.reshape(-1, 3)
    there = np.flatnonzero(np.any(xyz != 0.0, axis=1))
    there = there[np.lexsort((rest[there, 1], rest[there, 0]))]
    return {
        "xyz": np.ascontiguousarray(xyz[there], np.float32),
        "dt_ns": rest[there, 0].astype(np.int32),
        "intensity": rest[there, 2].astype(np.float32),
        "ring": rest[there, 1].astype(np.uint16),
    }


class _HostPipeline(evalio.pipelines.Pipeline):
    """A host behind evalio's interface; poses are stamped with the end of their scan."""

    HOST = ""

    def __init__(self) -> None:
        super().__init__()
        self._given: dict[str, Param] = {}
        self._lidar = LidarSource()
        self._extrinsic = np.eye(4)
        self._host: Any = None

    @classmethod
    def name(cls) -> str:
        """evalio's name of the pipeline."""
        return cls.HOST if cls.HOST == "d2lio" else PREFIX + cls.HOST

    @staticmethod
    def version() -> str:
        """Version of d2lio."""
        from d2lio import __version__

        return __version__

    @staticmethod
    def url() -> str:
        """Where it comes from."""
        return URL

    @classmethod
    def default_params(cls) -> dict[str, Param]:
        """The host's parameters; what the data set tells replaces a default left as it is."""
        return {THREADS: 1} | {entry["key"]: _param(entry) for entry in describe(cls.HOST)}

    def set_params(self, params: dict[str, Param]) -> dict[str, Param]:
        """Keeps what differs from the defaults; gives back the unknown."""
        known = self.default_params()
        self._given = {k: v for k, v in params.items() if k in known and v != known[k]}
        return {k: v for k, v in params.items() if k not in known}

    def set_imu_params(self, params: et.ImuParams) -> None:
        """Nothing: the hosts have noise parameters of their own, as in `d2lio run`."""

    def set_lidar_params(self, params: et.LidarParams) -> None:
        """Takes ranges, rings, columns and the model's name."""
        known = params.model.lower() in COLUMNS
        self._lidar = LidarSource(
            model="" if params.model == "-" else params.model,
            rings=params.num_rows,
            columns=0 if known else params.num_columns,  # 0: as in `d2lio run`
            rate_hz=params.rate,
            min_range_m=params.min_range,
            max_range_m=params.max_range,
        )

    def set_imu_T_lidar(self, T: et.SE3) -> None:
        """Takes the extrinsic."""
        self._extrinsic = np.asarray(T.to_mat(), float)

    def initialize(self) -> None:
        """Makes the host."""
        config = SourceConfig(T_imu_lidar=self._extrinsic.tolist(), lidar=self._lidar)
        own = {key: _text(value) for key, value in self._given.items() if key != THREADS}
        params = all_params(config, self.HOST, None, None, own)
        self._host = load_host(self.HOST)(params, int(self._given.get(THREADS, 1)))

    def add_imu(self, sample: et.ImuMeasurement) -> None:
        """Hands a sample on."""
        stamps = np.array([sample.stamp.to_nsec()], np.int64)
        gyro, accel = (np.asarray(v, float).reshape(1, 3) for v in (sample.gyro, sample.accel))
        self._host.add_imu(stamps, gyro, accel)
        self._drain()

    def add_lidar(self, scan: et.LidarMeasurement) -> None:
        """Hands a scan on; it is processed once its IMU samples are there."""
        points = _points(scan)
        if len(points["xyz"]):
            self._host.add_scan(scan.stamp.to_nsec(), **points)
            self._drain()

    def _drain(self) -> None:
        while (result := self._host.step()) is not None:
            if result.has_pose:
                pose = et.SE3.from_mat(np.array(result.T_map_imu, float))
                self.save(to_stamp(result.stamp), pose)

    def map(self) -> dict[str, Any]:
        """Nothing is shown."""
        return {}


class _SequenceIterator(evalio_datasets.DatasetIterator):
    """Measurements in order of arrival; a scan comes when IMU samples reach its end."""

    def __init__(self, path: Path, grid: Grid) -> None:
        self._path, self._grid = path, grid

    def _events(self) -> Iterator[Any]:
        source = open_source(self._path)
        held: list[Any] = []
        for event in timed_events(source.reader, log_times=source.log_times):
            if not isinstance(event, ImuBlock):
                held.append(event)
                continue
            for stamp, gyro, accel in zip(event.stamps, event.gyro, event.accel, strict=True):
                yield et.ImuMeasurement(to_stamp(stamp), gyro.copy(), accel.copy())
                while held and stamp > scan_end(held[0]):
                    yield self._cloud(held.pop(0))
        yield from map(self._cloud, held)

    def _cloud(self, scan: Any) -> Any:
        intensity = np.zeros(len(scan), np.float32) if scan.intensity is None else scan.intensity
        ring = np.zeros(len(scan), np.uint16) if scan.ring is None else scan.ring
        return self._grid.cloud(scan.stamp, scan.xyz, scan.dt_ns, intensity, ring)

    def imu_iter(self) -> Iterator[Any]:
        """IMU samples alone."""
        return (event for event in self._events() if isinstance(event, et.ImuMeasurement))

    def lidar_iter(self) -> Iterator[Any]:
        """Scans alone."""
        return (event for event in self._events() if isinstance(event, et.LidarMeasurement))

    def __iter__(self) -> Iterator[Any]:
        return self._events()

    def __len__(self) -> int:
        return open_source(self._path).reader.scan_total or 0


class _Sequences(evalio_datasets.Dataset):
    """Sequence directories; members are made from what lies there when evalio starts."""

    @property
    def folder(self) -> Path:
        """Directory of the sequence."""
        return sequences_root() / self.value

    def _described(self) -> Description:
        return Description.load(self.folder)

    def data_iter(self) -> _SequenceIterator:
        """Iterates over the bag."""
        return _SequenceIterator(self.folder, grid_of(self._described().lidar))

    def ground_truth_raw(self) -> et.Trajectory | None:
        """Ground truth, T_world_imu."""
        path = self._described().ground_truth_path
        if path is None:
            return None
        truth = read_tum(path)
        stamps = [to_stamp(stamp) for stamp in truth.stamps.tolist()]
        poses = [
            et.SE3(rot=et.SO3(qx=x, qy=y, qz=z, qw=w), trans=position)
            for (x, y, z, w), position in zip(
                truth.quaternions.tolist(), truth.positions, strict=True
            )
        ]
        return et.Trajectory(stamps=stamps, poses=poses)

    def imu_T_lidar(self) -> et.SE3:
        """T_imu_lidar."""
        return et.SE3.from_mat(self._described().extrinsic)

    def imu_T_gt(self) -> et.SE3:
        """Identity: the truth is the IMU's."""
        return et.SE3.identity()

    def imu_params(self) -> et.ImuParams:
        """Noise and rate."""
        imu = self._described().imu
        return et.ImuParams(
            gyro=imu.gyro_noise,
            accel=imu.accel_noise,
            gyro_bias=imu.gyro_walk,
            accel_bias=imu.accel_walk,
            bias_init=1e-7,
            integration=1e-7,
            gravity=GRAVITY,
            rate=imu.rate_hz,
        )

    def lidar_params(self) -> et.LidarParams:
        """Rings, columns, ranges, rate, and the model by its name."""
        lidar = self._described().lidar
        return et.LidarParams(
            num_rows=lidar.rings,
            num_columns=grid_of(lidar).columns,
            min_range=lidar.min_range_m,
            max_range=lidar.max_range_m,
            rate=lidar.rate_hz,
            model=lidar.model,
        )

    def files(self) -> Sequence[str | Path]:
        """What must be there."""
        return [self.folder / FILE_NAME, self._described().bag_path]

    def quick_len(self) -> int | None:
        """Scans, from the bag's index."""
        return open_source(self.folder).reader.scan_total

    @classmethod
    def dataset_name(cls) -> str:
        """The prefix of the sequences' names."""
        return "d2lio"


def _register(pipeline: type, sequences: Any) -> dict[str, type]:
    """A pipeline for each host that is built, and the data set."""
    found: dict[str, type] = {}
    for host in HOSTS:
        if host == "fastlio" or liosam_missing() is None:
            title = f"Pipeline_{host}"
            found[title] = type(title, (pipeline,), {"HOST": host, "__module__": __name__})
    names = sorted(p.parent.name for p in sequences_root().glob(f"*/{FILE_NAME}"))
    if names:
        found["D2lio"] = sequences("D2lio", {n.upper(): n for n in names}, module=__name__)
    return found


globals().update(_register(_HostPipeline, _Sequences))
del _HostPipeline, _Sequences
