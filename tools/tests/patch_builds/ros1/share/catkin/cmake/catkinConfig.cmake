# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
#
# Stands in for catkin: include folders of what upstream names. diagnostic_msgs lies elsewhere, so
# that only who finds it sees it.
get_filename_component(catkin_INCLUDE_DIRS "${CMAKE_CURRENT_LIST_DIR}/../../../include" ABSOLUTE)
set(catkin_LIBRARIES)
macro(catkin_package)
endmacro()
