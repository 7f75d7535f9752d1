# Warnings, sanitizers, tests and benchmarks, declared once for every part of the project.

# d2lio_own(<target>): our warning flags (as errors) and, where asked for, sanitizers.
function(d2lio_own target)
  # GCC sees uninitialised values in Eigen's fixed-size temporaries where there are none.
  # No fused multiply-adds: results repeat bit for bit whatever the instruction set, and a search's
  # pruning bound rounds as its distances do.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wconversion -Werror
                         -Wno-maybe-uninitialized -ffp-contract=off)
  if(D2LIO_SANITIZE)
    target_compile_options(${target} PUBLIC -fsanitize=${D2LIO_SANITIZE}
                           -fno-sanitize-recover=all -fno-omit-frame-pointer)
    # Under AddressSanitizer Eigen would allocate in another way than in libraries built without it.
    target_compile_definitions(${target} PUBLIC EIGEN_MALLOC_ALREADY_ALIGNED=1)
    target_link_options(${target} PUBLIC -fsanitize=${D2LIO_SANITIZE})
  endif()
endfunction()

# d2lio_tests(<name> <library> <folder>): one GoogleTest binary from <folder>/test_*.cpp.
function(d2lio_tests name library folder)
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/test_*.cpp)
  if(NOT D2LIO_BUILD_TESTS OR NOT sources)
    return()
  endif()
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE ${library} GTest::gtest_main)
  d2lio_own(${name})
  add_test(NAME ${name} COMMAND ${name})
endfunction()

# d2lio_glue_tests(<host>): what a patched upstream includes, against stand-ins for either ROS.
function(d2lio_glue_tests host)
  foreach(ros 1 2)
    set(deps d2lio_${host}_glue_ros${ros})
    add_library(${deps} INTERFACE)
    target_link_libraries(${deps} INTERFACE d2lio::${host}_adapter)
    target_compile_definitions(${deps} INTERFACE D2LIO_ROS=${ros} D2LIO_WITH_DIAGNOSTIC_MSGS)
    target_include_directories(${deps} INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/ros/include
                               ${PROJECT_SOURCE_DIR}/common/ros/include
                               ${PROJECT_SOURCE_DIR}/common/tests/ros
                               ${PROJECT_SOURCE_DIR}/common/tests/ros/ros${ros})
    d2lio_tests(test_${host}_glue_ros${ros} ${deps} ${CMAKE_CURRENT_SOURCE_DIR}/tests/ros)
    d2lio_headers_alone(${host}_glue_ros${ros}_alone ${deps}
                        ${CMAKE_CURRENT_SOURCE_DIR}/ros/include 14)
  endforeach()
endfunction()

# d2lio_bench(<name> <library> <folder>): one Google Benchmark binary from <folder>/bench_*.cpp.
function(d2lio_bench name library folder)
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/bench_*.cpp)
  if(NOT D2LIO_BUILD_BENCH OR NOT sources)
    return()
  endif()
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE ${library} benchmark::benchmark_main)
  d2lio_own(${name})
endfunction()

# d2lio_headers_alone(<name> <library> <include dir> [standard]): every header compiles by itself.
function(d2lio_headers_alone name library include_dir)
  if(NOT D2LIO_BUILD_TESTS)
    return()
  endif()
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${include_dir} ${include_dir}/*.hpp)
  set(sources)
  foreach(header ${headers})
    string(MAKE_C_IDENTIFIER ${header} id)
    set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}/${id}.cpp)
    file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n#include \"${header}\"\n")
    list(APPEND sources ${source})
  endforeach()
  if(NOT sources)
    return()
  endif()
  add_library(${name} OBJECT ${sources})
  target_link_libraries(${name} PRIVATE ${library})
  d2lio_own(${name})
  if(ARGC GREATER 3)
    set_target_properties(${name} PROPERTIES CXX_STANDARD ${ARGV3})
  endif()
endfunction()

# d2lio_python_module(<name> <library> <sources...>): a nanobind module inside the package d2lio, with
# its typed stub. NB_DOMAIN lets the modules share types and exceptions.
function(d2lio_python_module name library)
  nanobind_add_module(${name} STABLE_ABI NB_STATIC NB_DOMAIN d2lio ${ARGN})
  target_link_libraries(${name} PRIVATE ${library})
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wno-maybe-uninitialized)
  install(TARGETS ${name} LIBRARY DESTINATION d2lio)
  nanobind_add_stub(${name}_stub MODULE ${name} OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}.pyi
                    PYTHON_PATH $<TARGET_FILE_DIR:${name}> DEPENDS ${name})
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${name}.pyi DESTINATION d2lio)
endfunction()
