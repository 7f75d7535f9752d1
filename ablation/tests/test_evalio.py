# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Our hosts and sequences through evalio's own command.

evalio need not be installed beside d2lio; that of `d2lio peers install evalio-dlio` does.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import d2lio
import numpy as np
import pytest
from built import host_params
from d2lio.datasets import open_source
from d2lio.errors import DataError
from d2lio.hosts import liosam_missing
from d2lio.metrics import read_tum
from d2lio.peers import PEERS
from d2lio.peers.environments import interpreter
from d2lio.runner import RunOptions, run
from d2lio.simulator import simulate

SAME_POSE = 1e-9  # evalio turns rotations into quaternions its own way
COMMAND = "from evalio.cli import app; app()"
NAMES = {"fastlio": "d2lio_fastlio", "liosam": "d2lio_liosam", "d2lio": "d2lio"}
PIPELINES = (
    "from evalio.pipelines import all_pipelines; from evalio.datasets import all_datasets; "
    "print(*sorted(n for n in all_pipelines() if 'd2lio' in n)); "
    "print(*sorted(n for n in all_datasets() if 'd2lio' in n or 'equence' in n))"
)


@pytest.fixture(scope="module")
def python() -> str:
    """An interpreter with evalio that can load our modules."""
    if find_spec("evalio") is not None:
        return sys.executable
    try:
        found = interpreter(PEERS["evalio-dlio"])
    except DataError as err:
        pytest.skip(str(err))
    code = "import sys; print(*sys.version_info[:2])"
    said = subprocess.run([found, "-c", code], capture_output=True, text=True, check=True)
    if tuple(map(int, said.stdout.split())) != sys.version_info[:2]:
        pytest.skip(f"{found} is another Python than this one")
    return str(found)


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequences")
    simulate("room", folder / "room-4", seed=0, duration=4.0)
    return folder


def evalio(python: str, sequences: Path, *arguments: str, code: str = COMMAND) -> str:
    packages = [str(Path(d2lio.__file__).parents[1])]
    if python != sys.executable:
        packages += [path for path in sys.path if path.endswith("site-packages")]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(packages),
        "EVALIO_CUSTOM": "d2lio.evalio",
        "D2LIO_SEQUENCES": str(sequences),
    }
    done = subprocess.run(
        [python, "-c", code, *arguments], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_plug_in_registers_what_it_should(python: str, sequences: Path) -> None:
    built = [n for host, n in NAMES.items() if host == "fastlio" or liosam_missing() is None]
    said = evalio(python, sequences, code=PIPELINES).splitlines()
    assert said[-2].split() == sorted(built)
    assert said[-1] == "d2lio"


@pytest.mark.parametrize("host", host_params())
def test_the_same_trajectory_as_our_own_run(
    host: str, python: str, sequences: Path, tmp_path: Path
) -> None:
    out = tmp_path / "evalio"
    evalio(
        python, sequences, "run", "-d", "d2lio/room-4", "-p", NAMES[host], "-o", str(out)
    )  # fmt: skip
    run(open_source(sequences / "room-4"), RunOptions(host=host), tmp_path / "own")
    ours = read_tum(tmp_path / "own" / "trajectory.tum")
    theirs = read_tum(out / "d2lio" / "room-4" / f"{NAMES[host]}.csv")
    assert len(ours) > 15
    np.testing.assert_array_equal(theirs.stamps, ours.stamps)
    np.testing.assert_allclose(theirs.positions, ours.positions, rtol=0, atol=SAME_POSE)
    sign = np.sign((theirs.quaternions * ours.quaternions).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(sign * theirs.quaternions, ours.quaternions, rtol=0, atol=SAME_POSE)
