# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio lint: every linter over the checkout; each counts as one check.

lint_passed=0 lint_failed=0 lint_skipped=0

check() { # NAME COMMAND...
    local name=$1
    shift
    if "$@"; then
        say "ok      $name"
        lint_passed=$((lint_passed + 1))
    else
        say "FAILED  $name"
        lint_failed=$((lint_failed + 1))
    fi
}

cmd_lint() {
    (($# == 0)) || die "$E_USAGE" "lint: takes no argument, got '$1'"
    setup_python
    cd -- "$ROOT"
    local cpp bin="$VENV/bin"
    mapfile -d '' -t cpp < <(find . \( -path ./build -o -path ./.venv -o -path ./results \) -prune \
        -o -type f \( -name '*.hpp' -o -name '*.h' -o -name '*.cpp' \) -print0)
    check clang-format "$bin/clang-format" --dry-run -Werror "${cpp[@]}"
    check 'ruff check' "$bin/ruff" check --quiet .
    check 'ruff format' "$bin/ruff" format --quiet --check .
    check codespell "$bin/codespell"
    check 'vermin (Python 3.8: the patch tool, and what ROS runs)' "$bin/vermin" --quiet --no-tips \
        -t=3.8- patches/tool ros/d2lio_compare ablation/d2lio/compare/shared
    if command -v shellcheck >/dev/null; then
        check shellcheck shellcheck -x -a d2lio tools/door/build_gtsam.sh .ci/run
    else
        say 'skipped shellcheck (not installed)'
        lint_skipped=1
    fi
    mkdir -p "$REPORT_DIR/lint"
    echo "$lint_passed $lint_failed $lint_skipped" >"$REPORT_DIR/lint/counts"
    ((lint_failed == 0)) || die "$E_FAILED" "$lint_failed linter(s) found faults"
}
