// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "d2lio/types.hpp"

namespace d2lio::ros1 {

/// Reads a serialised ROS 1 message (little endian, unpadded). A read past the end gives zeros and
/// makes ok() false for good, so that callers check once.
class ByteReader {
  public:
    ByteReader(const std::uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

    template <typename T>
    T read() {
        T value{};
        if (const std::uint8_t* from = take(sizeof(T))) std::memcpy(&value, from, sizeof(T));
        return value;
    }
    /// Start of the next `size` bytes, or null.
    const std::uint8_t* take(std::size_t size) {
        if (size > left()) {
            ok_ = false;
            at_ = end_;
            return nullptr;
        }
        const std::uint8_t* from = at_;
        at_ += size;
        return from;
    }
    std::string text() {
        const auto size = read<std::uint32_t>();
        const std::uint8_t* from = take(size);
        return from ? std::string(reinterpret_cast<const char*>(from), size) : std::string();
    }
    /// A std_msgs/Header; returns its stamp, ns.
    Stamp header() {
        read<std::uint32_t>();
        const auto sec = read<std::uint32_t>();
        const auto nsec = read<std::uint32_t>();
        text();
        return Stamp{sec} * 1'000'000'000 + nsec;
    }
    std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }
    bool ok() const { return ok_; }

  private:
    const std::uint8_t *at_, *end_;
    bool ok_ = true;
};

}  // namespace d2lio::ros1
