# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio bench: builds and runs every Google Benchmark binary, then the Python summary and a long
# simulated drive that shows whether memory stays bounded.

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
    "$VENV/bin/python" -m d2lio.bench_summary "${files[@]}" || die "$E_FAILED" 'the summary failed'
    say "driving ${D2LIO_BENCH_MINUTES:-30} simulated minutes (D2LIO_BENCH_MINUTES), about 3 minutes"
    exec "$VENV/bin/python" -m d2lio.bench_drive --minutes "${D2LIO_BENCH_MINUTES:-30}" \
        --out "$results/drive.json"
}
