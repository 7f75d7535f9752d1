# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# Messages, logged commands, stamps and the lock of the front door. Sourced by ./d2lio.

readonly BUILD="$ROOT/build"
readonly LOG_DIR="$BUILD/log"
readonly STAMP_DIR="$BUILD/.stamps"
readonly REPORT_DIR="$BUILD/reports"
readonly VENV="$ROOT/.venv"

readonly E_FAILED=1 E_USAGE=2 E_SYSTEM=10 E_ROOT=11 E_DOWNLOAD=12 E_DISK=13 E_TOOL=14 E_BUILD=15
readonly E_INTERRUPTED=130
readonly MIN_FREE_MIB=2048

# A PYTHONPATH meant for another Python (ROS sets one) must not leak into the virtual environment.
unset PYTHONPATH PYTHONHOME
export PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1
# Foreign stray bytes in a path or log must not stop grep, sort and friends.
export LC_ALL=C.UTF-8

child=
step_total=0

say() { printf '%s\n' "$*" >&2; }

die() { # CODE MESSAGE
    printf 'd2lio: %s\n' "$2" >&2
    exit "$1"
}

step() { say "[$1/$step_total] $2"; } # NUMBER TEXT

on_signal() {
    trap - INT TERM HUP
    if [[ -n $child ]]; then
        kill -TERM -- "-$child" 2>/dev/null || true
        wait "$child" 2>/dev/null || true
    fi
    die "$E_INTERRUPTED" 'interrupted; the next call takes up where this one stopped'
}
trap on_signal INT TERM HUP

# run_logged NAME COMMAND...: COMMAND's output goes to build/log/NAME.log; returns its status.
# The command gets its own process group so that a signal can end all of it at once.
run_logged() {
    local log="$LOG_DIR/$1.log" status=0
    shift
    setsid "$@" >"$log" 2>&1 </dev/null &
    child=$!
    wait "$child" || status=$?
    child=
    return "$status"
}

# telling_line LOG: the compiler's or CMake's first complaint (with the line that follows, where
# CMake puts the reason), else why pip lost its connection (it then claims that there is no such
# package), else the last error of apt or pip, else the last line.
telling_line() {
    awk '
        first == "" && /: (fatal )?error: / { first = $0 }
        first == "" && /CMake Error/ { first = $0; if (getline > 0) first = first " " $0 }
        match($0, /connection broken by .*/) { connection = substr($0, RSTART, RLENGTH) }
        /^[[:space:]]*(ERROR|E|error|fatal|dpkg: error[^:]*): / { last_error = $0 }
        NF { last = $0 }
        END {
            line = last
            if (last_error != "") line = last_error
            if (connection != "") line = connection
            if (first != "") line = first
            gsub(/[[:space:]]+/, " ", line); sub(/^ /, "", line)
            print line == "" ? "no output" : substr(line, 1, 300)
        }' "$1"
}

# die_with_log CODE NAME WHAT: ends with WHAT, the telling line of the log, and where the log is.
# A full disk is told apart, whatever step met it.
die_with_log() {
    local code=$1 log="$LOG_DIR/$2.log"
    if grep -qiE 'no space left on device|errno 28|enough free space|disk quota exceeded' "$log"; then
        die "$E_DISK" "$3: the disk is full (log: $log)"
    fi
    die "$code" "$3: $(telling_line "$log") (log: $log)"
}

make_dirs() { # PATH...
    local why
    if ! why=$(mkdir -p -- "$@" 2>&1); then
        [[ $why == *'No space left'* ]] && die "$E_DISK" "the disk is full: $why"
        die "$E_FAILED" "cannot make a folder: $why"
    fi
}

need_free_space() { # [FOLDER MIB]
    local folder=${1:-$ROOT} needed=${2:-$MIN_FREE_MIB} free
    free=$(df -Pk -- "$folder" | awk 'NR == 2 {print $4}')
    if [[ $free =~ ^[0-9]+$ ]] && ((free < needed * 1024)); then
        die "$E_DISK" "the disk is full: $((free / 1024)) MiB free at $folder, set-up needs $needed MiB"
    fi
}

# fingerprint TEXT PATH...: one hash of TEXT and of the names and contents of all files under the
# paths (relative to the checkout; missing ones are left out).
fingerprint() {
    local text=$1 path paths=()
    shift
    for path in "$@"; do
        [[ -e $ROOT/$path ]] && paths+=("$path")
    done
    {
        printf '%s\n' "$text"
        cd -- "$ROOT"
        find "${paths[@]}" -type f ! -path '*/__pycache__/*' -print0 | sort -z | xargs -0r sha256sum
    } | sha256sum | cut -d ' ' -f 1
}

stamp_is() { # NAME FINGERPRINT
    [[ -f $STAMP_DIR/$1 && $(<"$STAMP_DIR/$1") == "$2" ]]
}

write_stamp() { # NAME FINGERPRINT; atomic: a stamp is whole or absent
    { printf '%s\n' "$2" >"$STAMP_DIR/$1.$$" && mv -f -- "$STAMP_DIR/$1.$$" "$STAMP_DIR/$1"; } ||
        die "$E_DISK" "cannot write $STAMP_DIR/$1; is the disk full?"
}

# The lock is held by every process of the step, so that a killed ./d2lio whose pip still works
# keeps the next call waiting.
take_lock() {
    exec 9>"$BUILD/.lock"
    flock -n 9 && return
    say 'd2lio: another ./d2lio is at work in this checkout; waiting for it'
    flock 9
}

drop_lock() { exec 9>&-; }

jobs_default() {
    local cores memory_kib
    cores=$(nproc)
    memory_kib=$(awk '/^MemTotal/ {print $2}' /proc/meminfo)
    local by_memory=$((memory_kib / (2 * 1024 * 1024)))
    ((by_memory < 1)) && by_memory=1
    echo $((cores < by_memory ? cores : by_memory))
}
