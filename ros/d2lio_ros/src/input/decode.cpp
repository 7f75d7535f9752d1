// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/decode.hpp"

#include <array>
#include <cmath>

#include "d2lio/ros1/byte_reader.hpp"

namespace d2lio::ros1 {
namespace {

constexpr double kUnitTolerance = 1e-2;  // of a quaternion's norm; rounding drivers stay below
constexpr std::size_t kLeastHeader = 16;

template <std::size_t N>
std::array<double, N> numbers(ByteReader& in) {
    std::array<double, N> out;
    for (double& v : out) v = in.read<double>();
    return out;
}

/// x y z w, zeros where the message has none: by its definition covariance[0] == -1 says so;
/// drivers of 6-axis IMUs that do not set it leave zeros or exactly the identity.
Eigen::Vector4d orientation_of(const std::array<double, 4>& q, double covariance_0) {
    const Eigen::Vector4d v(q[0], q[1], q[2], q[3]);
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const bool unit = std::abs(norm - 1.0) <= kUnitTolerance;
    const bool identity = v == Eigen::Vector4d(0, 0, 0, 1);
    if (covariance_0 == -1.0 || !unit || identity) return Eigen::Vector4d::Zero();
    return v / norm;
}

}  // namespace

std::optional<Stamp> RawMessage::stamp() const {
    if (bytes.size() < kLeastHeader) return std::nullopt;
    ByteReader in(bytes.data(), bytes.size());
    const Stamp stamp = in.header();
    return in.ok() ? std::make_optional(stamp) : std::nullopt;
}

const std::vector<std::string>& lidar_type_names() {
    static const std::vector<std::string> names{"auto", "pointcloud2", "livox", "velodyne_packets"};
    return names;
}

LidarType lidar_type_of(const std::string& type) {
    if (type == "sensor_msgs/PointCloud2") return LidarType::kPointCloud2;
    if (type == "livox_ros_driver/CustomMsg" || type == "livox_ros_driver2/CustomMsg") {
        return LidarType::kLivox;
    }
    if (type == "velodyne_msgs/VelodyneScan") return LidarType::kVelodynePackets;
    return LidarType::kAuto;
}

bool decode_scan(const RawMessage& message, const DecodeOptions& options, RawScan& out,
                 std::string& error, std::map<std::string, std::size_t>& counts) {
    out = RawScan{};
    switch (lidar_type_of(message.type)) {
        case LidarType::kPointCloud2:
            return decode_point_cloud2(message, options.time_field, out, error);
        case LidarType::kLivox:
            return decode_livox(message, out, error);
        case LidarType::kVelodynePackets:
            return decode_velodyne(message, options.model, out, error, counts);
        case LidarType::kAuto:
            break;
    }
    error = "messages of type " + message.type + " hold no scan";
    return false;
}

bool decode_imu(const RawMessage& message, double accel_scale, bool orientation, ImuSample& out) {
    ByteReader in(message.bytes.data(), message.bytes.size());
    out.stamp = in.header();
    const auto q = numbers<4>(in);
    const auto q_covariance = numbers<9>(in);
    const auto gyro = numbers<3>(in);
    numbers<9>(in);
    const auto accel = numbers<3>(in);
    numbers<9>(in);
    out.gyro = Vec3(gyro[0], gyro[1], gyro[2]);
    out.accel = accel_scale * Vec3(accel[0], accel[1], accel[2]);
    out.orientation = Eigen::Vector4d::Zero();
    if (orientation) out.orientation = orientation_of(q, q_covariance[0]);
    return in.ok();
}

}  // namespace d2lio::ros1
