# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
#
# As rosidl does it, the folder comes with the target.
if(NOT TARGET diagnostic_msgs::diagnostic_msgs__rosidl_generator_cpp)
  add_library(diagnostic_msgs::diagnostic_msgs__rosidl_generator_cpp INTERFACE IMPORTED)
  get_filename_component(folder "${CMAKE_CURRENT_LIST_DIR}/../../../messages" ABSOLUTE)
  set_property(TARGET diagnostic_msgs::diagnostic_msgs__rosidl_generator_cpp
               PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${folder}")
endif()
set(diagnostic_msgs_TARGETS diagnostic_msgs::diagnostic_msgs__rosidl_generator_cpp)
