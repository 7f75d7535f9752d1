// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "submap_voxels.hpp"

#include <algorithm>
#include <utility>

namespace d2lio::liosam {

namespace {

constexpr unsigned kFractionBits = 16, kIndexBits = 21;
constexpr std::uint64_t kFractionMask = (1U << kFractionBits) - 1,
                        kIndexMask = (1U << kIndexBits) - 1;
constexpr double kUnits = 1U << kFractionBits;  ///< per voxel side
/// Changes that are merged at once; more are merged in between, to bound the buffers.
constexpr std::size_t kMostChanges = 1U << 19U;

std::int64_t floor_of(double v) {
    const auto truncated = static_cast<std::int64_t>(v);  // cheaper than std::floor
    return truncated - (static_cast<double>(truncated) > v ? 1 : 0);
}

/// The voxel index with the low bits `low` that is nearest to `near`.
std::int64_t index_near(std::uint64_t low, std::int64_t near) {
    constexpr std::int64_t kHalf = 1 << (kIndexBits - 1);
    const std::uint64_t ahead = (low - static_cast<std::uint64_t>(near - kHalf)) & kIndexMask;
    return near - kHalf + static_cast<std::int64_t>(ahead);
}

}  // namespace

SubmapVoxels::SubmapVoxels(float leaf) : units_per_metre_(kUnits / static_cast<double>(leaf)) {}

void SubmapVoxels::Voxel::take(const Change& c) {
    // A negative change wraps around in the unsigned sum, and back.
    const auto sign = static_cast<std::uint64_t>(static_cast<std::int64_t>(c.count));
    for (unsigned a = 0; a < 3; ++a) sum[a] += sign * c.fraction[a];
    count += c.count;
}

void SubmapVoxels::add(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu) {
    push(points, T_map_imu, 1);
}

void SubmapVoxels::subtract(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu) {
    push(points, T_map_imu, -1);
}

void SubmapVoxels::push(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu,
                        int count) {
    if (changes_.size() + points.size() > kMostChanges) merge_changes();
    for (const Eigen::Vector3f& p : points) {
        const Vec3 units = (T_map_imu * p.cast<double>()) * units_per_metre_;
        Change c{0, {}, static_cast<std::int16_t>(count)};
        for (unsigned a = 0; a < 3; ++a) {
            const auto unit =
                static_cast<std::uint64_t>(floor_of(units[static_cast<Eigen::Index>(a)]));
            c.fraction[a] = static_cast<std::uint16_t>(unit & kFractionMask);
            c.key |= ((unit >> kFractionBits) & kIndexMask) << (kIndexBits * a);
        }
        changes_.push_back(c);
    }
}

bool SubmapVoxels::apply() {
    merge_changes();
    return std::exchange(changed_, false);
}

void SubmapVoxels::clear() {
    changed_ = changed_ || !voxels_.empty();
    voxels_.clear();
    changes_.clear();
}

/// Radix sort, least significant digit first, leaving out digits that all keys share. The order
/// within a voxel does not matter, as integer sums commute.
void SubmapVoxels::sort_changes() {
    constexpr unsigned kDigitBits = 11;
    constexpr std::uint64_t kDigits = 1U << kDigitBits;
    std::uint64_t varying = 0;
    for (const Change& c : changes_) varying |= c.key ^ changes_.front().key;
    sorted_.resize(changes_.size());
    for (unsigned shift = 0; shift < 3 * kIndexBits; shift += kDigitBits) {
        if ((varying >> shift) % kDigits == 0) continue;
        std::array<std::uint32_t, kDigits> begin{};
        for (const Change& c : changes_) ++begin[(c.key >> shift) % kDigits];
        std::uint32_t next = 0;
        for (std::uint32_t& slot : begin) next += std::exchange(slot, next);
        for (const Change& c : changes_) sorted_[begin[(c.key >> shift) % kDigits]++] = c;
        changes_.swap(sorted_);
    }
}

void SubmapVoxels::merge_changes() {
    if (changes_.empty()) return;
    changed_ = true;
    sort_changes();
    merged_.clear();
    auto old = voxels_.cbegin();
    for (auto change = changes_.cbegin(); change != changes_.cend();) {
        const std::uint64_t key = change->key;
        const auto same =
            std::find_if(old, voxels_.cend(), [key](const Voxel& v) { return v.key >= key; });
        merged_.insert(merged_.end(), old, same);
        old = same;
        Voxel voxel{key, {}, 0};
        if (old != voxels_.cend() && old->key == key) voxel = *old++;
        for (; change != changes_.cend() && change->key == key; ++change) voxel.take(*change);
        if (voxel.count != 0) merged_.push_back(voxel);
    }
    merged_.insert(merged_.end(), old, voxels_.cend());
    voxels_.swap(merged_);
    changes_.clear();
}

void SubmapVoxels::centroids(const Vec3& centre, std::vector<Eigen::Vector3f>& out) const {
    out.clear();
    out.reserve(voxels_.size());
    std::array<std::int64_t, 3> middle{};
    for (unsigned a = 0; a < 3; ++a) {
        middle[a] = floor_of(centre[static_cast<Eigen::Index>(a)] * units_per_metre_ / kUnits);
    }
    const double unit = 1.0 / units_per_metre_;
    for (const Voxel& v : voxels_) {
        const double share = 1.0 / static_cast<double>(v.count);
        Eigen::Vector3f p;
        for (unsigned a = 0; a < 3; ++a) {
            const std::int64_t index =
                index_near((v.key >> (kIndexBits * a)) & kIndexMask, middle[a]);
            // Half a unit makes up for the cut of each point.
            const double mean = static_cast<double>(v.sum[a]) * share + 0.5;
            p[static_cast<Eigen::Index>(a)] =
                static_cast<float>((static_cast<double>(index) * kUnits + mean) * unit);
        }
        out.push_back(p);
    }
}

std::size_t SubmapVoxels::memory_bytes() const {
    return (voxels_.capacity() + merged_.capacity()) * sizeof(Voxel) +
           (changes_.capacity() + sorted_.capacity()) * sizeof(Change);
}

}  // namespace d2lio::liosam
