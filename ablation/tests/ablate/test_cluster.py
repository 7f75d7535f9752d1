# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Whether the workers of a cluster can be used; machines that are at fault, not the run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from d2lio import __version__
from d2lio.ablate import cluster
from d2lio.ablate.cell import CellSpec
from d2lio.ablate.execute import Ended, NotCarriedOutError, _outcome
from d2lio.errors import DataError

SPEC = CellSpec(
    sequence="a", repeat=0, variant="v", directory="d", source="s", origin={}, version="0"
)


class FakeClient:
    """Answers for one worker; `answer` gets the probe file."""

    def __init__(self, answer: Any) -> None:
        self._answer = answer

    def wait_for_workers(self, count: int, timeout: float) -> None:
        if self._answer is None:
            raise TimeoutError

    def run(self, function: Any, file: str, on_error: str) -> dict[str, Any]:
        assert function is cluster.look
        answer = self._answer
        return {"tcp://w:1": answer(file) if callable(answer) else answer}


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (None, "no workers"),
        (lambda file: (__version__, "cannot be read: gone"), "does not see"),
        (lambda file: ("0.0.1", Path(file).read_text()), "has d2lio 0.0.1"),
        (ModuleNotFoundError("No module named 'd2lio'"), "does not run there"),
    ],
)
def test_unusable_workers_are_refused(tmp_path: Path, answer: Any, said: str) -> None:
    with pytest.raises(DataError, match=said):
        cluster._check_workers(FakeClient(answer), tmp_path)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_workers_that_see_the_directory_are_taken(tmp_path: Path) -> None:
    cluster._check_workers(FakeClient(cluster.look), tmp_path)  # type: ignore[arg-type]
    assert cluster.look(str(tmp_path / "nowhere"))[1].startswith("cannot be read")


def test_a_full_disk_is_no_result(tmp_path: Path) -> None:
    reason = f"{tmp_path}/run: cannot be written: No space left on device"
    (tmp_path / "error.json").write_text(json.dumps({"reason": reason}))
    with pytest.raises(NotCarriedOutError, match="No space left"):
        _outcome(SPEC, tmp_path, Ended(3, "", 1.0, 10.0))


def test_reasons_do_not_name_the_working_directory(tmp_path: Path) -> None:
    (tmp_path / "error.json").write_text(json.dumps({"reason": f"{tmp_path}/run: bad"}))
    outcome = _outcome(SPEC, tmp_path, Ended(3, "", 1.0, 10.0))
    assert outcome.scores.reason == "run: bad"
    assert (outcome.costs.process_s, outcome.costs.peak_memory_mb) == (1.0, 10.0)
