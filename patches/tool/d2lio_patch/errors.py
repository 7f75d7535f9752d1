# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How a call ends when nothing may be touched."""

E_USAGE = 2
E_DISK = 13
E_HOST = 20
E_ANCHOR = 21
E_DIRTY = 22
E_PENDING = 23
E_IO = 24
E_INTERRUPTED = 130


class PatchError(Exception):
    """A refusal: the checkout is as it was before the call.

    Args:
        code: the exit code.
        message: one line or more, for the user.
    """

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code
