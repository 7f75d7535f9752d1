// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "d2lio/ros1/decode.hpp"

/// Serialised ROS 1 messages for tests, written byte by byte.
namespace d2lio::ros1 {

class ByteWriter {
  public:
    template <typename T>
    ByteWriter& add(T value) {
        const auto* from = reinterpret_cast<const std::uint8_t*>(&value);
        bytes_.insert(bytes_.end(), from, from + sizeof(T));
        return *this;
    }
    ByteWriter& text(const std::string& s) {
        add(static_cast<std::uint32_t>(s.size()));
        bytes_.insert(bytes_.end(), s.begin(), s.end());
        return *this;
    }
    ByteWriter& header(Stamp stamp) {
        add(std::uint32_t{7});
        add(static_cast<std::uint32_t>(stamp / 1'000'000'000));
        add(static_cast<std::uint32_t>(stamp % 1'000'000'000));
        return text("lidar");
    }
    ByteWriter& append(const std::vector<std::uint8_t>& more) {
        bytes_.insert(bytes_.end(), more.begin(), more.end());
        return *this;
    }
    const std::vector<std::uint8_t>& bytes() const { return bytes_; }

  private:
    std::vector<std::uint8_t> bytes_;
};

struct TestField {
    std::string name;
    std::uint32_t offset;
    std::uint8_t datatype;
};

struct TestCloud {
    std::vector<TestField> fields;
    std::uint32_t height = 1, width = 0, point_step = 0, row_step = 0;
    std::uint8_t big_endian = 0;
    std::vector<std::uint8_t> data;

    RawMessage message(Stamp stamp = 5'000'000'006) const {
        ByteWriter out;
        out.header(stamp).add(height).add(width);
        out.add(static_cast<std::uint32_t>(fields.size()));
        for (const TestField& f : fields) {
            out.text(f.name).add(f.offset).add(f.datatype).add(std::uint32_t{1});
        }
        out.add(big_endian).add(point_step).add(row_step);
        out.add(static_cast<std::uint32_t>(data.size())).append(data).add(std::uint8_t{1});
        return {"sensor_msgs/PointCloud2", out.bytes()};
    }
};

}  // namespace d2lio::ros1
