# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio test: ctest over a preset's GoogleTest binaries, pytest over the Python tests, one sum.

# Leaks count; a sanitizer report must fail its test, not only be printed.
export ASAN_OPTIONS=${ASAN_OPTIONS:-detect_leaks=1:strict_string_checks=1}
export UBSAN_OPTIONS=${UBSAN_OPTIONS:-halt_on_error=1:print_stacktrace=1}

build_preset() { # PRESET
    local log=build-$1
    take_lock
    need_free_space
    run_logged "$log" cmake --preset "$1" "${GTSAM_ARGUMENTS[@]}" ||
        die_with_log "$E_BUILD" "$log" "configuring the C++ code ($1) failed"
    say "building the C++ code ($1)"
    run_logged "$log" cmake --build --preset "$1" -j "${D2LIO_JOBS:-$(jobs_default)}" ||
        die_with_log "$E_BUILD" "$log" "building the C++ code ($1) failed"
    drop_lock
}

run_ctest() { # PRESET REPORTS
    GTEST_OUTPUT="xml:$2/gtest/" GTEST_BRIEF=1 ctest --preset "$1" \
        -j "${D2LIO_JOBS:-$(jobs_default)}" --output-junit "$2/ctest.xml" || true
}

run_pytest() { # REPORTS ARGUMENTS...
    local reports=$1 status=0
    shift
    "$VENV/bin/python" -m pytest --junit-xml="$reports/pytest.xml" "$@" || status=$?
    echo "$status" >"$reports/pytest.status"
}

cmd_test() {
    local cpp=1 python=1 preset=release
    if [[ ${1:-} == --ros ]]; then
        shift
        [[ ${1:-} == -- ]] && shift
        test_ros "$@"
        return
    fi
    while (($#)); do
        case $1 in
            --cpp) python=0 ;;
            --python) cpp=0 ;;
            --sanitize) preset=sanitize python=0 ;;
            --) shift && break ;;
            *) die "$E_USAGE" "test: unknown option '$1' (--cpp, --python, --sanitize, --ros, -- PYTEST ARGUMENTS)" ;;
        esac
        shift
    done
    ((cpp || python)) || die "$E_USAGE" 'test: --cpp and --python exclude each other'

    cd -- "$ROOT" # presets and test paths are the checkout's
    ((cpp)) && SYSTEM_PACKAGES+=(libgtest-dev)
    ((python)) && SYSTEM_PACKAGES+=("${TEST_PACKAGES[@]}")
    if ((python)); then setup_python; else setup_system; fi

    local reports="$REPORT_DIR/$preset"
    exec 8>"$BUILD/.test.lock"
    flock -n 8 || { say 'd2lio: other tests run in this checkout; waiting for them' && flock 8; }
    rm -rf -- "$reports" && mkdir -p "$reports/gtest"
    if ((cpp)); then
        build_preset "$preset"
        run_ctest "$preset" "$reports"
    fi
    if ((python)); then
        run_pytest "$reports" "$@"
    fi
    local parts=()
    ((cpp)) && parts+=(--ctest)
    ((python)) && parts+=(--pytest)
    [[ -z $gtsam_left_out ]] || parts+=(--left-out "LIO-SAM host: $gtsam_left_out")
    exec "$PYTHON" "$ROOT/tools/door/summary.py" "$reports" "${parts[@]}"
}
