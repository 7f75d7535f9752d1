// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <tuple>

#include "d2lio/config/params.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"

namespace d2lio {
namespace {

using Points = std::vector<Eigen::Vector3f>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();

/// Voxel by voxel with an ordered map; the sum runs in input order as in the filter.
Points reference(const Points& in, float leaf) {
    std::map<std::tuple<float, float, float>, std::pair<Eigen::Vector3f, int>> voxels;
    const float inverse = 1.F / leaf;
    for (const Eigen::Vector3f& p : in) {
        if (!p.allFinite()) continue;
        const std::tuple<float, float, float> key(
            std::floor(p.z() * inverse), std::floor(p.y() * inverse), std::floor(p.x() * inverse));
        auto& [sum, count] =
            voxels.try_emplace(key, Eigen::Vector3f::Zero().eval(), 0).first->second;
        sum += p;
        ++count;
    }
    Points out;
    for (const auto& [key, voxel] : voxels) {
        out.push_back(voxel.first / static_cast<float>(voxel.second));
    }
    return out;
}

Points cloud(std::size_t n, float half, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> u(-half, half);
    Points points(n);
    for (Eigen::Vector3f& p : points) {
        p.x() = u(random);
        p.y() = u(random);
        p.z() = 0.1F * u(random);
    }
    return points;
}

TEST(VoxelGrid, EqualsTheReferenceToTheBit) {
    for (const float leaf : {0.1F, 0.5F, 3.F, 100.F}) {
        const Points in = cloud(20000, 40.F, 1);
        Points out;
        EXPECT_EQ(voxel_grid(in, leaf, out), 0U);
        EXPECT_EQ(out, reference(in, leaf));
    }
}

TEST(VoxelGrid, OutputRunsFastestAlongX) {
    Points out;
    voxel_grid({{1.5F, 1.5F, 1.5F}, {0.5F, 0.5F, 1.5F}, {0.5F, 1.5F, 0.5F}, {1.5F, 0.5F, 0.5F}},
               1.F, out);
    const Points expected{
        {1.5F, 0.5F, 0.5F}, {0.5F, 1.5F, 0.5F}, {0.5F, 0.5F, 1.5F}, {1.5F, 1.5F, 1.5F}};
    EXPECT_EQ(out, expected);
}

TEST(VoxelGrid, DropsAndCountsNonFinitePoints) {
    Points out{{9, 9, 9}};
    EXPECT_EQ(voxel_grid({{kNan, 0, 0}, {0, kInfF, 0}}, 1.F, out), 2U);
    EXPECT_TRUE(out.empty());
    EXPECT_EQ(voxel_grid({{0.25F, 0, 0}, {0, 0, -kInfF}, {0.75F, 0, 0}}, 1.F, out), 1U);
    EXPECT_EQ(out, (Points{{0.5F, 0, 0}}));
    EXPECT_EQ(voxel_grid({}, 1.F, out), 0U);
    EXPECT_TRUE(out.empty());
}

TEST(VoxelGrid, AcceptsExtentsBeyond32And64Bits) {
    for (const float half : {1e6F, 1e12F, 1.5e38F}) {
        Points in = cloud(3000, half, 2);
        const Points copy = in;
        in.insert(in.end(), copy.begin(), copy.end());
        in.emplace_back(0.01F, 0.01F, 0.01F);
        Points out;
        voxel_grid(in, 0.5F, out);
        EXPECT_EQ(out.size(), 3001U) << "extent " << half;
        EXPECT_EQ(out, reference(in, 0.5F)) << "extent " << half;
    }
}

TEST(VoxelGrid, ReusedObjectForgetsTheLastCloud) {
    VoxelGrid grid(0.5F);
    Points first, second, again;
    grid.filter(cloud(5000, 20.F, 3), first);
    grid.filter(cloud(100, 2.F, 4), second);
    grid.filter(cloud(5000, 20.F, 3), again);
    EXPECT_EQ(second, reference(cloud(100, 2.F, 4), 0.5F));
    EXPECT_EQ(first, again);
}

TEST(VoxelGrid, RefusesALeafThatIsNoLength) {
    for (const float leaf : {0.F, -1.F, kNan, kInfF, 1e-45F}) {
        EXPECT_THROW(VoxelGrid{leaf}, ConfigError);
    }
}

}  // namespace
}  // namespace d2lio
