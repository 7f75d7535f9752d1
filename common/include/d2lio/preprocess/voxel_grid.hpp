// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace d2lio {

/// Down-samples a cloud to one centroid per voxel, as PCL's VoxelGrid does: same voxels
/// (floor(x * (1 / leaf)) in float), centroids in float, output by rising voxel index with x
/// running fastest and z slowest. Unlike PCL the sum inside a voxel runs in input order, so results
/// repeat to the bit, and an extent of any size is accepted. Reuses its buffers: in steady state it
/// allocates nothing. One object per thread.
class VoxelGrid {
  public:
    /// @param leaf side of a voxel, m. @throws ConfigError unless finite and > 0.
    explicit VoxelGrid(float leaf);

    /// Replaces `out` (not the same object as `in`) by the centroids, m. Points with a non-finite
    /// coordinate are dropped; returns how many were.
    std::size_t filter(const std::vector<Eigen::Vector3f>& in, std::vector<Eigen::Vector3f>& out);
    float leaf() const { return leaf_; }

  private:
    struct Item {
        std::uint64_t key;    ///< voxel index
        std::uint32_t index;  ///< of the point in the input
    };
    using Cell = std::array<float, 3>;

    Cell cell(const Eigen::Vector3f& p) const;
    void collect_finite(const std::vector<Eigen::Vector3f>& in);
    bool make_keys(const std::vector<Eigen::Vector3f>& in);
    void rank_cells(const std::vector<Eigen::Vector3f>& in);
    void sort_items();
    void average(const std::vector<Eigen::Vector3f>& in, std::vector<Eigen::Vector3f>& out) const;

    float leaf_, inverse_leaf_;
    Cell lowest_{}, highest_{};
    std::uint64_t largest_key_ = 0;
    std::vector<Item> items_, sorted_;
};

/// VoxelGrid(leaf).filter(in, out).
std::size_t voxel_grid(const std::vector<Eigen::Vector3f>& in, float leaf,
                       std::vector<Eigen::Vector3f>& out);

}  // namespace d2lio
