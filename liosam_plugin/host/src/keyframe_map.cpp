// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "keyframe_map.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace d2lio::liosam {

namespace {

using Points = std::vector<Eigen::Vector3f>;

const SubmapOptions& validated(const SubmapOptions& options) {
    validate(options);
    return options;
}

IkdTreeOptions tree_options(float leaf) {
    IkdTreeOptions options;
    options.downsample_leaf = leaf;
    return options;
}

bool usable(const Pose& pose) {
    constexpr double kTolerance = 1e-3;
    const Mat3 deviation = pose.R.transpose() * pose.R - Mat3::Identity();
    // Written so that NaN fails.
    return deviation.cwiseAbs().maxCoeff() <= kTolerance && pose.R.determinant() > 0.0 &&
           pose.t.allFinite() && pose.t.cwiseAbs().maxCoeff() <= KeyframeMap::kMostCoordinate;
}

bool equal(const Pose& a, const Pose& b) { return a.R == b.R && a.t == b.t; }

void keep_usable(Points& points) {
    constexpr float kMost = SubmapVoxels::kReach * SubmapVoxels::kReach;
    points.erase(
        std::remove_if(points.begin(), points.end(),
                       [](const Eigen::Vector3f& p) { return !(p.squaredNorm() <= kMost); }),
        points.end());
    points.shrink_to_fit();
}

std::size_t bytes(const Points& points) { return points.capacity() * sizeof(Eigen::Vector3f); }

void free_points(Points& points) { Points().swap(points); }

bool by_index(const KeyPosition& key, std::size_t index) { return key.index < index; }

}  // namespace

KeyframeMap::Layer::Layer(float leaf) : voxels(leaf), tree(tree_options(leaf)) {}

bool KeyframeMap::Layer::update(const Vec3& centre) {
    if (!voxels.apply()) return false;
    voxels.centroids(centre, centroids);
    tree.build(centroids);
    return true;
}

void KeyframeMap::Layer::clear() {
    voxels.clear();
    tree.clear();
}

std::size_t KeyframeMap::Layer::memory_bytes() const {
    return voxels.memory_bytes() + tree.memory_bytes() + bytes(centroids);
}

KeyframeMap::KeyframeMap(const SubmapOptions& options)
    : options_(validated(options)),
      selector_(options),
      corners_(options.corner_leaf),
      surfaces_(options.surface_leaf) {}

bool KeyframeMap::due(const Pose& pose, Stamp stamp) const {
    if (!usable(pose)) return false;
    if (empty()) return true;
    const double pause = seconds_between(stamp, back().stamp);
    if (options_.keyframe_interval_s > 0.0 && pause > options_.keyframe_interval_s) return true;
    const Pose motion = back().pose.inverse() * pose;
    const double roll = std::atan2(motion.R(2, 1), motion.R(2, 2));
    const double pitch = std::asin(std::clamp(-motion.R(2, 0), -1.0, 1.0));
    const double yaw = std::atan2(motion.R(1, 0), motion.R(0, 0));
    const double turn = std::max({std::abs(roll), std::abs(pitch), std::abs(yaw)});
    return turn >= options_.keyframe_angle || motion.t.norm() >= options_.keyframe_distance;
}

bool KeyframeMap::add(const Pose& pose, Stamp stamp, Points corners, Points surfaces) {
    if (!usable(pose)) return false;
    keep_usable(corners);
    keep_usable(surfaces);
    cloud_bytes_ += bytes(corners) + bytes(surfaces);
    keys_.push_back({static_cast<std::uint32_t>(size()), stamp, pose.t});
    keyframes_.push_back({pose, stamp, std::move(corners), std::move(surfaces), true});
    if (keys_.size() > options_.max_clouds) evict_farthest();
    return true;
}

void KeyframeMap::evict_farthest() {
    const auto sq_distance = [this](const KeyPosition& key) {
        return (key.position - back().pose.t).squaredNorm();
    };
    const auto farthest = std::max_element(
        keys_.begin(), keys_.end(), [&sq_distance](const KeyPosition& a, const KeyPosition& b) {
            return sq_distance(a) < sq_distance(b);
        });
    const std::uint32_t index = farthest->index;
    keys_.erase(farthest);
    const auto part = std::find_if(parts_.begin(), parts_.end(),
                                   [index](const Part& p) { return p.index == index; });
    if (part != parts_.end()) {
        leave(*part);
        parts_.erase(part);
    }
    Keyframe& keyframe = keyframes_[index];
    cloud_bytes_ -= bytes(keyframe.corners) + bytes(keyframe.surfaces);
    free_points(keyframe.corners);
    free_points(keyframe.surfaces);
    keyframe.has_clouds = false;
}

bool KeyframeMap::set_pose(std::size_t i, const Pose& pose) {
    if (i >= size() || !usable(pose)) return false;
    keyframes_[i].pose = pose;
    const auto key = std::lower_bound(keys_.begin(), keys_.end(), i, by_index);
    if (key != keys_.end() && key->index == i) key->position = pose.t;
    return true;
}

bool KeyframeMap::refresh(Stamp now) {
    if (empty()) return false;
    const Vec3 centre = back().pose.t;
    exchange_parts(selector_.select(keys_, centre, now));
    const bool corners_changed = corners_.update(centre);
    const bool surfaces_changed = surfaces_.update(centre);
    return corners_changed || surfaces_changed;
}

bool KeyframeMap::stays(const Part& part, const Indices& chosen) const {
    return std::binary_search(chosen.begin(), chosen.end(), part.index) &&
           equal(part.pose, keyframes_[part.index].pose);
}

/// Makes `parts_` the chosen keyframes at their present poses.
void KeyframeMap::exchange_parts(const Indices& chosen) {
    const auto staying = [&](const Part& part) { return stays(part, chosen); };
    const auto kept = std::count_if(parts_.begin(), parts_.end(), staying);
    if (2 * static_cast<std::size_t>(kept) < parts_.size()) {  // starting anew is less work
        corners_.voxels.clear();
        surfaces_.voxels.clear();
        parts_.clear();
    }
    next_parts_.clear();
    for (const Part& part : parts_) {
        if (staying(part)) {
            next_parts_.push_back(part);
        } else {
            leave(part);
        }
    }
    auto part = next_parts_.cbegin();
    parts_.clear();
    for (const std::uint32_t index : chosen) {
        if (part != next_parts_.cend() && part->index == index) {
            parts_.push_back(*part++);
        } else {
            enter(index);
        }
    }
}

void KeyframeMap::enter(std::uint32_t index) {
    const Keyframe& keyframe = keyframes_[index];
    parts_.push_back({index, keyframe.pose});
    corners_.voxels.add(keyframe.corners, keyframe.pose);
    surfaces_.voxels.add(keyframe.surfaces, keyframe.pose);
}

void KeyframeMap::leave(const Part& part) {
    corners_.voxels.subtract(keyframes_[part.index].corners, part.pose);
    surfaces_.voxels.subtract(keyframes_[part.index].surfaces, part.pose);
}

void KeyframeMap::clear() {
    keyframes_.clear();
    keys_.clear();
    parts_.clear();
    cloud_bytes_ = 0;
    corners_.clear();
    surfaces_.clear();
}

std::vector<std::size_t> KeyframeMap::submap() const {
    std::vector<std::size_t> indices;
    for (const Part& part : parts_) indices.push_back(part.index);
    return indices;
}

std::size_t KeyframeMap::memory_bytes() const {
    return sizeof(*this) + cloud_bytes_ + keyframes_.capacity() * sizeof(Keyframe) +
           keys_.capacity() * sizeof(KeyPosition) +
           (parts_.capacity() + next_parts_.capacity()) * sizeof(Part) + corners_.memory_bytes() +
           surfaces_.memory_bytes();
}

}  // namespace d2lio::liosam
