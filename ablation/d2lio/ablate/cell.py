# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""One cell of an ablation: what is to be done, and what came out."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from d2lio.ablate.results import ResultRow, TimingRow
from d2lio.ablate.suite import Limits, Suite, SuiteSequence, Variant, slug

CELL_FILE = "cell.json"
LOG_FILE = "run.log"
TRUTH_FILE = "truth.tum"
RUNS = "runs"
FORM = 1  # of cell.json and of what is computed; another one makes cells run again


class CellSpec(BaseModel):
    """Everything that a run depends on, as handed to the process that does it.

    Attributes:
        directory: of the run's files, below the output directory.
        source: sequence directory or recording; where it lies does not matter to the result.
        origin: what the source is: the simulation's parameters, or names and sizes of files.
        config: for what is not a sequence directory (see `open_source`), empty for none; truth: TUM
            file instead of the source's own. `origin` tells their contents apart.
        scored: whether there is a truth to compare with.
        imported: TUM file instead of a run; `imported_hash` is its SHA-256.
        version: of this package; peer_version: of the package behind a peer.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    sequence: str
    repeat: int
    variant: str
    directory: str
    source: str
    origin: dict[str, Any]
    start_offset_s: float = 0.0
    config: str = ""
    truth: str = ""
    scored: bool = True
    host: str | None = None
    rejection: str | None = None
    degeneracy: str | None = None
    params: dict[str, str] = {}
    imported: str | None = None
    imported_hash: str = ""
    limits: Limits = Limits()
    threads: int = 1
    version: str
    peer_version: str = ""

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.sequence} r{self.repeat} {self.variant}"

    def digest(self) -> str:
        """SHA-256 of all that the result depends on; paths and names are left out."""
        unrelated = {"sequence", "repeat", "variant", "directory", "source", "imported"}
        unrelated |= {"config", "truth", "scored"}
        data = {"form": FORM} | self.model_dump(mode="json", exclude=unrelated)
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


class Scores(BaseModel):
    """What a rerun reproduces; see `ResultRow` for the meaning."""

    model_config = ConfigDict(extra="forbid")

    status: Literal["ok", "fail"]
    reason: str = ""
    coverage: float | None = None
    ate_m: float | None = None
    ate_percent: float | None = None
    rpe_10m_m: float | None = None
    rpe_rot_deg: float | None = None
    first_pose_ate_m: float | None = None
    end_error_m: float | None = None
    end_error_percent: float | None = None
    best_time_shift_s: float | None = None
    accepted_share: float | None = None
    lambda_t_min: float | None = None
    lambda_r_min: float | None = None
    scans_read: int | None = None
    scans_processed: int | None = None
    path_m: float | None = None
    duration_s: float | None = None

    def fail(self, reason: str) -> None:
        """Marks the run as failed; the first reason stays."""
        if self.status == "ok":
            self.status, self.reason = "fail", reason


class Costs(BaseModel):
    """What differs from machine to machine; see `TimingRow`. `process_s`: of the whole process."""

    model_config = ConfigDict(extra="forbid")

    process_s: float | None = None
    wall_s: float | None = None
    host_s: float | None = None
    read_s: float | None = None
    ms_per_scan_mean: float | None = None
    ms_per_scan_median: float | None = None
    ms_per_scan_p95: float | None = None
    stages: dict[str, float | None] = {}
    peak_memory_mb: float | None = None
    cpu: str = ""
    cores: int | None = None


class Outcome(BaseModel):
    """cell.json: a cell that was carried out, whatever came of it.

    Attributes:
        digest: of the specification it was carried out for.
        matched: names of the truth's and the estimate's file that evo compares.
        notes: of the reader and of the ground truth.
    """

    model_config = ConfigDict(extra="forbid")

    digest: str
    scores: Scores
    costs: Costs = Costs()
    matched: dict[str, str] = {}
    notes: list[str] = []


def run_directory(sequence: str, repeat: int, variant: str) -> str:
    """Where a cell's files lie below the output directory."""
    return f"{RUNS}/{slug(sequence)}/r{repeat}/{variant}"


def read_outcome(directory: Path) -> Outcome | None:
    """What cell.json says; None where it is missing or of another form."""
    try:
        text = (directory / CELL_FILE).read_text(encoding="utf-8")
        return Outcome.model_validate_json(text)
    except (OSError, UnicodeDecodeError, ValidationError):
        return None


def finished(out: Path, spec: CellSpec) -> Outcome | None:
    """The outcome of a cell that was carried out with just this specification, else None."""
    outcome = read_outcome(out / spec.directory)
    return outcome if outcome is not None and outcome.digest == spec.digest() else None


def result_row(suite: Suite, spec: CellSpec, scores: Scores) -> ResultRow:
    """The cell's line of results.csv."""
    sequence, variant = suite.sequence(spec.sequence), suite.variant(spec.variant)
    simulated = spec.origin.get("kind") == "simulated"
    return ResultRow(
        suite=suite.name,
        sequence=spec.sequence,
        dataset=sequence.dataset,
        scene=_of_simulation(sequence, "scene") if simulated else "",
        sensor=_of_simulation(sequence, "sensor") if simulated else "",
        repeat=spec.repeat,
        seed=spec.origin.get("seed"),
        start_offset_s=None if simulated else spec.start_offset_s,
        variant=spec.variant,
        variant_title=variant.label,
        group=variant.group,
        host=variant.host or "",
        rejection=variant.rejection or "",
        degeneracy=variant.degeneracy or "",
        params=json.dumps(variant.params, sort_keys=True),
        directory=spec.directory,
        version=spec.version,
        **scores.model_dump(),
    )


def timing_row(spec: CellSpec, costs: Costs) -> TimingRow:
    """The cell's line of timings.csv."""
    values = costs.model_dump(exclude={"process_s"})
    return TimingRow(sequence=spec.sequence, repeat=spec.repeat, variant=spec.variant, **values)


def _of_simulation(sequence: SuiteSequence, key: str) -> str:
    return "" if sequence.simulate is None else str(getattr(sequence.simulate, key))


def spec_of(variant: Variant, **facts: Any) -> CellSpec:
    """The specification of a variant on a source."""
    return CellSpec(
        variant=variant.id,
        host=variant.host,
        rejection=variant.rejection,
        degeneracy=variant.degeneracy,
        params=variant.params,
        **facts,
    )
