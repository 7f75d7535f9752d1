// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/byte_reader.hpp"
#include "d2lio/ros1/decode.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::size_t kPointBytes = 19;  // offset_time u32, x y z f32, reflectivity, tag, line u8

}  // namespace

bool decode_livox(const RawMessage& message, RawScan& out, std::string& error) {
    ByteReader in(message.bytes.data(), message.bytes.size());
    out.stamp = in.header();
    in.take(8 + 4 + 4);  // timebase, point_num, lidar_id and reserved
    const std::size_t count = in.read<std::uint32_t>();
    if (!in.ok() || in.left() / kPointBytes < count) {
        error = "CustomMsg claims " + std::to_string(count) + " points but holds only " +
                std::to_string(message.bytes.size()) + " bytes";
        return false;
    }
    out.points.resize(count);
    out.integer_times.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        LidarPoint& p = out.points[i];
        out.integer_times[i] = in.read<std::uint32_t>();
        p.x = in.read<float>();
        p.y = in.read<float>();
        p.z = in.read<float>();
        p.intensity = in.read<std::uint8_t>();
        in.read<std::uint8_t>();  // tag
        p.ring = in.read<std::uint8_t>();
    }
    return true;
}

}  // namespace d2lio::ros1
