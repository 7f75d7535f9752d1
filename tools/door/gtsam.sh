# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# GTSAM for the LIO-SAM host: the distribution's libgtsam-dev, else one static build for all
# checkouts, kept in the user's cache. Sourced by ./d2lio.

readonly GTSAM_RECIPE=(tools/door/build_gtsam.sh tools/door/gtsam.patch)
# What GTSAM is built from and linked with; libgtsam-dev itself asks for none of them.
readonly GTSAM_NEEDS=(
    libboost-{chrono,date-time,filesystem,program-options,regex,serialization,system,thread,timer}-dev
    libmetis-dev libsuitesparse-dev
)
readonly GTSAM_MIN_FREE_MIB=512

gtsam_from=     # package, cache, or nothing where it is left out
gtsam_prefix=   # of the build in the cache
gtsam_left_out= # why
GTSAM_PACKAGES=()
GTSAM_ARGUMENTS=() # for cmake

gtsam_cache() {
    local cache=${D2LIO_CACHE:-${XDG_CACHE_HOME:-${HOME:-$BUILD}/.cache}/d2lio}
    [[ $cache == /* ]] || cache=$PWD/$cache
    printf '%s' "$cache"
}

# One build per recipe, compiler with its flags, system and machine.
gtsam_cache_prefix() {
    local compiler=${CXX:-c++} about
    # shellcheck source=/dev/null
    about=$(. "${D2LIO_OS_RELEASE:-/etc/os-release}" 2>/dev/null && echo "${ID:-} ${VERSION_ID:-}") || true
    about+=" $(uname -m) $compiler $("$compiler" -dumpfullversion 2>/dev/null || true) ${CXXFLAGS:-}"
    about=$(fingerprint "$about" "${GTSAM_RECIPE[@]}")
    printf '%s/gtsam-4.2.0-%s' "$(gtsam_cache)" "${about:0:12}"
}

gtsam_is_cached() { [[ -f $gtsam_prefix/lib/cmake/GTSAM/GTSAMConfig.cmake ]]; }

gtsam_is_there() { [[ $gtsam_from != cache ]] || gtsam_is_cached; }

# What libgtsam-dev the distribution offers; a machine without package lists has to fetch them first.
gtsam_candidate() {
    if [[ -z $(apt-get indextargets 'Created-By: Packages' 2>/dev/null) ]]; then
        { become_root && "${as_root[@]}" apt-get update; } >"$LOG_DIR/apt.log" 2>&1 || true
    fi
    apt-cache policy libgtsam-dev 2>/dev/null | awk '$1 == "Candidate:" {print $2}'
}

leave_gtsam_out() { # WHY
    [[ ${D2LIO_GTSAM:-auto} == on ]] && die "$E_DOWNLOAD" "D2LIO_GTSAM is on, but GTSAM cannot be had: $1"
    gtsam_left_out=$1
}

# Decides where GTSAM comes from, and so which system packages it needs.
choose_gtsam() {
    gtsam_from='' gtsam_left_out='' GTSAM_PACKAGES=()
    case ${D2LIO_GTSAM:-auto} in
        auto | on) ;;
        off)
            leave_gtsam_out 'D2LIO_GTSAM=off'
            return
            ;;
        *) die "$E_USAGE" "D2LIO_GTSAM is '$D2LIO_GTSAM'; it may be auto, on or off" ;;
    esac
    gtsam_prefix=$(gtsam_cache_prefix)
    if [[ $(installed_packages libgtsam-dev) == *' 4.2'* ]]; then
        gtsam_from=package
    elif gtsam_is_cached; then
        gtsam_from=cache
    elif offline; then
        leave_gtsam_out 'none is installed and D2LIO_OFFLINE is set'
        return
    elif [[ $(gtsam_candidate) == 4.2* ]]; then
        gtsam_from=package
    else
        gtsam_from=cache
    fi
    GTSAM_PACKAGES=("${GTSAM_NEEDS[@]}")
    [[ $gtsam_from == cache ]] || GTSAM_PACKAGES+=(libgtsam-dev)
}

build_gtsam() {
    local cache status=0
    cache=$(gtsam_cache)
    make_dirs "$cache"
    exec 7>"$cache/lock" # held by the build as well: a second one waits even for an orphaned one
    if ! flock -n 7; then
        say 'd2lio: GTSAM is being built for another checkout; waiting for it'
        flock 7
    fi
    if ! gtsam_is_cached; then
        need_free_space "$cache" "$GTSAM_MIN_FREE_MIB"
        step 2 'building GTSAM 4.2.0 once, about 4 minutes on two cores'
        D2LIO_JOBS=${D2LIO_JOBS:-$(jobs_default)} run_logged gtsam \
            "$ROOT/tools/door/build_gtsam.sh" "$cache/.work-${gtsam_prefix##*/}" "$gtsam_prefix" || status=$?
    fi
    exec 7>&-
    ((status == 0)) && return
    ((status == E_DOWNLOAD)) || status=$E_BUILD
    die_with_log "$status" gtsam 'building GTSAM failed (D2LIO_GTSAM=off leaves the LIO-SAM host out)'
}

# The step of set-up, after the system packages.
install_gtsam() {
    [[ -z $gtsam_left_out ]] || say "the LIO-SAM host is left out, as it needs GTSAM: $gtsam_left_out"
    [[ $gtsam_from == cache ]] || return 0
    gtsam_prefix=$(gtsam_cache_prefix) # anew: the compiler may have come with the packages
    gtsam_is_cached || build_gtsam
}

# CMake finds it from here on; it must look anew, as an earlier one may still be in its own cache.
use_gtsam() {
    GTSAM_ARGUMENTS=('-UGTSAM_*' -DD2LIO_GTSAM="$([[ -n $gtsam_from ]] && echo ON || echo OFF)")
    [[ $gtsam_from == cache ]] || return 0
    export CMAKE_PREFIX_PATH="$gtsam_prefix${CMAKE_PREFIX_PATH:+:$CMAKE_PREFIX_PATH}"
}

# What a build depends on: where GTSAM is and which.
gtsam_print() {
    case $gtsam_from in
        package) installed_packages libgtsam-dev ;;
        cache) echo "$gtsam_prefix" ;;
    esac
}
