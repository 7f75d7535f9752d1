# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Models of the files a run leaves behind."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from d2lio.errors import DataError

RUN_FILE = "run.json"
TRAJECTORY_FILE = "trajectory.tum"
DIAGNOSTICS_FILE = "diagnostics.csv"

RunStatus = Literal["complete", "diverged", "failed", "interrupted"]


class StageTime(BaseModel):
    """Time of one stage per scan that gave a pose, ms."""

    mean: float
    median: float
    p95: float
    max: float


class ScanCounts(BaseModel):
    """Where the scans went. `dropped` is by reason and sums to read - processed."""

    read: int = 0
    processed: int = 0
    dropped: dict[str, int] = {}


class RunRecord(BaseModel):
    """run.json.

    Attributes:
        status: complete, diverged (poses no longer finite or plausible), failed, interrupted.
        start_offset_s: how much later than its first message the recording was begun;
            start_stamp_ns: that moment, None without an offset.
        wall_s: whole run; read_s: reading and decoding; host_s: inside the estimator.
        accepted_share: accepted / offered correspondences over all scans.
        inputs_hash: SHA-256 over the names of the input files.
    """

    model_config = ConfigDict(extra="forbid")

    status: RunStatus
    reason: str = ""
    version: str
    command: list[str]
    sequence: str
    host: str
    params: dict[str, str]
    threads: int
    start_offset_s: float = 0.0
    start_stamp_ns: int | None = None
    scans: ScanCounts
    imu_read: int = 0
    health: dict[str, int] = {}
    scan_status: dict[str, int] = {}
    host_counts: dict[str, int] = {}
    accepted_share: float | None = None
    time_ms: dict[str, StageTime] = {}
    wall_s: float = 0.0
    read_s: float = 0.0
    host_s: float = 0.0
    peak_memory_mb: float = 0.0
    path_m: float = 0.0
    duration_s: float = 0.0
    ground_truth: str | None = None
    notes: list[str] = []
    inputs: list[str] = []
    inputs_hash: str = ""

    @classmethod
    def load(cls, directory: Path) -> RunRecord:
        """Reads run.json of a run's directory.

        Raises:
            DataError: missing or not such a record.
        """
        file = directory / RUN_FILE
        try:
            return cls.model_validate_json(file.read_text(encoding="utf-8"))
        except OSError as err:
            raise DataError(f"{file}: {err.strerror}") from None
        except ValidationError as err:
            raise DataError(f"{file}: not a run record: {err.errors()[0]['msg']}") from None

    def save(self, directory: Path) -> None:
        """Writes run.json."""
        text = self.model_dump_json(indent=2) + "\n"
        (directory / RUN_FILE).write_text(text, encoding="utf-8")
