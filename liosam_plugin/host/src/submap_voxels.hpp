// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio::liosam {

/// Centroid per voxel of the union of several clouds, kept up to date as clouds come and go.
///
/// As VoxelGrid, but exactly reversible: coordinates are cut to 2^-16 of a voxel (6 um at 0.4 m)
/// and summed in integers, so a cloud that leaves takes away precisely what it brought, and the
/// centroids depend on the clouds that are in, not on those that were. Voxels are a list sorted by
/// key; coming and going points are sorted once and merged into it, which costs one pass over the
/// list and no hashing.
class SubmapVoxels {
  public:
    /// Farthest that a point may lie from its cloud's origin, m. With the largest search radius it
    /// stays below half of the 2^21 voxels after which keys repeat, at the smallest leaf.
    static constexpr float kReach = 5000.0F;

    /// @param leaf side of a voxel, m, >= 0.01
    explicit SubmapVoxels(float leaf);

    /// A cloud joins. Takes effect with the next apply(). All points finite and within kReach, the
    /// pose's rotation orthonormal and its translation below 1e8 m.
    /// @param points in the IMU frame, m
    void add(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu);
    /// A cloud leaves; `points` and pose are those it was added with.
    void subtract(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu);
    /// Merges what came and went. Returns whether anything had since the last call.
    bool apply();
    void clear();

    /// Replaces `out` by the centroids, m, in the map frame, in an order of no meaning.
    /// @param centre anywhere within 3000 m of the poses of all clouds that are in, m
    void centroids(const Vec3& centre, std::vector<Eigen::Vector3f>& out) const;
    std::size_t size() const { return voxels_.size(); }
    std::size_t memory_bytes() const;

  private:
    struct Change {
        std::uint64_t key;                      ///< voxel index modulo 2^21, x in the lowest bits
        std::array<std::uint16_t, 3> fraction;  ///< position in the voxel, 2^-16 of its side
        std::int16_t count;                     ///< 1 or -1
    };
    struct Voxel {
        std::uint64_t key;
        std::array<std::uint64_t, 3> sum;  ///< of fractions
        std::int64_t count;                ///< points

        void take(const Change& c);
    };

    void push(const std::vector<Eigen::Vector3f>& points, const Pose& T_map_imu, int count);
    void sort_changes();
    void merge_changes();

    double units_per_metre_;
    bool changed_ = false;
    std::vector<Voxel> voxels_, merged_;
    std::vector<Change> changes_, sorted_;
};

}  // namespace d2lio::liosam
