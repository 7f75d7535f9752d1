# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio bench: builds and runs every Google Benchmark binary, then the Python summary.

cmd_bench() {
    cd -- "$ROOT" # presets are the checkout's
    SYSTEM_PACKAGES+=(libbenchmark-dev)
    setup_python
    build_preset bench
    local results="$BUILD/bench/results" binary files=()
    rm -rf -- "$results" && mkdir -p "$results"
    while IFS= read -r -d '' binary; do
        files+=("$results/$(basename -- "$binary").json")
        "$binary" --benchmark_out="${files[-1]}" --benchmark_out_format=json "$@" ||
            die "$E_FAILED" "$(basename -- "$binary") failed"
    done < <(find "$BUILD/bench" -path "$results" -prune -o -type f -name 'bench_*' -perm -u+x -print0 | sort -z)
    ((${#files[@]})) || die "$E_FAILED" 'no benchmark was built'
    say "results: $results"
    if "$VENV/bin/python" -c 'import importlib.util, sys; sys.exit(importlib.util.find_spec("d2lio.bench_summary") is None)'; then
        exec "$VENV/bin/python" -m d2lio.bench_summary "${files[@]}"
    fi
}
