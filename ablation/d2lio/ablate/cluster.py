# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The cells of an ablation as tasks of a Dask cluster with a shared file system."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

from d2lio import __version__
from d2lio.errors import DataError

if TYPE_CHECKING:
    from distributed import Client

SLOTS_AGE_S = 2.0  # workers come and go; they are counted this often
CONNECT_S = 30.0
PROBE = ".probe"


class DaskPool:
    """Workers of a cluster; each of their threads runs one job.

    The cluster runs the jobs of a worker that dies on others. What such a worker left unfinished
    lies in scratch directories that nobody reads.

    Raises:
        DataError: no such scheduler, no workers, another version of this package there, or workers
            that do not see `out`.
    """

    def __init__(self, address: str, out: Path) -> None:
        from distributed import Client

        try:
            self._client: Client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as err:
            raise DataError(f"{address}: no Dask scheduler answers there: {err}") from None
        try:
            _check_workers(self._client, out)
            self._executor = self._client.get_executor(pure=False)
        except BaseException:
            self._client.close()
            raise
        self._counted, self._slots = -SLOTS_AGE_S, 0

    @property
    def slots(self) -> int:
        """Threads of all workers, now."""
        if time.monotonic() - self._counted > SLOTS_AGE_S:
            self._counted = time.monotonic()
            self._slots = sum(self._client.nthreads().values())
        return self._slots

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Starts a task."""
        return self._executor.submit(function, *arguments)

    def close(self) -> None:
        """Takes back what has not begun; what runs ends by itself and is kept."""
        self._executor.shutdown(wait=False)
        self._client.close()


def look(file: str) -> tuple[str, str]:
    """On a worker: its version of this package, and what it reads in a file."""
    try:
        return __version__, Path(file).read_text(encoding="utf-8")
    except OSError as err:
        return __version__, f"cannot be read: {err}"


def _check_workers(client: Client, out: Path) -> None:
    token = secrets.token_hex(8)
    probe = out / f"{PROBE}-{token}"
    probe.write_text(token, encoding="utf-8")
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
        answers = client.run(look, str(probe), on_error="return")
    except TimeoutError:
        raise DataError(f"the Dask cluster has no workers after {CONNECT_S:g} s") from None
    finally:
        probe.unlink(missing_ok=True)
    for worker, answer in answers.items():
        if isinstance(answer, BaseException):
            raise DataError(f"worker {worker}: d2lio does not run there: {answer}")
        version, text = answer
        if version != __version__:
            raise DataError(f"worker {worker} has d2lio {version}, here is {__version__}")
        if text != token:
            raise DataError(
                f"worker {worker} does not see {out}; --out must lie on a file system that all "
                f"workers share under the same path"
            )
