# Included by a patched upstream: builds the adapter from this checkout and links it. Needs Eigen 3.3
# and C++17, and nothing of the rest of the project; works with any CMake that upstream works with.
#
# d2lio_upstream(<target> <fastlio|liosam>): the target gets the adapter, the glue's include folders,
# and the definitions D2LIO_ROS=1|2 and (where diagnostic_msgs is found) D2LIO_WITH_DIAGNOSTIC_MSGS.
cmake_policy(PUSH)
cmake_policy(VERSION 3.5)

get_filename_component(D2LIO_UPSTREAM_ROOT "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)

# What the adapters are made of; nothing here includes a header of another part of common/.
set(D2LIO_UPSTREAM_MODULES config degeneracy diagnostics geometry plugin rejection)

function(d2lio_upstream_library name host)
  set(sources)
  foreach(module ${D2LIO_UPSTREAM_MODULES})
    file(GLOB found "${D2LIO_UPSTREAM_ROOT}/common/src/${module}/*.cpp")
    list(APPEND sources ${found})
  endforeach()
  file(GLOB found "${D2LIO_UPSTREAM_ROOT}/${host}_plugin/adapter/src/*.cpp")
  list(APPEND sources ${found})
  find_package(Eigen3 3.3 REQUIRED NO_MODULE)

  add_library(${name} STATIC ${sources})
  # Overrides what upstream sets for its folder (C++14): the last -std counts.
  set_target_properties(${name} PROPERTIES CXX_STANDARD 17 POSITION_INDEPENDENT_CODE ON)
  # NDEBUG: upstreams build without it, and an assertion of Eigen's must not end a robot's node.
  set_property(TARGET ${name} PROPERTY COMPILE_OPTIONS -std=c++17 -O3 -DNDEBUG -ffp-contract=off)
  target_include_directories(${name} PUBLIC
                             "${D2LIO_UPSTREAM_ROOT}/common/include"
                             "${D2LIO_UPSTREAM_ROOT}/${host}_plugin/adapter/include")
  target_link_libraries(${name} PRIVATE Eigen3::Eigen)
endfunction()

# The glue is C++14; what upstream asks for stays if it is later. On the command line the last -std
# counts: CMAKE_CXX_FLAGS, then the options, then the property.
function(d2lio_upstream_standard target)
  get_target_property(standard ${target} CXX_STANDARD)
  get_target_property(options ${target} COMPILE_OPTIONS)
  string(REGEX MATCHALL "-std=[a-z]+[+][+][0-9a-z]+" asked "${CMAKE_CXX_FLAGS} ${options}")
  if(standard)
    if(standard MATCHES "^(98|11)$")
      set_target_properties(${target} PROPERTIES CXX_STANDARD 14)
    endif()
  elseif(asked)
    list(GET asked -1 last)
    if(last MATCHES "[+](98|03|0x|11)$")
      target_compile_options(${target} PRIVATE -std=c++14)
    endif()
  endif()
endfunction()

function(d2lio_upstream target host)
  set(library d2lio_upstream_${host})
  if(NOT TARGET ${library})
    d2lio_upstream_library(${library} ${host})
  endif()
  if(TARGET rclcpp::rclcpp)
    target_compile_definitions(${target} PRIVATE D2LIO_ROS=2)
  else()
    target_compile_definitions(${target} PRIVATE D2LIO_ROS=1)
  endif()
  d2lio_upstream_standard(${target})
  target_include_directories(${target} PRIVATE
                             "${D2LIO_UPSTREAM_ROOT}/common/ros/include"
                             "${D2LIO_UPSTREAM_ROOT}/${host}_plugin/ros/include")
  # By property: upstream's own target_link_libraries may have keywords or not, and both may not mix.
  set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES ${library})

  find_package(diagnostic_msgs QUIET)
  if(diagnostic_msgs_FOUND)
    target_compile_definitions(${target} PRIVATE D2LIO_WITH_DIAGNOSTIC_MSGS)
    target_include_directories(${target} PRIVATE ${diagnostic_msgs_INCLUDE_DIRS})
    set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES ${diagnostic_msgs_TARGETS})
  endif()
endfunction()

cmake_policy(POP)
