// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "d2lio/map/ikd_tree.hpp"
#include "d2lio/types.hpp"
#include "submap_options.hpp"
#include "submap_selection.hpp"
#include "submap_voxels.hpp"

namespace d2lio::liosam {

/// A scan that stays, with its clouds in the IMU frame, m.
struct Keyframe {
    Pose pose;  ///< T_map_imu
    Stamp stamp = 0;
    std::vector<Eigen::Vector3f> corners, surfaces;
    bool has_clouds = true;  ///< false once the clouds gave way to nearer ones
};

/// All keyframes, and the sliding submap around the newest one that scans are matched against
/// (Shan et al. 2020, "LIO-SAM", section III-C).
///
/// The submap depends on the keyframes chosen, their clouds and their poses, to the bit, and not on
/// how the selection came about. Coordinates in the trees are floats in the map frame: 4 um at 50 m
/// from the origin, 6 cm at 1e6 m. Memory is bounded but for some 300 bytes per keyframe. Any
/// number of threads may call const members at a time, but none while another is in a non-const
/// one.
class KeyframeMap {
  public:
    static constexpr double kMostCoordinate = 1e8;  ///< m, of a pose that is accepted

    /// @throws ConfigError for an option outside its range.
    explicit KeyframeMap(const SubmapOptions& options = {});

    /// Whether a scan at `pose` (T_map_imu) becomes a keyframe: it moved `keyframe_distance` or
    /// turned `keyframe_angle` about one axis from the newest, or `keyframe_interval_s` went by.
    /// The first always does, a pose that add() refuses never.
    bool due(const Pose& pose, Stamp stamp) const;
    /// Appends a keyframe; stamps rise. Points (IMU frame, m) that are not finite or farther than
    /// SubmapVoxels::kReach are dropped. Beyond `max_clouds` the clouds farthest from here go, the
    /// older ones first.
    /// @returns false, and nothing happens, if the pose is not finite, not a rotation, or too far
    bool add(const Pose& pose, Stamp stamp, std::vector<Eigen::Vector3f> corners,
             std::vector<Eigen::Vector3f> surfaces);
    /// Corrects the pose of keyframe `i`; the submap follows at the next refresh().
    /// @returns false, and nothing happens, for such a pose as add() refuses or an `i` >= size()
    bool set_pose(std::size_t i, const Pose& pose);
    /// Chooses the submap's keyframes for a scan at `now` and brings the trees up to date.
    /// @returns whether that changed a tree
    bool refresh(Stamp now);
    void clear();

    /// Submap as of the last refresh(): voxel centroids in the map frame, m.
    const IkdTree& corners() const { return corners_.tree; }
    const IkdTree& surfaces() const { return surfaces_.tree; }
    /// Indices of the keyframes in it, rising.
    std::vector<std::size_t> submap() const;

    bool empty() const { return keyframes_.empty(); }
    std::size_t size() const { return keyframes_.size(); }
    /// Keyframes whose clouds are in memory.
    std::size_t clouds() const { return keys_.size(); }
    /// Bytes reserved, in use or not.
    std::size_t memory_bytes() const;
    /// Valid until the next add() or clear().
    const Keyframe& operator[](std::size_t i) const { return keyframes_[i]; }
    const Keyframe& back() const { return keyframes_.back(); }
    const SubmapOptions& options() const { return options_; }

  private:
    /// One kind of feature.
    struct Layer {
        explicit Layer(float leaf);
        bool update(const Vec3& centre);
        void clear();
        std::size_t memory_bytes() const;

        SubmapVoxels voxels;
        IkdTree tree;
        std::vector<Eigen::Vector3f> centroids;
    };
    /// A keyframe in the submap, and the pose its clouds were entered with.
    struct Part {
        std::uint32_t index;
        Pose pose;
    };
    using Indices = std::vector<std::uint32_t>;

    void evict_farthest();
    void exchange_parts(const Indices& chosen);
    bool stays(const Part& part, const Indices& chosen) const;
    void enter(std::uint32_t index);
    void leave(const Part& part);

    SubmapOptions options_;
    std::vector<Keyframe> keyframes_;
    std::vector<KeyPosition> keys_;  ///< of those with clouds, by rising index
    std::size_t cloud_bytes_ = 0;
    SubmapSelector selector_;
    std::vector<Part> parts_, next_parts_;  ///< by rising index
    Layer corners_, surfaces_;
};

}  // namespace d2lio::liosam
