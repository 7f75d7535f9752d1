# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio launch: sets up ROS 1 and our nodes (ros.sh), then starts what is asked for.

# What compare.launch needs beside the nodes; RViz only where something is to be seen.
LAUNCH_PACKAGES=(
    python3-diagnostic-msgs python3-geometry-msgs python3-nav-msgs python3-numpy python3-rosbag
    python3-roslaunch python3-rospkg python3-rospy python3-rosservice python3-std-msgs
    python3-tf2-msgs python3-visualization-msgs python3-yaml
)

wants_rviz() { # ARGUMENTS...
    local argument
    for argument in "$@"; do
        [[ $argument == --headless || $argument == --help || $argument == -h ]] && return 1
    done
}

cmd_launch() {
    if wants_rviz "$@"; then
        LAUNCH_PACKAGES+=(rviz)
    fi
    SYSTEM_PACKAGES+=("${LAUNCH_PACKAGES[@]}")
    setup_python
    setup_ros
    use_ros
    exec "$VENV/bin/d2lio" launch "$@"
}
