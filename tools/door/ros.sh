# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ROS 1 from the distribution's packages and our nodes, built in build/ros. Sourced by ./d2lio.

# To build the nodes, to start and watch them, and to play bags.
ROS_PACKAGES=(
    catkin python3-catkin-pkg ros-message-generation ros-message-runtime ros-std-msgs
    libroscpp-dev libtopic-tools-dev libtf2-ros-dev libxmlrpcpp-dev libyaml-cpp-dev
    libdiagnostic-msgs-dev libgeometry-msgs-dev libnav-msgs-dev libsensor-msgs-dev
    libstd-srvs-dev libvisualization-msgs-dev
    python3-diagnostic-msgs python3-nav-msgs python3-sensor-msgs python3-std-srvs
    python3-visualization-msgs
    python3-rosbag python3-roslaunch python3-rosnode python3-rosparam python3-rosservice
    python3-rostopic python3-rostest rosbash rosout rospack-tools
)
readonly ROS_SETUP="$BUILD/ros/setup.bash"

# What the nodes are made of.
readonly ROS_INPUTS=(
    CMakeLists.txt cmake common/CMakeLists.txt common/include common/src
    fastlio_plugin/CMakeLists.txt fastlio_plugin/adapter fastlio_plugin/host fastlio_plugin/ros
    liosam_plugin/CMakeLists.txt liosam_plugin/adapter liosam_plugin/host liosam_plugin/ros
    ros/CMakeLists.txt ros/d2lio_targets.cmake ros/setup.bash.in ros/d2lio_ros
    ros/livox_ros_driver ros/d2lio_compare
)

# In a shell of its own, so that the lists of the verbs stay as they are.
# shellcheck disable=SC2030,SC2031
missing_ros_packages() { (
    SYSTEM_PACKAGES=("${ROS_PACKAGES[@]}") GTSAM_PACKAGES=()
    missing_packages
); }

install_ros() {
    local missing
    mapfile -t missing < <(missing_ros_packages)
    ((${#missing[@]})) || return 0
    offline && die "$E_DOWNLOAD" "D2LIO_OFFLINE is set and ROS packages are missing: ${missing[*]}"
    need_free_space
    say "[ros] system packages: ${missing[*]}"
    apt_install "${missing[@]}"
}

build_ros() { # FINGERPRINT
    need_free_space
    say '[ros] building the nodes'
    # A ROS distribution in /opt stays on the path it has put itself on.
    run_logged ros cmake -S "$ROOT" -B "$BUILD/ros" -G Ninja -DD2LIO_ROS=ON -DD2LIO_BUILD_TESTS=OFF \
        "${GTSAM_ARGUMENTS[@]}" || die_with_log "$E_BUILD" ros 'configuring the ROS nodes failed'
    run_logged ros cmake --build "$BUILD/ros" -j "${D2LIO_JOBS:-$(jobs_default)}" ||
        die_with_log "$E_BUILD" ros 'building the ROS nodes failed'
    write_stamp ros "$1"
}

# setup_ros: ROS installed and the nodes built; nothing when nothing changed. After setup_python or
# setup_system, which have found a compiler and GTSAM.
setup_ros() {
    local print
    take_lock
    install_ros
    print=$(fingerprint "$ROOT $(gtsam_print) $(installed_packages libroscpp-dev catkin)" "${ROS_INPUTS[@]}")
    if ! stamp_is ros "$print" || [[ ! -f $ROS_SETUP ]]; then
        build_ros "$print"
    fi
    drop_lock
}

# use_ros: what is started from here on finds ROS and the nodes.
use_ros() {
    # shellcheck source=/dev/null
    source "$ROS_SETUP"
}

# ./d2lio test --ros: unit tests of the nodes' library, and the nodes on simulated bags.
test_ros() { # PYTEST ARGUMENTS...
    local reports="$REPORT_DIR/ros" missing
    cd -- "$ROOT"
    make_dirs "$reports"
    mapfile -t missing < <(missing_ros_packages)
    if offline && ((${#missing[@]})); then
        say "skipped: the tests of the ROS nodes; D2LIO_OFFLINE is set and ROS is not installed (${missing[*]})"
        printf '0 0 1\nROS nodes: not installed\n' >"$reports/counts"
        echo '0 passed, 0 failed, 1 skipped (left out: ROS nodes: not installed)'
        return
    fi
    # shellcheck disable=SC2031 # see missing_ros_packages
    SYSTEM_PACKAGES+=(libgtest-dev)
    setup_python
    setup_ros
    rm -rf -- "$reports" && mkdir -p "$reports/gtest"
    GTEST_OUTPUT="xml:$reports/gtest/" GTEST_BRIEF=1 ctest --test-dir "$BUILD/ros/ros" \
        --output-junit "$reports/ctest.xml" --output-on-failure || true
    D2LIO_ROS_SETUP="$ROS_SETUP" run_pytest "$reports" ros \
        -o 'pythonpath=ros/tests ros/d2lio_compare/tests ablation/tests' "$@"
    exec "$PYTHON" "$ROOT/tools/door/summary.py" "$reports" --ctest --pytest
}
