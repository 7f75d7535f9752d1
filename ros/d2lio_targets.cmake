# Included by every package here: the targets of the checkout, where catkin builds the package and not
# the checkout's own CMakeLists.txt does.
get_filename_component(D2LIO_ROOT ${CMAKE_CURRENT_LIST_DIR}/.. ABSOLUTE)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
list(APPEND CMAKE_MODULE_PATH ${D2LIO_ROOT}/cmake)
include(D2lioTargets)

# What the parts of the checkout expect of whoever adds them.
macro(d2lio_find_packages)
  find_package(Eigen3 3.3 REQUIRED NO_MODULE)
  find_package(TBB REQUIRED)
  find_package(Threads REQUIRED)
  find_package(GTSAM 4.2 QUIET)
  set(D2LIO_WITH_GTSAM ${GTSAM_FOUND})
endmacro()

if(NOT TARGET d2lio::core)
  d2lio_find_packages()
  set(D2LIO_BUILD_TESTS OFF)
  foreach(part common fastlio_plugin liosam_plugin)
    add_subdirectory(${D2LIO_ROOT}/${part} ${CMAKE_BINARY_DIR}/d2lio/${part} EXCLUDE_FROM_ALL)
  endforeach()
endif()
