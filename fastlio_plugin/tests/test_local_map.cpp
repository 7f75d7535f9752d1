// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "local_map.hpp"

namespace d2lio::fastlio {
namespace {

HostConfig small_box() {
    HostConfig c;
    c.cube_side_length = 100.0;
    c.det_range = 20.0;  // faces keep 30 m away, so the box moves after 20 m, by 18 m
    return c;
}

Nearest found(const IkdTree& tree, const Eigen::Vector3f& p) {
    Nearest n;
    n.count = tree.knn(p, Nearest::kMost, std::numeric_limits<float>::infinity(), n.items.data());
    return n;
}

/// Points every metre along x, from -49 to 49.
std::vector<Eigen::Vector3f> line() {
    std::vector<Eigen::Vector3f> points;
    for (int i = -49; i <= 49; ++i) points.emplace_back(static_cast<float>(i), 0.F, 0.F);
    return points;
}

TEST(LocalMap, TheBoxRestsWhileTheSensorIsFarFromItsFaces) {
    LocalMap map(small_box());
    map.build(line());
    map.follow(Vec3::Zero());
    map.follow(Vec3(19.0, -19.0, 0.0));
    EXPECT_EQ(map.tree().size(), 99U);
}

TEST(LocalMap, TheBoxFollowsAndForgetsWhatItLeaves) {
    LocalMap map(small_box());
    map.build(line());
    map.follow(Vec3::Zero());
    map.follow(Vec3(21.0, 0.0, 0.0));  // box was [-50, 50), becomes [-32, 68)
    EXPECT_EQ(map.tree().size(), 82U);
    EXPECT_EQ(map.tree().bounds().min.x(), -32.F);
}

TEST(LocalMap, ALongDriveKeepsABoundedMap) {
    LocalMap map(small_box());
    map.build({Eigen::Vector3f::Zero()});
    std::size_t largest = 0;
    for (int i = 0; i < 5000; ++i) {
        const auto x = static_cast<float>(i);
        map.follow(Vec3(i, 0.0, 0.0));
        map.insert({{x, 0.F, 0.F}, {x, 5.F, 0.F}}, {});
        largest = std::max(largest, map.tree().size());
    }
    EXPECT_LT(largest, 260U);
    EXPECT_LT(map.tree().memory_bytes(), 1U << 20U);
}

TEST(LocalMap, ABoxTooSmallForItsRuleIsEnlarged) {
    HostConfig c = small_box();
    c.det_range = 50.0;  // the faces would always be too near
    LocalMap map(c);
    map.build(line());
    map.follow(Vec3::Zero());
    for (int i = 0; i < 100; ++i) map.follow(Vec3(0.1 * i, 0.0, 0.0));
    EXPECT_EQ(map.tree().size(), 99U);
}

TEST(LocalMap, APointNearerToTheVoxelCentreKeepsANewOneOut) {
    LocalMap map(HostConfig{});  // 0.5 m voxels: centre of the first is 0.25
    map.build({{0.25F, 0.25F, 0.25F}});
    const Eigen::Vector3f worse(0.1F, 0.1F, 0.1F);
    map.insert({worse}, {found(map.tree(), worse)});
    EXPECT_EQ(map.tree().size(), 1U);
}

TEST(LocalMap, ABetterPointTakesTheVoxel) {
    LocalMap map(HostConfig{});
    map.build({{0.1F, 0.1F, 0.1F}});
    const Eigen::Vector3f better(0.24F, 0.24F, 0.24F);
    map.insert({better}, {found(map.tree(), better)});
    ASSERT_EQ(map.tree().size(), 1U);
    EXPECT_EQ(map.tree().points()[0], better);
}

TEST(LocalMap, FillingEmptyVoxelsOnlyLeavesWhatIsThere) {
    LocalMap map(HostConfig{});
    const Eigen::Vector3f old(0.1F, 0.1F, 0.1F), better(0.24F, 0.24F, 0.24F),
        beside(0.6F, 0.1F, 0.1F);
    map.build({old});
    map.insert({better, beside}, {found(map.tree(), better), found(map.tree(), beside)},
               LocalMap::Fill::kEmpty);
    const auto points = map.tree().points();
    ASSERT_EQ(points.size(), 2U);
    EXPECT_EQ(std::count(points.begin(), points.end(), old), 1);
    EXPECT_EQ(std::count(points.begin(), points.end(), beside), 1);
}

TEST(LocalMap, PointsApartFromTheMapGoInWithoutDownSampling) {
    // FAST-LIO2: nearest neighbour off the voxel's centre by more than half a voxel in all axes.
    LocalMap map(HostConfig{});
    map.build({{5.F, 5.F, 5.F}});
    const std::vector<Eigen::Vector3f> same_voxel{{0.1F, 0.1F, 0.1F}, {0.2F, 0.2F, 0.2F}};
    map.insert(same_voxel, {found(map.tree(), same_voxel[0]), found(map.tree(), same_voxel[1])});
    EXPECT_EQ(map.tree().size(), 3U);
}

}  // namespace
}  // namespace d2lio::fastlio
