# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Finds out what a path holds and opens it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from d2lio.datasets.config import ImuSource, LidarSource, SourceConfig
from d2lio.datasets.events import Reader
from d2lio.errors import ConfigError, DataError
from d2lio.sequence import FILE_NAME, Sequence

KITTI_TRUTH = "gt_imu_tum.txt"


def is_kitti(path: Path) -> bool:
    """Whether the directory holds a converted KITTI drive (see `KittiReader`)."""
    return (path / "oxts.csv").is_file() and (path / "scans").is_dir()


@dataclass(frozen=True, slots=True)
class Source:
    """A data set ready to be read: its reader, what is known about it, its ground truth."""

    name: str
    reader: Reader
    config: SourceConfig
    ground_truth: Path | None
    log_times: bool = False


def open_source(path: Path, config: Path | None = None, stamps: str | None = None) -> Source:
    """Opens a sequence directory, a KITTI drive, an Ouster capture, or a bag.

    Args:
        path: directory or file.
        config: YAML for anything that is not a sequence directory (`SourceConfig`), or the name of
            a known device, DATASET/DEVICE (see `d2lio datasets`). A bag recognised as a known
            sequence needs none.
        stamps: header or log; overrides the configuration.

    Raises:
        DataError: nothing readable there; ConfigError: a configuration that cannot be used.
    """
    if stamps not in (None, "header", "log"):
        raise ConfigError("stamps", stamps, "header, log")
    if not path.exists():
        raise DataError(f"{path}: no such file or directory")
    if (path / FILE_NAME).is_file() and config is None:
        source = _open_sequence(path, stamps)
    elif is_kitti(path):
        source = _open_kitti(path, config)
    elif path.suffix in (".pcap", ".osf"):
        source = _open_ouster(path, config)
    else:
        source = _open_bag(path, config, stamps)
    return replace(source, log_times=source.config.stamps == "log")


def _with_stamps(config: SourceConfig, stamps: str | None) -> SourceConfig:
    return config if stamps is None else config.model_copy(update={"stamps": stamps})


def _open_sequence(path: Path, stamps: str | None) -> Source:
    from d2lio.datasets.bag import BagReader

    sequence = Sequence.load(path)
    config = _with_stamps(SourceConfig.from_sequence(sequence), stamps)
    reader = BagReader(sequence.bag_path, config)
    return Source(sequence.name, reader, config, _existing(sequence.ground_truth_path))


def _open_bag(path: Path, config_file: Path | None, stamps: str | None) -> Source:
    from d2lio.datasets.bag import BagReader

    config, remarks = _bag_config(path, config_file)
    config = _with_stamps(config, stamps)
    reader = BagReader(path, config)
    config = _named_after_messages(config, reader.lidar_topic.msgtype)
    for remark in remarks:
        reader.notes.tell(remark)
    truth = _beside(config, config_file)
    return Source(config.name or path.stem, reader, config, truth)


def _bag_config(path: Path, config_file: Path | None) -> tuple[SourceConfig, list[str]]:
    """The configuration given, or that of the known device; remarks for the user."""
    from d2lio.datasets.bagfile import open_bag
    from d2lio.datasets.catalog import device_named
    from d2lio.datasets.recognise import has_topics, recognise

    known = None
    if config_file is not None:
        known = None if config_file.exists() else device_named(config_file.as_posix())
        if known is None:
            return SourceConfig.load(config_file), []
    with open_bag(path) as bag:
        topics = {t.name: t.msgtype for t in bag.topics if t.count}
    if known is not None:
        return known.source_config(path.stem, topics), known.remarks()
    match = recognise(path, topics)
    if match is None or match.sequence is None or not has_topics(match.device, topics):
        return SourceConfig(), ["no --config given: T_imu_lidar is taken as identity"]
    name = f"{match.dataset.name}/{match.device_name}"
    said = f"recognised as {match.sequence.name} of {name}; --config replaces what is known of it"
    return match.device.source_config(match.sequence.name, topics), [said, *match.device.remarks()]


def _named_after_messages(config: SourceConfig, msgtype: str) -> SourceConfig:
    """The configuration, its LiDAR called a Livox where only the messages tell."""
    from d2lio.datasets.livox import MESSAGE_TYPES

    if config.lidar.model or msgtype not in MESSAGE_TYPES:
        return config
    return config.model_copy(update={"lidar": config.lidar.model_copy(update={"model": "livox"})})


def _open_kitti(path: Path, config_file: Path | None) -> Source:
    from d2lio.datasets.kitti import IMU_RATE_HZ, KittiReader, extrinsic

    if config_file is not None:
        config = SourceConfig.load(config_file)
    else:
        lidar = LidarSource(
            model="hdl64e", rings=64, min_range_m=2.0, max_range_m=120.0, synchronised=True
        )
        config = SourceConfig(
            name=path.name,
            T_imu_lidar=extrinsic().tolist(),
            lidar=lidar,
            imu=ImuSource(rate_hz=IMU_RATE_HZ),
        )
    truth = _beside(config, config_file) or _existing(path / KITTI_TRUTH)
    reader = KittiReader(path, orientation=config.imu.orientation is True)
    return Source(config.name or path.name, reader, config, truth)


def _open_ouster(path: Path, config_file: Path | None) -> Source:
    from d2lio.datasets.ouster import OusterReader

    reader = OusterReader(path)
    config = reader.config if config_file is None else SourceConfig.load(config_file)
    return Source(config.name or path.stem, reader, config, _beside(config, config_file))


def _beside(config: SourceConfig, config_file: Path | None) -> Path | None:
    if config.ground_truth is None or config_file is None:
        return None
    return _existing(config_file.parent / config.ground_truth)


def _existing(path: Path | None) -> Path | None:
    return path if path is not None and path.is_file() else None


__all__ = ["Source", "open_source"]
