# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Files of a run: written beside their place, moved there when they are whole."""

from __future__ import annotations

import csv
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

import numpy as np
from scipy.spatial.transform import Rotation

from d2lio.datasets.timing import seconds
from d2lio.errors import DataError
from d2lio.record import DIAGNOSTICS_FILE, RUN_FILE, TRAJECTORY_FILE

PARTIAL_SUFFIX = ".partial"


def tum_line(stamp: int, pose: np.ndarray) -> str:
    """`t x y z qx qy qz qw`, nine decimals of time, every other number in full precision.

    Args:
        stamp: ns.
        pose: float64 [4, 4]; numbers that are not finite are written as nan.
    """
    position = pose[:3, 3]
    if np.isfinite(pose).all():
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    else:
        quaternion = np.full(4, np.nan)
    values = (repr(float(v)) for v in (*position, *quaternion))
    return f"{seconds(stamp)} {' '.join(values)}\n"


class OutputDir:
    """A directory that appears under its name only when complete.

    As a context manager: `commit` moves it into place, `keep_partial` leaves it as
    NAME.partial; without either it is removed.

    Raises:
        DataError: the target holds something that is not an earlier run, or cannot be written.
    """

    def __init__(self, target: Path) -> None:
        self.target = target
        if target.exists() and not _is_run(target):
            raise DataError(f"{target}: exists and is not a run; choose another --out")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            self.path = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
            self.path.chmod(0o755)
        except OSError as err:
            raise DataError(f"{target}: cannot be written: {err.strerror}") from None

    def __enter__(self) -> OutputDir:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        shutil.rmtree(self.path, ignore_errors=True)

    def commit(self) -> Path:
        """Moves the directory into place, replacing an earlier run and its partial."""
        return self._move(self.target)

    def keep_partial(self) -> Path:
        """Moves it to NAME.partial; an earlier complete run stays untouched."""
        return self._move(self.target.with_name(self.target.name + PARTIAL_SUFFIX))

    def _move(self, place: Path) -> Path:
        try:
            if place.exists():
                shutil.rmtree(place)
            os.replace(self.path, place)
        except OSError as err:
            raise DataError(f"{place}: cannot be written: {err.strerror}") from None
        if place == self.target:
            stale = place.with_name(place.name + PARTIAL_SUFFIX)
            shutil.rmtree(stale, ignore_errors=True)
        return place


def _is_run(path: Path) -> bool:
    return path.is_dir() and ((path / RUN_FILE).exists() or not any(path.iterdir()))


class ResultWriter:
    """Streams poses and diagnostics into a run's directory; close it before moving that."""

    def __init__(self, directory: Path) -> None:
        self._tum = (directory / TRAJECTORY_FILE).open("w", encoding="utf-8")
        self._csv_file = (directory / DIAGNOSTICS_FILE).open("w", encoding="utf-8", newline="")
        self._csv: csv.DictWriter[str] | None = None

    def add(self, stamp: int, pose: np.ndarray, diagnostics: dict[str, float | int | str]) -> None:
        """Appends one scan. `stamp` in ns, `pose` T_map_imu [4, 4]."""
        self._tum.write(tum_line(stamp, pose))
        self.add_row(diagnostics)

    def add_row(self, diagnostics: dict[str, float | int | str]) -> None:
        """Appends a row of diagnostics only (a scan that gave no pose)."""
        if self._csv is None:
            self._csv = csv.DictWriter(
                self._csv_file, list(diagnostics), extrasaction="ignore", lineterminator="\n"
            )
            self._csv.writeheader()
        self._csv.writerow(diagnostics)

    def close(self) -> None:
        """Flushes both files; a full disk shows here at the latest."""
        self._tum.close()
        self._csv_file.close()


def replace_file(path: Path, content: str | bytes) -> None:
    """Writes a file in one go: it is the former one or whole, whatever happens.

    Raises:
        OSError: cannot be written; nothing is left of the attempt.
    """
    partial = path.with_name(f".{path.name}.tmp")
    try:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
        os.replace(partial, path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def write_tum(path: Path, lines: Iterable[str]) -> None:
    """Writes a TUM file in one go.

    Raises:
        DataError: cannot be written.
    """
    try:
        replace_file(path, "".join(lines))
    except OSError as err:
        raise DataError(f"{path}: cannot be written: {err.strerror}") from None
