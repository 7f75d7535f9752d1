# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
#
# Stands in for ament_cmake.
macro(ament_package)
endmacro()
