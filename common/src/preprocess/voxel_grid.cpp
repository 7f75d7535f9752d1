// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/voxel_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>

#include "d2lio/config/params.hpp"

namespace d2lio {

VoxelGrid::VoxelGrid(float leaf) : leaf_(leaf), inverse_leaf_(1.0F / leaf) {
    if (!(leaf > 0.0F) || !std::isfinite(leaf) || !std::isfinite(inverse_leaf_)) {
        throw ConfigError("voxel_grid.leaf", std::to_string(leaf), "> 0 m");
    }
}

std::size_t VoxelGrid::filter(const std::vector<Eigen::Vector3f>& in,
                              std::vector<Eigen::Vector3f>& out) {
    out.clear();
    collect_finite(in);
    if (items_.empty()) return in.size();
    if (!make_keys(in)) rank_cells(in);
    sort_items();
    average(in, out);
    return in.size() - items_.size();
}

VoxelGrid::Cell VoxelGrid::cell(const Eigen::Vector3f& p) const {
    constexpr float kMax = std::numeric_limits<float>::max();  // keeps infinity out
    const auto index = [&](float v) {
        return std::clamp(std::floor(v * inverse_leaf_), -kMax, kMax);
    };
    return {index(p.x()), index(p.y()), index(p.z())};
}

void VoxelGrid::collect_finite(const std::vector<Eigen::Vector3f>& in) {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    Eigen::Vector3f low = Eigen::Vector3f::Constant(kInfinity), high = -low;
    items_.resize(in.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < in.size(); ++i) {
        const Eigen::Vector3f& p = in[i];
        if (p.x() * 0.0F + p.y() * 0.0F + p.z() * 0.0F != 0.0F) continue;  // NaN or infinite
        items_[count++].index = static_cast<std::uint32_t>(i);
        for (Eigen::Index a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], p[a]);
            high[a] = std::max(high[a], p[a]);
        }
    }
    items_.resize(count);
    lowest_ = cell(low);
    highest_ = cell(high);
}

/// Voxel indices as one number; false where the grid has too many voxels for 64 bits.
bool VoxelGrid::make_keys(const std::vector<Eigen::Vector3f>& in) {
    constexpr double kMostVoxels = 9.0e18;  // < 2^63, of the grid and from the origin
    std::array<std::uint64_t, 3> size{};
    std::array<std::int64_t, 3> low{};
    double voxels = 1.0;
    for (unsigned a = 0; a < 3; ++a) {
        const double from = static_cast<double>(lowest_[a]), to = static_cast<double>(highest_[a]);
        voxels *= to - from + 1.0;
        if (std::max({voxels, -from, to}) > kMostVoxels) return false;
        low[a] = static_cast<std::int64_t>(from);
        size[a] = static_cast<std::uint64_t>(to - from + 1.0);
    }
    for (Item& item : items_) {
        const Eigen::Vector3f scaled = in[item.index] * inverse_leaf_;
        const auto step = [&scaled, &low](unsigned a) {
            const float v = scaled[static_cast<Eigen::Index>(a)];
            const auto truncated = static_cast<std::int64_t>(v);  // cheaper than std::floor
            const std::int64_t below = static_cast<float>(truncated) > v ? 1 : 0;
            return static_cast<std::uint64_t>(truncated - below - low[a]);
        };
        item.key = step(0) + size[0] * (step(1) + size[1] * step(2));
    }
    largest_key_ = size[0] * size[1] * size[2] - 1;
    return true;
}

/// Keys for a grid beyond 64 bits: the rank of each occupied voxel in the same order.
void VoxelGrid::rank_cells(const std::vector<Eigen::Vector3f>& in) {
    const auto order = [&](const Item& item) {
        const Cell c = cell(in[item.index]);
        return std::make_tuple(c[2], c[1], c[0]);
    };
    std::sort(items_.begin(), items_.end(), [&](const Item& a, const Item& b) {
        return std::make_pair(order(a), a.index) < std::make_pair(order(b), b.index);
    });
    items_[0].key = 0;
    for (std::size_t i = 1; i < items_.size(); ++i) {
        items_[i].key = items_[i - 1].key + (order(items_[i]) == order(items_[i - 1]) ? 0 : 1);
    }
    largest_key_ = items_.back().key;
}

/// Least significant digit first radix sort: stable, so a voxel's points keep their input order.
void VoxelGrid::sort_items() {
    constexpr unsigned kDigitBits = 11;
    constexpr std::uint64_t kDigits = 1U << kDigitBits;
    sorted_.resize(items_.size());
    for (unsigned shift = 0; shift < 64 && (largest_key_ >> shift) > 0; shift += kDigitBits) {
        std::array<std::uint32_t, kDigits> begin{};
        for (const Item& item : items_) ++begin[(item.key >> shift) % kDigits];
        std::uint32_t next = 0;
        for (std::uint32_t& slot : begin) next += std::exchange(slot, next);
        for (const Item& item : items_) sorted_[begin[(item.key >> shift) % kDigits]++] = item;
        items_.swap(sorted_);
    }
}

void VoxelGrid::average(const std::vector<Eigen::Vector3f>& in,
                        std::vector<Eigen::Vector3f>& out) const {
    for (std::size_t first = 0, last = 0; first < items_.size(); first = last) {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (; last < items_.size() && items_[last].key == items_[first].key; ++last) {
            sum += in[items_[last].index];
        }
        out.push_back(sum / static_cast<float>(last - first));
    }
}

std::size_t voxel_grid(const std::vector<Eigen::Vector3f>& in, float leaf,
                       std::vector<Eigen::Vector3f>& out) {
    return VoxelGrid(leaf).filter(in, out);
}

}  // namespace d2lio
