// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <type_traits>

#include "d2lio/ros1/byte_reader.hpp"
#include "d2lio/ros1/decode.hpp"

namespace d2lio::ros1 {
namespace {

const std::vector<std::string> kTimeFields{"time", "t", "timestamp", "offset_time", "time_stamp"};
const std::vector<std::string> kRingFields{"ring", "channel", "line"};
const std::vector<std::string> kIntensityFields{"intensity", "reflectivity"};

/// sensor_msgs/PointField: its datatype constants count from 1.
struct Field {
    std::string name;
    std::uint32_t offset = 0, count = 0;
    std::uint8_t datatype = 0;

    std::size_t size() const {
        constexpr std::size_t sizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
        return datatype <= 8 ? sizes[datatype] : 0;
    }
    bool is_integer() const { return datatype <= 6; }
};

struct Cloud {
    std::vector<Field> fields;
    std::size_t height = 0, width = 0, point_step = 0, row_step = 0;
    bool big_endian = false;
    const std::uint8_t* data = nullptr;
    std::size_t data_size = 0;

    std::size_t size() const { return height * width; }
    const Field* find(const std::string& name) const {
        const auto it = std::find_if(fields.begin(), fields.end(),
                                     [&](const Field& f) { return f.name == name; });
        return it == fields.end() ? nullptr : &*it;
    }
    const Field* first_of(const std::vector<std::string>& names) const {
        for (const std::string& name : names) {
            if (const Field* field = find(name)) return field;
        }
        return nullptr;
    }
    std::string names() const {
        std::string out;
        for (const Field& f : fields) out += (out.empty() ? "" : ", ") + f.name;
        return out;
    }
};

template <typename T>
T swapped(T value) {
    std::uint8_t bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    std::reverse(bytes, bytes + sizeof(T));
    std::memcpy(&value, bytes, sizeof(T));
    return value;
}

/// Calls f(index, value) with every point's value of a field, in memory order.
template <typename T, typename F>
void each_value(const Cloud& cloud, const Field& field, const F& f) {
    std::size_t i = 0;
    for (std::size_t row = 0; row < cloud.height; ++row) {
        const std::uint8_t* at = cloud.data + row * cloud.row_step + field.offset;
        for (std::size_t column = 0; column < cloud.width; ++column, at += cloud.point_step) {
            T value;
            std::memcpy(&value, at, sizeof(T));
            f(i++, cloud.big_endian ? swapped(value) : value);
        }
    }
}

template <typename F>
void each(const Cloud& cloud, const Field& field, const F& f) {
    switch (field.datatype) {
        case 1:
            return each_value<std::int8_t>(cloud, field, f);
        case 2:
            return each_value<std::uint8_t>(cloud, field, f);
        case 3:
            return each_value<std::int16_t>(cloud, field, f);
        case 4:
            return each_value<std::uint16_t>(cloud, field, f);
        case 5:
            return each_value<std::int32_t>(cloud, field, f);
        case 6:
            return each_value<std::uint32_t>(cloud, field, f);
        case 7:
            return each_value<float>(cloud, field, f);
        default:
            return each_value<double>(cloud, field, f);
    }
}

/// What a driver that stores rings as real numbers means; 0 for what is none.
template <typename T>
std::uint16_t to_ring(T value) {
    if constexpr (std::is_floating_point_v<T>) {
        const bool fits = value >= T{0} && value <= T{65535};
        return fits ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
    } else {
        return static_cast<std::uint16_t>(value);
    }
}

bool read(const RawMessage& message, Stamp& stamp, Cloud& cloud) {
    ByteReader in(message.bytes.data(), message.bytes.size());
    stamp = in.header();
    cloud.height = in.read<std::uint32_t>();
    cloud.width = in.read<std::uint32_t>();
    const auto field_count = in.read<std::uint32_t>();
    for (std::uint32_t i = 0; i < field_count && in.ok(); ++i) {
        Field field;
        field.name = in.text();
        field.offset = in.read<std::uint32_t>();
        field.datatype = in.read<std::uint8_t>();
        field.count = in.read<std::uint32_t>();
        cloud.fields.push_back(field);
    }
    cloud.big_endian = in.read<std::uint8_t>() != 0;
    cloud.point_step = in.read<std::uint32_t>();
    cloud.row_step = in.read<std::uint32_t>();
    cloud.data_size = in.read<std::uint32_t>();
    cloud.data = in.take(cloud.data_size);
    in.read<std::uint8_t>();  // is_dense: drivers claim it wrongly, every point is looked at
    if (cloud.row_step == 0) cloud.row_step = cloud.width * cloud.point_step;
    return in.ok();
}

bool fits(const Cloud& cloud, std::string& error) {
    for (const Field& f : cloud.fields) {
        if (f.size() == 0) {
            error = "PointCloud2 field '" + f.name + "' has unknown datatype " +
                    std::to_string(f.datatype);
            return false;
        }
        if (f.offset + f.size() * std::max<std::size_t>(f.count, 1) > cloud.point_step) {
            error = "PointCloud2 field '" + f.name + "' reaches beyond point_step " +
                    std::to_string(cloud.point_step);
            return false;
        }
    }
    if (cloud.size() == 0) return true;
    if (cloud.point_step > 0 && cloud.row_step >= cloud.width * cloud.point_step &&
        cloud.data_size / cloud.row_step >= cloud.height) {
        return true;
    }
    error = "PointCloud2 claims " + std::to_string(cloud.height) + " x " +
            std::to_string(cloud.width) + " points of " + std::to_string(cloud.point_step) +
            " bytes (row_step " + std::to_string(cloud.row_step) + ") but holds " +
            std::to_string(cloud.data_size) + " bytes";
    return false;
}

bool read_xyz(const Cloud& cloud, std::vector<LidarPoint>& points, std::string& error) {
    const std::pair<const char*, float LidarPoint::*> axes[] = {
        {"x", &LidarPoint::x}, {"y", &LidarPoint::y}, {"z", &LidarPoint::z}};
    for (const auto& [name, member] : axes) {
        const Field* field = cloud.find(name);
        if (field == nullptr) {
            error = std::string("PointCloud2 has no field ") + name + "; it holds " + cloud.names();
            return false;
        }
        each(cloud, *field, [&points, m = member](std::size_t i, auto v) {
            points[i].*m = static_cast<float>(v);
        });
    }
    return true;
}

void read_times(const Cloud& cloud, const Field& field, RawScan& out) {
    if (field.is_integer()) {
        out.integer_times.resize(cloud.size());
        each(cloud, field, [&out](std::size_t i, auto v) {
            out.integer_times[i] = static_cast<std::int64_t>(v);
        });
    } else {
        out.real_times.resize(cloud.size());
        each(cloud, field,
             [&out](std::size_t i, auto v) { out.real_times[i] = static_cast<double>(v); });
    }
}

}  // namespace

bool decode_point_cloud2(const RawMessage& message, const std::string& time_field, RawScan& out,
                         std::string& error) {
    Cloud cloud;
    if (!read(message, out.stamp, cloud)) {
        error = "PointCloud2 of " + std::to_string(message.bytes.size()) + " bytes is truncated";
        return false;
    }
    if (!fits(cloud, error)) return false;
    out.points.resize(cloud.size());
    if (!read_xyz(cloud, out.points, error)) return false;
    const Field* time = time_field.empty() ? cloud.first_of(kTimeFields) : cloud.find(time_field);
    if (time == nullptr && !time_field.empty()) {
        error = "PointCloud2 has no time field '" + time_field + "'; it holds " + cloud.names();
        return false;
    }
    if (time != nullptr) read_times(cloud, *time, out);
    if (const Field* field = cloud.first_of(kRingFields)) {
        each(cloud, *field, [&out](std::size_t i, auto v) { out.points[i].ring = to_ring(v); });
    }
    if (const Field* field = cloud.first_of(kIntensityFields)) {
        each(cloud, *field,
             [&out](std::size_t i, auto v) { out.points[i].intensity = static_cast<float>(v); });
    }
    return true;
}

}  // namespace d2lio::ros1
