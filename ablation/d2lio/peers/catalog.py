# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The peers: which packages, in which version, how each is set and why.

The settings are the same for every scene. `Setting.package` is the package's own default where
ours departs from it, and `Setting.why` says why.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Value = float | int | bool
Kind = Literal["LO", "LIO"]
NUMPY = "numpy>=1.26"


@dataclass(frozen=True, slots=True)
class Setting:
    """One parameter of a peer.

    Attributes:
        key: as in the package; default: ours; its type is the parameter's.
        low, high: allowed range, both included.
        package: the package's default where it is another.
        why: reason of that departure.
    """

    key: str
    default: Value
    low: float
    high: float
    unit: str
    doc: str
    package: Value | None = None
    why: str = ""

    @property
    def kind(self) -> str:
        """float, int or bool."""
        return type(self.default).__name__

    @property
    def text(self) -> str:
        """The documentation with the departure."""
        if self.package is None:
            return self.doc
        return f"{self.doc} (the package's default is {self.package}: {self.why})"


@dataclass(frozen=True, slots=True)
class Peer:
    """One estimator of others.

    Attributes:
        name: of the host; title, short: in tables.
        package, version: what pip installs; requirements: beside it.
        alone: the package is installed without what it says it depends on (viewers, plotting).
        build_constraints: of the packages it is built with.
        licence: SPDX; url: where it comes from.
        kind: LO (LiDAR only) or LIO (with IMU).
        environment: directory of its virtual environment, which peers may share.
        driver: name in workers/serve.py.
        pose: the instant and the frame the peer's own pose refers to.
        settings: its parameters.
        fixed: what the driver is told besides.
    """

    name: str
    title: str
    package: str
    version: str
    licence: str
    url: str
    kind: Kind
    driver: str
    pose: str
    settings: tuple[Setting, ...] = ()
    fixed: tuple[tuple[str, str], ...] = ()
    requirements: tuple[str, ...] = (NUMPY,)
    alone: bool = False
    build_constraints: tuple[str, ...] = ()
    environment: str = ""
    worker: str = "serve.py"

    @property
    def needs_imu(self) -> bool:
        """Whether IMU samples are handed to it."""
        return self.kind == "LIO"

    @property
    def env(self) -> str:
        """Name of its environment."""
        return self.environment or self.name

    @property
    def pins(self) -> list[str]:
        """What pip is told to install; the package comes first."""
        return [f"{self.package}=={self.version}", *self.requirements]


def _deskew(default: bool, package: bool | None = None, why: str = "") -> Setting:
    doc = "undo the motion within a scan; the pose is then that of the scan's end, else its middle"
    return Setting("deskew", default, 0, 1, "", doc, package, why)


def _voxel(default: float, doc: str, package: float | None = None, why: str = "") -> Setting:
    return Setting("voxel_size", default, 0.05, 5.0, "m", doc, package, why)


def _evalio(
    pipeline: str, title: str, kind: Kind, licence: str, settings: tuple[Setting, ...] = ()
) -> Peer:
    poses = {
        "liosam": "IMU, 1.5 sweeps before evalio's stamp (two clouds are held back)",
        "dlio": "IMU, middle of the scan",
        "loam": "IMU, middle of the scan",
        "ct": "IMU, start of the scan",
    }
    return Peer(
        name=f"evalio-{pipeline}",
        title=title,
        package="evalio",
        version="0.6.1",
        licence=licence,
        url="https://github.com/contagon/evalio",
        kind=kind,
        environment="evalio",
        driver="evalio",
        pose=poses[pipeline],
        settings=settings,
        fixed=(("pipeline", pipeline),),
    )


_ALL = (
    Peer(
        name="kiss-icp",
        title="KISS-ICP",
        package="kiss-icp",
        version="1.3.0",
        licence="MIT",
        url="https://github.com/PRBonn/kiss-icp",
        kind="LO",
        driver="kiss_icp",
        pose="LiDAR, end of the scan",
        settings=(
            Setting(
                "voxel_size", 0.0, 0.0, 5.0, "m", "of the map; 0 is max range / 100, as the package"
            ),
            _deskew(True),
        ),
    ),
    Peer(
        name="genz-icp",
        title="GenZ-ICP",
        package="genz-icp",
        version="0.3.2",
        licence="MIT",
        url="https://github.com/cocel-postech/genz-icp",
        kind="LO",
        driver="genz_icp",
        pose="LiDAR, end of the scan",
        settings=(
            _voxel(0.3, "of the map, where its adaptive voxels begin"),
            _deskew(True, False, "the data hold true motion distortion"),
        ),
    ),
    Peer(
        name="mad-icp",
        title="MAD-ICP",
        package="mad-icp",
        version="0.0.10",
        licence="BSD-3-Clause",
        url="https://github.com/rvp-group/mad-icp",
        kind="LO",
        driver="mad_icp",
        pose="LiDAR, end of the scan",
        alone=True,  # else 1.4 GB of viewers
        build_constraints=("scikit-build-core<0.10",),
        settings=(
            _deskew(True),
            Setting("keyframes", 4, 1, 64, "", "clouds of the local map matched at once"),
            Setting("b_max", 0.2, 0.01, 5.0, "m", "largest leaf of the trees"),
            Setting("b_min", 0.1, 0.01, 5.0, "m", "flatness below which a leaf is a plane"),
            Setting("b_ratio", 0.02, 0.0, 1.0, "", "growth of the search with range"),
            Setting("p_th", 0.8, 0.0, 1.0, "", "overlap below which a keyframe is made"),
            Setting("rho_ker", 0.1, 0.001, 10.0, "m", "Huber threshold"),
        ),
    ),
    Peer(
        name="small-gicp",
        title="small_gicp",
        package="small-gicp",
        version="1.0.1",
        licence="MIT",
        url="https://github.com/koide3/small_gicp",
        kind="LO",
        driver="small_gicp",
        pose="LiDAR, end of the scan (the odometry loop is ours)",
        settings=(
            _voxel(1.0, "of the Gaussian voxel map"),
            Setting("downsampling_resolution", 0.5, 0.05, 5.0, "m", "of the scan"),
            Setting("max_correspondence_distance", 2.0, 0.1, 20.0, "m", "gate of the matches"),
            Setting("max_iterations", 30, 1, 200, "", "of one registration"),
            Setting("map_scans", 300, 10, 1000000, "", "scans after which an unseen voxel goes"),
            _deskew(True),
        ),
    ),
    Peer(
        name="genz-lio",
        title="GenZ-LIO",
        package="genz-lio",
        version="0.1.1",
        licence="GPL-2.0-only",
        url="https://github.com/cocel-postech/genz-lio",
        kind="LIO",
        driver="genz_lio",
        pose="IMU, end of the scan",
        settings=(
            _voxel(1.0, "root of the map's octree"),
            Setting("down_sample_size", 0.25, 0.05, 5.0, "m", "of the scan, before it adapts"),
        ),
    ),
    Peer(
        name="rko-lio",
        title="RKO-LIO",
        package="rko-lio",
        version="0.4.0",
        licence="MIT",
        url="https://github.com/PRBonn/rko_lio",
        kind="LIO",
        driver="rko_lio",
        pose="IMU (its base), end of the scan",
        settings=(
            _voxel(1.0, "of the map"),
            Setting("initialization_phase", False, 0, 1, "", "level on the first two scans"),
            Setting("double_downsample", True, 0, 1, "", "down-sample a scan twice"),
        ),
    ),
    Peer(
        name="se3-lio",
        title="SE(3)-LIO",
        package="se3-lio",
        version="0.2.0",
        licence="GPL-2.0-only",
        url="https://github.com/url-kaist/se3-lio",
        kind="LIO",
        driver="se3_lio",
        pose="IMU, the state's stamp (end of the scan)",
        settings=(
            Setting("downsample_resolution", 0.25, 0.05, 5.0, "m", "of the scan",
                    0.5, "its good setting for 16 rings"),
            Setting("lidar_range_noise", 0.02, 1e-4, 1.0, "m", "1 sigma",
                    0.001, "2 cm is what such sensors have"),
            Setting("lidar_angle_noise", 0.15, 1e-4, 5.0, "deg", "1 sigma",
                    0.01, "the beam's width, not the encoder's step"),
            Setting("voxel_map_resolution", 1.0, 0.1, 10.0, "m", "of the map"),
        ),
    ),
    Peer(
        name="pelorus",
        title="Pelorus",
        package="pelorus",
        version="0.0.8",
        licence="MIT OR Apache-2.0",
        url="https://github.com/uos/pelorus",
        kind="LIO",
        driver="pelorus",
        pose="LiDAR, the pose's own stamp",
        settings=(Setting("map_resolution", 0.5, 0.05, 5.0, "m", "of the map"),),
    ),
    _evalio("liosam", "LIO-SAM (evalio)", "LIO", "BSD-3-Clause", (
        Setting("mappingProcessInterval", 0.0, 0.0, 10.0, "s", "least time between two scans",
                0.15, "it would repeat every second pose"),
        Setting("odometrySurfLeafSize", 0.4, 0.05, 5.0, "m", "of the surface features"),
        Setting("mappingCornerLeafSize", 0.2, 0.05, 5.0, "m", "of the corner map"),
        Setting("mappingSurfLeafSize", 0.4, 0.05, 5.0, "m", "of the surface map"),
    )),
    _evalio("dlio", "DLIO (evalio)", "LIO", "MIT", (
        Setting("imu_calib_time", 1.5, 0.0, 60.0, "s", "standstill its IMU calibration takes",
                3.0, "sequences begin with 2 s at rest"),
    )),
    _evalio("loam", "LOAM (evalio)", "LO", "MIT"),
    _evalio("ct", "CT-ICP (evalio)", "LO", "MIT"),
)  # fmt: skip

PEERS: dict[str, Peer] = {peer.name: peer for peer in _ALL}
