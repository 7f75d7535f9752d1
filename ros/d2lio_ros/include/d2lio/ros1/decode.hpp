// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "d2lio/types.hpp"

/// Serialised ROS 1 messages to points and samples, in the way of `d2lio run`. Nothing here needs
/// ROS or a driver's message package; what is damaged is refused with a message, never read past.
namespace d2lio::ros1 {

/// A message as it came over the wire.
struct RawMessage {
    std::string type;  ///< sensor_msgs/PointCloud2 and the like
    std::vector<std::uint8_t> bytes;

    /// Stamp of the std_msgs/Header that all our messages begin with, ns; none if too short.
    std::optional<Stamp> stamp() const;
};

/// One sweep as its message holds it, in message order, LiDAR frame.
struct RawScan {
    Stamp stamp = 0;  ///< the message's own; what it means (start, end) depends on the driver
    std::vector<LidarPoint> points;  ///< offsets not set
    /// Per-point time field as stored, at most one of the two: integers stay exact.
    std::vector<double> real_times;
    std::vector<std::int64_t> integer_times;
    bool times_in_ns_from_stamp = false;  ///< the decoder's own times, unit and reference certain
};

struct DecodeOptions {
    std::string time_field;  ///< of a PointCloud2; empty takes the first known name
    std::string model;       ///< vlp16 or hdl32e, for packets that do not tell
};

enum class LidarType { kAuto, kPointCloud2, kLivox, kVelodynePackets };
const std::vector<std::string>& lidar_type_names();

/// What a message type holds; kAuto for none of ours.
LidarType lidar_type_of(const std::string& message_type);

/// @param error says why where false is returned
/// @param counts by reason, of what was left out (packets_wrong_size and the like)
bool decode_scan(const RawMessage& message, const DecodeOptions& options, RawScan& out,
                 std::string& error, std::map<std::string, std::size_t>& counts);

bool decode_point_cloud2(const RawMessage& message, const std::string& time_field, RawScan& out,
                         std::string& error);
/// livox_ros_driver(2)/CustomMsg.
bool decode_livox(const RawMessage& message, RawScan& out, std::string& error);
/// velodyne_msgs/VelodyneScan of a VLP-16 or HDL-32E.
bool decode_velodyne(const RawMessage& message, const std::string& model, RawScan& out,
                     std::string& error, std::map<std::string, std::size_t>& counts);

constexpr char kImuType[] = "sensor_msgs/Imu";
/// @param accel_scale multiplies the accelerations (9.80665 for an IMU that gives g)
/// @param orientation whether a 9-axis IMU's attitude is handed on
bool decode_imu(const RawMessage& message, double accel_scale, bool orientation, ImuSample& out);

}  // namespace d2lio::ros1
