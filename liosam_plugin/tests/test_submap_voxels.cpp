// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "d2lio/preprocess/voxel_grid.hpp"
#include "random_state.hpp"
#include "submap_voxels.hpp"

namespace d2lio::liosam {
namespace {

using Points = std::vector<Eigen::Vector3f>;

constexpr float kLeaf = 0.4F;
constexpr double kCut = 0.4 / 65536.0;  ///< rounding of a coordinate, m

/// Points of a voxel's inside, so that rounding cannot move them over a border.
Points cloud(std::size_t n, int half_voxels, unsigned seed) {
    test::Random random(seed);
    Points points;
    for (std::size_t i = 0; i < n; ++i) {
        Eigen::Vector3f p;
        for (Eigen::Index a = 0; a < 3; ++a) {
            const double voxel = std::floor(random.uniform(-half_voxels, half_voxels));
            p[a] = static_cast<float>((voxel + random.uniform(0.01, 0.99)) * 0.4);
        }
        points.push_back(p);
    }
    return points;
}

Points sorted(Points points) {
    std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
        return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
    });
    return points;
}

Points centroids(const SubmapVoxels& voxels, const Vec3& centre = Vec3::Zero()) {
    Points out;
    voxels.centroids(centre, out);
    return sorted(out);
}

TEST(SubmapVoxels, EqualsTheVoxelGridButForTheCut) {
    const Points in = cloud(20000, 20, 1);
    SubmapVoxels voxels(kLeaf);
    voxels.add(in, Pose());
    EXPECT_TRUE(voxels.apply());
    Points expected;
    voxel_grid(in, kLeaf, expected);
    ASSERT_EQ(voxels.size(), expected.size());
    Points out;
    voxels.centroids(Vec3::Zero(), out);
    const auto by_voxel = [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
        const auto key = [](const Eigen::Vector3f& p) {
            return std::make_tuple(std::floor(p.z() / kLeaf), std::floor(p.y() / kLeaf),
                                   std::floor(p.x() / kLeaf));
        };
        return key(a) < key(b);
    };
    std::sort(out.begin(), out.end(), by_voxel);
    for (std::size_t i = 0; i < out.size(); ++i) {
        ASSERT_LT((out[i] - expected[i]).cwiseAbs().maxCoeff(), 1.5 * kCut) << i;
    }
}

TEST(SubmapVoxels, CutIsNotBiased) {
    SubmapVoxels voxels(kLeaf);
    const Points in = cloud(20000, 1, 2);
    voxels.add(in, Pose());
    voxels.apply();
    Points expected;
    voxel_grid(in, kLeaf, expected);
    const Points out = centroids(voxels), reference = sorted(expected);
    ASSERT_EQ(out.size(), 8U);
    for (std::size_t i = 0; i < 8; ++i) {
        // Averages of 2500 roundings; a plain cut would leave half a unit.
        EXPECT_LT((out[i] - reference[i]).cwiseAbs().maxCoeff(), 0.2 * kCut);
    }
}

TEST(SubmapVoxels, PoseCarriesPointsToTheMap) {
    Pose pose;
    pose.R = exp_so3(Vec3(0.0, 0.0, std::acos(0.0)));
    pose.t = Vec3(10.0, -5.0, 1.1);
    SubmapVoxels voxels(kLeaf);
    voxels.add({{1.1F, 0.1F, 0.2F}}, pose);
    voxels.apply();
    const Points out = centroids(voxels, pose.t);
    ASSERT_EQ(out.size(), 1U);
    EXPECT_LT((out[0] - Eigen::Vector3f(9.9F, -3.9F, 1.3F)).norm(), 2e-5F);
}

TEST(SubmapVoxels, WhatLeavesTakesAwayWhatItBrought) {
    test::Random random(5);
    const Points a = cloud(3000, 20, 6), b = cloud(3000, 20, 7), c = cloud(3000, 20, 8);
    const Pose at_b{random.rotation(), random.vec3(5.0)}, at_c{random.rotation(), random.vec3(5.0)};
    SubmapVoxels plain(kLeaf), eventful(kLeaf);
    plain.add(a, Pose());
    plain.apply();
    eventful.add(b, at_b);
    eventful.apply();
    eventful.add(a, Pose());
    eventful.add(c, at_c);
    eventful.subtract(b, at_b);
    eventful.apply();
    EXPECT_NE(centroids(eventful), centroids(plain));
    eventful.subtract(c, at_c);
    EXPECT_TRUE(eventful.apply());
    EXPECT_EQ(centroids(eventful), centroids(plain));
    eventful.subtract(a, Pose());
    eventful.apply();
    EXPECT_EQ(eventful.size(), 0U);
}

TEST(SubmapVoxels, OrderOfCloudsAndBatchesDoNotMatter) {
    const Points a = cloud(200000, 40, 9), b = cloud(200000, 40, 10), c = cloud(200000, 40, 11);
    SubmapVoxels at_once(kLeaf), one_by_one(kLeaf);
    for (const Points* points : {&a, &b, &c}) at_once.add(*points, Pose());  // more than a batch
    EXPECT_TRUE(at_once.apply());
    for (const Points* points : {&c, &a, &b}) {
        one_by_one.add(*points, Pose());
        one_by_one.apply();
    }
    EXPECT_EQ(centroids(at_once), centroids(one_by_one));
    Points joined = a, expected;
    joined.insert(joined.end(), b.begin(), b.end());
    joined.insert(joined.end(), c.begin(), c.end());
    voxel_grid(joined, kLeaf, expected);
    EXPECT_EQ(at_once.size(), expected.size());
}

TEST(SubmapVoxels, TellsWhetherAnythingCameOrWent) {
    SubmapVoxels voxels(kLeaf);
    EXPECT_FALSE(voxels.apply());
    voxels.add({}, Pose());
    EXPECT_FALSE(voxels.apply());
    voxels.add({{1.F, 1.F, 1.F}}, Pose());
    EXPECT_TRUE(voxels.apply());
    EXPECT_FALSE(voxels.apply());
    voxels.clear();
    EXPECT_TRUE(voxels.apply());
    EXPECT_EQ(voxels.size(), 0U);
}

TEST(SubmapVoxels, HugeCoordinatesKeepTheShape) {
    const Points in = cloud(2000, 20, 12);
    for (const double offset : {1e6, -1e6, 1e8}) {
        Pose pose;
        pose.t = Vec3(offset, -offset, 0.0);
        SubmapVoxels voxels(kLeaf);
        voxels.add(in, pose);
        voxels.apply();
        const Points out = centroids(voxels, pose.t + Vec3(-2000.0, 1000.0, 2000.0));
        EXPECT_GT(out.size(), 1500U);
        // The float next to it, plus half the cloud.
        const float spacing = std::nextafter(std::abs(static_cast<float>(offset)), 2e9F) -
                              std::abs(static_cast<float>(offset));
        for (const Eigen::Vector3f& p : out) {
            ASSERT_LT(std::abs(static_cast<double>(p.x()) - offset), 8.0 + spacing);
            ASSERT_LT(std::abs(static_cast<double>(p.y()) + offset), 8.0 + spacing);
            ASSERT_LT(std::abs(p.z()), 8.0F);
        }
        voxels.subtract(in, pose);
        voxels.apply();
        EXPECT_EQ(voxels.size(), 0U);
    }
}

TEST(SubmapVoxels, KeysDoNotRepeatWithinReachAtTheSmallestLeaf) {
    const float r = SubmapVoxels::kReach;
    const Points in{{r, 0, 0}, {-r, 0, 0}, {0, r, 0}, {0, -r, 0}, {0, 0, r}, {0, 0, -r}};
    for (const double at : {-3000.0, 0.0, 3000.0}) {
        Pose pose;
        pose.t = Vec3(at, at, at);
        SubmapVoxels voxels(0.01F);
        voxels.add(in, pose);
        voxels.apply();
        Points expected;
        for (const Eigen::Vector3f& p : in) expected.push_back(p + pose.t.cast<float>());
        const Points out = centroids(voxels);
        ASSERT_EQ(out.size(), in.size());
        for (const Eigen::Vector3f& p : expected) {
            EXPECT_TRUE(std::any_of(out.begin(), out.end(), [&p](const Eigen::Vector3f& q) {
                return (p - q).norm() < 2e-3F;  // of floats at 8 km
            })) << p.transpose();
        }
    }
}

}  // namespace
}  // namespace d2lio::liosam
