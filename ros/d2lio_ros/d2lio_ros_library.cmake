# The library that the nodes are made of. Included by this package, and by a node's package where
# catkin builds each by itself.
find_package(yaml-cpp REQUIRED)
set(D2LIO_ROS_DIR ${CMAKE_CURRENT_LIST_DIR})

# Without ROS: messages as bytes, configuration, queue, files.
file(GLOB D2LIO_ROS_INPUT CONFIGURE_DEPENDS ${D2LIO_ROS_DIR}/src/input/*.cpp)
add_library(d2lio_ros_input STATIC ${D2LIO_ROS_INPUT})
target_include_directories(d2lio_ros_input PUBLIC ${D2LIO_ROS_DIR}/include)
target_link_libraries(d2lio_ros_input PUBLIC d2lio::core PRIVATE yaml-cpp)
d2lio_own(d2lio_ros_input)

file(GLOB D2LIO_ROS_NODE CONFIGURE_DEPENDS ${D2LIO_ROS_DIR}/src/node/*.cpp)
add_library(d2lio_ros_node STATIC ${D2LIO_ROS_NODE})
target_compile_definitions(d2lio_ros_node PRIVATE D2LIO_VERSION="${PROJECT_VERSION}")
target_include_directories(d2lio_ros_node SYSTEM PUBLIC ${catkin_INCLUDE_DIRS}
                           ${CATKIN_DEVEL_PREFIX}/include)
target_link_libraries(d2lio_ros_node PUBLIC d2lio_ros_input ${catkin_LIBRARIES})
d2lio_own(d2lio_ros_node)
if(d2lio_ros_EXPORTED_TARGETS)
  add_dependencies(d2lio_ros_node ${d2lio_ros_EXPORTED_TARGETS})
endif()
