#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
#
# build_gtsam.sh WORK PREFIX: static GTSAM 4.2.0 for systems without libgtsam-dev. Debian 13's source
# tarball, fetched by apt from the archive that this system is installed from, and built with the
# system's Boost, Eigen, METIS and CCOLAMD. PREFIX appears whole at the end and may be moved; until
# then WORK keeps what is done, and the next call goes on from there.
# Environment: CXX and CXXFLAGS as CMake takes them, D2LIO_JOBS. Exit code: 12 download, 15 build.
set -euo pipefail

HERE=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd -P)
readonly HERE WORK=$1 PREFIX=$2
readonly TARBALL=gtsam_4.2.0+dfsg.orig.tar.xz
readonly SHA256=8383cc1fe7ea82549c9cd6c0cead48712d3348f4193c0c16e776e57401343277
readonly E_DOWNLOAD=12 E_BUILD=15

fail() { # CODE MESSAGE
    printf 'error: %s\n' "$2"
    exit "$1"
}

# archive_entries CODENAME FILE...: deb822 entries of Debian 13's sources for each archive from which
# FILEs (one-line *.list, deb822 *.sources) take main of CODENAME, with its keys.
archive_entries() {
    awk -v codename="$1" '
        function has(words, word) { return index(" " words " ", " " word " ") }
        function offer(uri, suites, components, options) {
            if (uri ~ /^cdrom:/ || uri in seen || !has(components, "main")) return
            if (!has(suites, codename) && !has(suites, "stable") && !has(suites, "oldstable")) return
            seen[uri]
            printf "Types: deb-src\nURIs: %s\nSuites: trixie\nComponents: main\n%s\n", uri, options
        }
        function option_line(name, key) { return key in field ? name ": " field[key] "\n" : "" }
        function end_stanza(    uri, i, n) {
            n = has(field["types"], "deb") && field["enabled"] != "no" ? split(field["uris"], uri, " ") : 0
            for (i = 1; i <= n; ++i)
                offer(uri[i], field["suites"], field["components"],
                      option_line("Signed-By", "signed-by") option_line("Trusted", "trusted"))
            split("", field)
        }
        FNR == 1 { end_stanza() }
        FILENAME !~ /\.sources$/ {
            sub(/#.*/, "")
            options = ""
            if ($1 != "deb") next
            if ($2 ~ /^\[/ && match($0, /\[[^]]*\]/)) {
                n = split(substr($0, RSTART + 1, RLENGTH - 2), option, " ")
                for (i = 1; i <= n; ++i) {
                    if (sub(/^signed-by=/, "Signed-By: ", option[i])) options = options option[i] "\n"
                    if (sub(/^trusted=/, "Trusted: ", option[i])) options = options option[i] "\n"
                }
                $0 = "deb " substr($0, RSTART + RLENGTH)
            }
            uri = $2; suite = $3; $1 = $2 = $3 = ""
            offer(uri, suite, $0, options)
            next
        }
        /^#/ { next }
        /^[[:space:]]*$/ { end_stanza(); next }
        /^[[:space:]]/ { field[name] = field[name] "\n" $0; next } # a key written out in the entry
        {
            name = tolower(substr($0, 1, index($0, ":") - 1))
            value = substr($0, index($0, ":") + 1)
            gsub(/[[:space:]]+/, " ", value); gsub(/^ | $/, "", value)
            field[name] = value
        }
        END { end_stanza() }' "${@:2}"
}

write_sources() {
    local list parts files codename
    eval "$(apt-config shell list Dir::Etc::sourcelist/f parts Dir::Etc::sourceparts/d)"
    # shellcheck source=/dev/null
    codename=$(. "${D2LIO_OS_RELEASE:-/etc/os-release}" && echo "${VERSION_CODENAME:-}")
    mapfile -d '' -t files < <(
        find "$list" "${parts%/}" -maxdepth 1 -type f \( -path "$list" -o -name '*.list' -o -name '*.sources' \) \
            -print0 2>/dev/null | sort -z
    )
    ((${#files[@]})) && archive_entries "$codename" "${files[@]}" >trixie.sources
    [[ -s trixie.sources ]] ||
        fail "$E_DOWNLOAD" "the apt sources have no Debian archive with main of '$codename'"
}

tarball_is_right() { sha256sum --check --status <<<"$SHA256  $TARBALL" 2>/dev/null; }

download() {
    tarball_is_right && return
    rm -f -- "$TARBALL"
    write_sources
    mkdir -p lists/partial
    local apt=(
        apt-get -o "Dir::State::lists=$WORK/lists" -o "Dir::Etc::sourcelist=$WORK/trixie.sources"
        -o Dir::Etc::sourceparts=/dev/null -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache=
        -o "APT::Sandbox::User=$(id -un)" -o Acquire::Retries=2
    )
    # An archive that is not Debian's own has no trixie, which makes the update fail.
    "${apt[@]}" update 2>&1 | tee update.log || true
    if ! "${apt[@]}" source --tar-only --download-only gtsam=4.2.0+dfsg-1; then
        fail "$E_DOWNLOAD" "$(grep -m 1 -E "^(E|W):" update.log || echo 'apt-get source gtsam failed')"
    fi
    tarball_is_right || {
        rm -f -- "$TARBALL"
        fail "$E_DOWNLOAD" "$TARBALL is not what it should be (sha256 differs)"
    }
    rm -rf -- lists
}

unpack() {
    [[ -d source ]] && return
    rm -rf -- unpacked && mkdir unpacked
    tar -xf "$TARBALL" -C unpacked --strip-components=1
    patch -d unpacked -p1 <"$HERE/gtsam.patch"
    mv -T -- unpacked source
}

# MARCH_NATIVE would change Eigen's alignment, and TBB would be a second scheduler beside ours.
build() {
    local off
    for off in BUILD_SHARED_LIBS GTSAM_{WITH_TBB,BUILD_{WITH_MARCH_NATIVE,WITH_CCACHE,UNSTABLE,PYTHON,TESTS}}; do
        set -- "$@" "-D$off=OFF"
    done
    cmake -S source -B build -G Ninja "$@" \
        -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_UNITY_BUILD=ON \
        "-DCMAKE_CXX_FLAGS=${CXXFLAGS:-} -w" -DCMAKE_INSTALL_PREFIX="$WORK/prefix" \
        -DCMAKE_INSTALL_LIBDIR=lib -DGTSAM_USE_SYSTEM_EIGEN=ON -DGTSAM_USE_SYSTEM_METIS=ON
    cmake --build build -j "${D2LIO_JOBS:-$(nproc)}"
    rm -rf -- prefix
    cmake --install build
}

main() {
    mkdir -p -- "$WORK"
    cd -- "$WORK"
    download
    trap '[[ $? == 0 ]] || exit "$E_BUILD"' EXIT
    unpack
    build
    rm -rf -- "$PREFIX"
    mv -T -- prefix "$PREFIX"
    cd /
    rm -rf -- "$WORK"
}

# In one line: bash must not read on in a script that an update replaced meanwhile.
main; exit
