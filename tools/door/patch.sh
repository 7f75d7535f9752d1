# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio patch: hooks into a FAST_LIO or LIO-SAM checkout. Needs Python alone: no set-up, no build.

cmd_patch() {
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 8))' 2>/dev/null ||
        die "$E_SYSTEM" "patch: $PYTHON is missing or older than Python 3.8; name another with D2LIO_PYTHON=PATH"
    trap - INT TERM HUP
    exec "$PYTHON" -I -B "$ROOT/patches/tool" "$@"
}
