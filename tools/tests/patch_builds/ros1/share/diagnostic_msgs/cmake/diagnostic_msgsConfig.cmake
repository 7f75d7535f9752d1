# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
get_filename_component(diagnostic_msgs_INCLUDE_DIRS
                       "${CMAKE_CURRENT_LIST_DIR}/../../../messages" ABSOLUTE)
