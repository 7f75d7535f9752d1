# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# Set-up in five steps: system packages, GTSAM, virtual environment, Python packages, the d2lio
# package.
# Each step does nothing when its inputs are unchanged, and can be interrupted at any moment.

readonly PYTHON=${D2LIO_PYTHON:-/usr/bin/python3}
readonly DIRTY="$STAMP_DIR/venv.dirty"
SYSTEM_PACKAGES=(build-essential cmake ninja-build libeigen3-dev libtbb-dev python3-venv python3-dev)
# What the Python tests need beside these: ouster-sdk is linked to libGL, even where nothing is
# drawn; reports are opened in a browser, and without a font their texts have no width.
TEST_PACKAGES=(libgl1)
[[ ${D2LIO_SKIP_BROWSER:-0} == 1 ]] || TEST_PACKAGES+=(chromium chromium-driver fonts-dejavu-core)

# What the installed package is made of. Tests and benchmarks are not part of it.
readonly PACKAGE_INPUTS=(
    pyproject.toml README.md LICENSE CMakeLists.txt cmake ablation/d2lio
    common/CMakeLists.txt common/include common/src common/python
    fastlio_plugin/CMakeLists.txt fastlio_plugin/adapter fastlio_plugin/host fastlio_plugin/python
    liosam_plugin/CMakeLists.txt liosam_plugin/adapter liosam_plugin/host liosam_plugin/python
    liosam_plugin/config
)

offline() { [[ ${D2LIO_OFFLINE:-0} == 1 ]]; }

check_system() {
    offline && return
    local os_release=${D2LIO_OS_RELEASE:-/etc/os-release} about
    # shellcheck source=/dev/null
    about=$(. "$os_release" 2>/dev/null && echo "${ID:-} ${ID_LIKE:-}|${PRETTY_NAME:-unknown}") || about='|unknown'
    if [[ " ${about%%|*} " != *' debian '* ]] || ! command -v apt-get >/dev/null; then
        die "$E_SYSTEM" "unsupported system (${about#*|}): needs Debian 12 or 13 (or a derivative), \
or D2LIO_OFFLINE=1 with everything installed"
    fi
}

# installed_packages NAME...: "NAME VERSION" of those of them that are installed.
installed_packages() {
    # dpkg-query fails where it knows one of the names not; what it prints about the others counts.
    { dpkg-query -W -f '${Package} ${db:Status-Abbrev} ${Version}\n' "$@" || true; } 2>/dev/null |
        awk '$2 == "ii" {print $1, $3}'
}

missing_packages() {
    command -v dpkg-query >/dev/null || return 0 # another system, with D2LIO_OFFLINE
    local wanted=("${SYSTEM_PACKAGES[@]}" "${GTSAM_PACKAGES[@]}") installed package
    installed=$'\n'$(installed_packages "${wanted[@]}")
    for package in "${wanted[@]}"; do
        [[ $installed == *$'\n'"$package "* ]] || echo "$package"
    done
}

# What runs a command as root; fails where nothing can.
as_root=()
become_root() {
    [[ $(id -u) == 0 ]] && return
    as_root=(sudo)
    [[ -t 0 ]] || as_root=(sudo -n) # nobody there to type a password
    "${as_root[@]}" true 2>/dev/null
}

apt_install() { # PACKAGE...
    local apt_options=(-o 'DPkg::Lock::Timeout=300' -o 'Acquire::Retries=2')
    become_root || die "$E_ROOT" "system packages are missing and installing them needs root; \
run this once as root: apt-get install $*"
    # In the foreground: dpkg must not be cut off in the middle of a package.
    local run=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive) log="$LOG_DIR/apt.log"
    {
        "${run[@]}" dpkg --configure -a # finishes what an interrupted earlier call left
        "${run[@]}" apt-get "${apt_options[@]}" update || true
        "${run[@]}" apt-get "${apt_options[@]}" install -y --no-install-recommends "$@"
    } >"$log" 2>&1 </dev/null || die_with_log "$E_DOWNLOAD" apt 'installing system packages failed'
}

install_system_packages() {
    local missing tool
    mapfile -t missing < <(missing_packages)
    if ((${#missing[@]})); then
        offline && die "$E_DOWNLOAD" "D2LIO_OFFLINE is set and system packages are missing: ${missing[*]}"
        need_free_space
        step 1 "system packages: ${missing[*]}"
        apt_install "${missing[@]}"
    fi
    for tool in c++ cmake ninja; do
        command -v "$tool" >/dev/null ||
            die "$E_TOOL" "no '$tool' on PATH; a C++17 compiler, cmake and ninja are needed"
    done
}

# The environment's own path is in its scripts, so a moved checkout needs a new one.
venv_fingerprint() {
    printf '%s %s' "$ROOT" "$("$PYTHON" -c 'import sys; print(sys.version)' 2>/dev/null || true)"
}

venv_works() {
    [[ ! -e $DIRTY ]] && "$VENV/bin/python" - "$VENV" <<'PY' >/dev/null 2>&1
import os, sys
import pip
sys.exit(not (sys.version_info >= (3, 11) and os.path.realpath(sys.prefix) == os.path.realpath(sys.argv[1])))
PY
}

make_venv() { # FINGERPRINT
    if ! venv_works; then
        "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null ||
            die "$E_SYSTEM" "unsupported system: $PYTHON is missing or older than Python 3.11"
        need_free_space
        step 3 'Python environment (.venv)'
        run_logged venv "$PYTHON" -m venv --clear "$VENV" ||
            die_with_log "$E_FAILED" venv 'creating .venv failed'
        rm -f -- "$DIRTY"
    fi
    write_stamp venv "$1"
}

install_requirements() { # FINGERPRINT
    local lists=("$BUILD/requirements.txt" "$BUILD/requirements-no-deps.txt") missing status=0
    local pip=("$VENV/bin/python" -m pip install --no-input --progress-bar off)
    local reader=("$VENV/bin/python" "$ROOT/tools/door/requirements.py")
    {
        "${reader[@]}" "$ROOT/pyproject.toml" eval test dev >"${lists[0]}" &&
            "${reader[@]}" --no-deps "$ROOT/pyproject.toml" >"${lists[1]}"
    } 2>"$LOG_DIR/pip.log" || die_with_log "$E_FAILED" pip 'reading pyproject.toml failed'
    missing=$("${reader[@]}" --missing "${lists[@]}")
    if [[ -n $missing ]]; then
        offline && die "$E_DOWNLOAD" "D2LIO_OFFLINE is set and Python packages are missing: ${missing//$'\n'/, }"
        need_free_space
        step 4 "Python packages ($(wc -l <<<"$missing") missing)"
        # A pip killed while it unpacks leaves packages that look whole: the marker makes the next
        # call start with a clean environment. A pip that failed while downloading left nothing.
        : >"$DIRTY"
        { run_logged pip "${pip[@]}" -r "${lists[0]}" &&
            run_logged pip "${pip[@]}" --no-deps -r "${lists[1]}"; } || status=$?
        if ((status)); then
            grep -q '^Installing collected packages' "$LOG_DIR/pip.log" || rm -f -- "$DIRTY"
            die_with_log "$E_DOWNLOAD" pip 'installing Python packages failed'
        fi
        rm -f -- "$DIRTY"
    fi
    write_stamp requirements "$1"
}

install_package() { # FINGERPRINT
    need_free_space
    step 5 'building and installing the d2lio package'
    local cmake_arguments
    printf -v cmake_arguments '%s;' "${GTSAM_ARGUMENTS[@]}"
    CMAKE_BUILD_PARALLEL_LEVEL=${D2LIO_JOBS:-$(jobs_default)} \
        run_logged package "$VENV/bin/python" -m pip install --no-input --no-index --no-deps \
        --no-build-isolation --force-reinstall "--config-settings=build-dir=$BUILD/python" \
        "--config-settings=cmake.args=${cmake_arguments%;}" "$ROOT" ||
        die_with_log "$E_BUILD" package 'building the d2lio package failed'
    write_stamp package "$1"
}

use_ccache() {
    if command -v ccache >/dev/null; then
        export CMAKE_CXX_COMPILER_LAUNCHER=ccache
        # One cache serves every checkout, whatever its path.
        export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$ROOT} CCACHE_NOHASHDIR=${CCACHE_NOHASHDIR:-1}
    fi
}

# start_setup TOTAL: what is found out before the first step.
start_setup() {
    step_total=$1
    make_dirs "$LOG_DIR" "$STAMP_DIR" "$REPORT_DIR"
    check_system
    use_ccache
    choose_gtsam
}

# setup_system: the first two steps alone, for verbs that need no Python package.
setup_system() {
    start_setup 2
    take_lock
    install_system_packages
    install_gtsam
    drop_lock
    use_gtsam
}

compute_fingerprints() {
    venv_print=$(venv_fingerprint)
    requirements_print=$(fingerprint "$venv_print" pyproject.toml tools/door/requirements.py)
    package_print=$(fingerprint "$requirements_print $(gtsam_print)" "${PACKAGE_INPUTS[@]}")
}

# setup_python: all five steps; nothing but a few hashes when nothing changed.
setup_python() {
    start_setup 5
    local venv_print requirements_print package_print
    compute_fingerprints
    if stamp_is package "$package_print" && [[ ! -e $DIRTY && -x $VENV/bin/d2lio ]] &&
        [[ -z $(missing_packages) ]] && gtsam_is_there; then
        use_gtsam
        return
    fi
    take_lock
    install_system_packages
    install_gtsam
    use_gtsam
    compute_fingerprints # anew: Python itself may have come with the packages
    if ! stamp_is venv "$venv_print" || ! venv_works; then
        make_venv "$venv_print"
    fi
    stamp_is requirements "$requirements_print" || install_requirements "$requirements_print"
    if ! stamp_is package "$package_print" || [[ ! -x $VENV/bin/d2lio ]]; then
        install_package "$package_print"
    fi
    drop_lock
}
