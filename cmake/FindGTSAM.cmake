# find_package(GTSAM 4.2): GTSAM's own package configuration, wherever that can be loaded; sets
# GTSAM_FOUND and the target gtsam.
#
# Debian's and Ubuntu's libgtsam-dev 4.2.0 exports CppUnitLite, a test library that it does not ship,
# so that every find_package(GTSAM CONFIG) ends in a fatal error, even a QUIET one. There the target
# is made here, without CppUnitLite.
if(TARGET gtsam)
  return()
endif()
if(POLICY CMP0167)
  cmake_policy(SET CMP0167 NEW) # Boost's own configuration
endif()

# The file that find_package(GTSAM CONFIG) would load: hints, CMAKE_PREFIX_PATH, then the system.
find_file(gtsam_exports GTSAM-exports.cmake HINTS "${GTSAM_DIR}" NO_CACHE
          PATH_SUFFIXES ../lib/cmake/GTSAM "../lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/GTSAM")
set(gtsam_unit_test_library "")
if(gtsam_exports)
  get_filename_component(gtsam_config_dir "${gtsam_exports}" DIRECTORY)
  get_filename_component(gtsam_prefix "${gtsam_config_dir}/../../.." ABSOLUTE)
  file(GLOB gtsam_details "${gtsam_config_dir}/GTSAM-exports-*.cmake")
  foreach(gtsam_detail IN LISTS gtsam_details)
    file(STRINGS "${gtsam_detail}" gtsam_lines REGEX "IMPORTED_LOCATION.*CppUnitLite")
    if(gtsam_lines)
      string(REGEX MATCH "/[^\"]*" gtsam_unit_test_library "${gtsam_lines}")
    endif()
  endforeach()
endif()

if(NOT gtsam_unit_test_library OR EXISTS "${gtsam_prefix}${gtsam_unit_test_library}")
  find_package(GTSAM ${GTSAM_FIND_VERSION} QUIET CONFIG)
else()
  find_library(gtsam_library gtsam HINTS "${gtsam_prefix}/lib" NO_CACHE)
  include("${gtsam_config_dir}/GTSAMConfigVersion.cmake")
  set(GTSAM_VERSION ${PACKAGE_VERSION})
  include(CMakeFindDependencyMacro)
  find_dependency(Boost 1.67 COMPONENTS serialization system filesystem thread date_time timer
                                        chrono regex)
  find_dependency(Eigen3)
  find_dependency(TBB) # Debian's is built with it
  add_library(gtsam UNKNOWN IMPORTED)
  set_target_properties(
    gtsam
    PROPERTIES
      IMPORTED_LOCATION "${gtsam_library}"
      INTERFACE_COMPILE_FEATURES cxx_std_11
      INTERFACE_INCLUDE_DIRECTORIES "${gtsam_prefix}/include"
      INTERFACE_LINK_LIBRARIES
      "Boost::serialization;Boost::system;Boost::filesystem;Boost::thread;Boost::date_time;Boost::timer;Boost::chrono;Boost::regex;TBB::tbb;TBB::tbbmalloc;Eigen3::Eigen")
  set(GTSAM_CONFIG "${gtsam_config_dir}")
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(GTSAM REQUIRED_VARS GTSAM_CONFIG VERSION_VAR GTSAM_VERSION)
