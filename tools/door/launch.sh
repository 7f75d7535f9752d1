# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
#
# ./d2lio launch: sets up ROS 1 and our nodes (ros.sh, sourced before), then starts what is asked for.

# What compare.launch and its scoreboard need beside the nodes.
ROS_PACKAGES+=(
    python3-geometry-msgs python3-numpy python3-rospkg python3-rospy python3-std-msgs
    python3-tf2-msgs python3-yaml
)

# RViz, only where something is to be seen.
wants_rviz() { # ARGUMENTS...
    local argument
    for argument in "$@"; do
        [[ $argument == --headless || $argument == --help || $argument == -h ]] && return 1
    done
    return 0
}

cmd_launch() {
    (($#)) || die "$E_USAGE" 'launch: compare SEQ [--variants ...] [--headless] [--out DIR]; --help says more'
    if wants_rviz "$@"; then
        ROS_PACKAGES+=(rviz)
    fi
    setup_python
    setup_ros
    use_ros
    exec "$VENV/bin/d2lio" launch "$@"
}
