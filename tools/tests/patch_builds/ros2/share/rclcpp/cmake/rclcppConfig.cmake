# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
if(NOT TARGET rclcpp::rclcpp)
  add_library(rclcpp::rclcpp INTERFACE IMPORTED)
  get_filename_component(folder "${CMAKE_CURRENT_LIST_DIR}/../../../include" ABSOLUTE)
  set_property(TARGET rclcpp::rclcpp PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${folder}")
endif()
