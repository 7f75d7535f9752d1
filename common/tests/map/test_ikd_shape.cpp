// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "d2lio/map/ikd_tree.hpp"
#include "reference_map.hpp"

namespace d2lio::test {
namespace {

/// alpha-balance with 0.6 bounds the depth by log_{1/0.6}(n / 16); subtrees of fewer than 32 points
/// may add a few levels.
int depth_bound(std::size_t n) {
    return 6 +
           static_cast<int>(std::ceil(std::log(static_cast<double>(n) / 16.0) / -std::log(0.6)));
}

Points random_cloud(std::size_t n, unsigned seed, const Eigen::Vector3f& centre, float half) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> u(-half, half);
    Points points(n);
    for (Eigen::Vector3f& p : points) {
        p.x() = u(random);
        p.y() = u(random);
        p.z() = u(random);
        p += centre;
    }
    return points;
}

TEST(IkdTreeShape, StaysBalancedUnderSortedInsertion) {
    constexpr int kPoints = 50000;
    IkdTree tree;
    for (int i = 0; i < kPoints; ++i) {
        const float x = 0.01F * static_cast<float>(i);
        tree.insert({{x, 0.5F * x, 0.F}}, false);
    }
    EXPECT_TRUE(tree.consistent());
    EXPECT_LE(tree.depth(), depth_bound(kPoints));
}

TEST(IkdTreeShape, DuplicatesSpreadOverTheTree) {
    constexpr std::size_t kPoints = 20000;
    const Points same(kPoints, Eigen::Vector3f(1.F, 2.F, 3.F));
    IkdTree tree;
    tree.insert(same, false);
    EXPECT_TRUE(tree.consistent());
    EXPECT_LE(tree.depth(), depth_bound(kPoints));
    IkdTree built;
    built.build(same);
    EXPECT_LE(built.depth(), depth_bound(kPoints));
    EXPECT_EQ(built.erase({same[0]}), kPoints);
}

TEST(IkdTreeShape, StaysShallowWhenOnePlaceIsEmptiedAndRefilled) {
    constexpr std::size_t kPoints = 4000;
    IkdTree tree;
    tree.build(random_cloud(kPoints, 1, {0, 0, 0}, 10.F));
    for (unsigned round = 0; round < 300; ++round) {
        const float x = 0.01F * static_cast<float>(round);
        tree.insert(random_cloud(200, round, {x, 0, 0}, 0.1F), false);
        tree.erase_box({{x - 0.1F, -0.1F, -0.1F}, {x + 0.09F, 0.1F, 0.1F}});
    }
    EXPECT_TRUE(tree.consistent());
    EXPECT_LE(tree.depth(), depth_bound(2 * kPoints));
}

TEST(IkdTreeShape, MemoryIsBoundedOverLongCycles) {
    constexpr unsigned kWarmUp = 50, kRounds = 400;
    IkdTree tree;
    std::size_t after_warm_up = 0;
    for (unsigned round = 0; round < kRounds; ++round) {
        const Eigen::Vector3f centre(static_cast<float>(round), 0.F, 0.F);
        tree.insert(random_cloud(1000, round, centre, 5.F), round % 2 == 0);
        tree.erase_box({{-1e9F, -1e9F, -1e9F}, {centre.x() - 15.F, 1e9F, 1e9F}});
        if (round == kWarmUp) after_warm_up = tree.memory_bytes();
    }
    ASSERT_TRUE(tree.consistent());
    EXPECT_LE(tree.memory_bytes(), 2 * after_warm_up);
    EXPECT_LE(tree.nodes(), tree.size()) << "leaves must not be left almost empty";
}

TEST(IkdTreeShape, EmptiedLeavesAreMerged) {
    IkdTree tree;
    const Points cloud = random_cloud(20000, 3, {0, 0, 0}, 10.F);
    tree.build(cloud);
    const std::size_t full = tree.nodes();
    Points most(cloud.begin(), cloud.begin() + 18000);
    EXPECT_EQ(tree.erase(most), most.size());
    EXPECT_TRUE(tree.consistent());
    EXPECT_LT(tree.nodes(), full / 4);
}

TEST(IkdTreeShape, SameOperationsGiveTheSameBits) {
    const auto run = [] {
        IkdTree tree;
        std::vector<Neighbour> found;
        for (unsigned round = 0; round < 30; ++round) {
            tree.insert(random_cloud(2000, round, {0, 0, 0}, 8.F), round % 3 != 0);
            const float x = static_cast<float>(round) * 0.3F;
            tree.erase_box({{x - 1.F, -9.F, -9.F}, {x, 9.F, 0.F}});
            for (const Eigen::Vector3f& q : random_cloud(100, 1000 + round, {0, 0, 0}, 9.F)) {
                Neighbours n;
                tree.knn(q, 5, 5.F, n);
                found.insert(found.end(), n.items.begin(), n.items.begin() + n.count);
            }
        }
        return std::make_pair(found, tree.points());
    };
    const auto first = run(), second = run();
    ASSERT_EQ(first.first.size(), second.first.size());
    for (std::size_t i = 0; i < first.first.size(); ++i) {
        ASSERT_EQ(first.first[i].point(), second.first[i].point());
        ASSERT_EQ(first.first[i].sq_dist, second.first[i].sq_dist);
    }
    EXPECT_EQ(first.second, second.second) << "even the order inside the tree";
}

}  // namespace
}  // namespace d2lio::test
