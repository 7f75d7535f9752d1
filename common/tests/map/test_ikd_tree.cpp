// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>

#include "d2lio/config/params.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "reference_map.hpp"

namespace d2lio::test {
namespace {

constexpr float kInfF = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

int found_at(const IkdTree& tree, const Eigen::Vector3f& query, int k, float bound = kInfF) {
    Neighbours out;
    tree.knn(query, k, bound, out);
    return out.count;
}

TEST(IkdTree, EmptyFindsNothing) {
    IkdTree tree;
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 5), 0);
    EXPECT_EQ(tree.erase_box({{-1, -1, -1}, {1, 1, 1}}), 0U);
    EXPECT_EQ(tree.erase({{0, 0, 0}}), 0U);
    EXPECT_EQ(tree.build({}), 0U);
    EXPECT_EQ(tree.depth(), 0);
    EXPECT_EQ(tree.nodes(), 0U);
    EXPECT_TRUE(tree.points().empty());
    EXPECT_EQ(tree.bounds().max, Eigen::Vector3f(0, 0, 0));
    std::vector<Neighbour> all;
    EXPECT_EQ(tree.radius_search({0, 0, 0}, 10.F, all), 0U);
}

TEST(IkdTree, FewerPointsThanAskedFor) {
    IkdTree tree;
    tree.build({{3, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    Neighbours out;
    tree.knn({0, 0, 0}, 5, kInfF, out);
    ASSERT_EQ(out.count, 3);
    EXPECT_EQ(out[0].point(), Eigen::Vector3f(1, 0, 0));
    EXPECT_EQ(out[2].sq_dist, 9.F);
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 0), 1) << "k is clamped to 1..32";
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 1000), 3);
}

TEST(IkdTree, DistanceBoundIsInclusive) {
    IkdTree tree;
    tree.build({{1, 0, 0}, {2, 0, 0}});
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 5, 1.F), 1);
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 5, std::nextafter(1.F, 0.F)), 0);
    EXPECT_EQ(found_at(tree, {0, 0, 0}, 5, kNan), 0);
    std::vector<Neighbour> all;
    EXPECT_EQ(tree.radius_search({0, 0, 0}, 2.F, all), 2U);
    EXPECT_EQ(all.front().sq_dist, 1.F);
    EXPECT_EQ(tree.radius_search({0, 0, 0}, -1.F, all), 0U);
}

TEST(IkdTree, NonFinitePointsAreCountedAndIgnored) {
    IkdTree tree;
    EXPECT_EQ(tree.build({{kNan, 0, 0}, {1, 2, 3}, {0, kInfF, 0}}), 1U);
    for (const bool downsample : {false, true}) {
        const InsertReport report =
            tree.insert({{0, 0, kNan}, {-kInfF, 0, 0}, {9, 9, 9}}, downsample);
        EXPECT_EQ(report.non_finite, 2U);
    }
    EXPECT_TRUE(tree.consistent());
    EXPECT_EQ(found_at(tree, {kNan, 0, 0}, 5), 0);
    EXPECT_EQ(found_at(tree, {kInfF, 0, 0}, 5), 0);
    EXPECT_EQ(tree.erase({{kNan, 0, 0}}), 0U);
    EXPECT_EQ(tree.erase_box({{kNan, 0, 0}, {20, 20, 20}}), 0U);
}

TEST(IkdTree, BoxesAreHalfOpen) {
    IkdTree tree;
    tree.build({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}});
    EXPECT_EQ(tree.erase_box({{1, 0, 0}, {1, 1, 1}}), 0U) << "no width";
    EXPECT_EQ(tree.erase_box({{1, 1, 1}, {0, 0, 0}}), 0U) << "inverted";
    EXPECT_EQ(tree.erase_boxes({{{0, 0, 0}, {1, 1, 1}}, {{1, 0, 0}, {2, 1, 1}}}), 2U);
    ASSERT_EQ(tree.size(), 1U);
    EXPECT_EQ(tree.points()[0].x(), 2.F);
    EXPECT_EQ(tree.erase_box({{-kInfF, -kInfF, -kInfF}, {kInfF, kInfF, kInfF}}), 1U);
    EXPECT_TRUE(tree.empty());
}

TEST(IkdTree, BoundsAreAttained) {
    IkdTree tree;
    tree.insert({{1, -2, 3}, {-4, 5, -6}, {0, 0, 0}}, false);
    EXPECT_EQ(tree.bounds().min, Eigen::Vector3f(-4, -2, -6));
    EXPECT_EQ(tree.bounds().max, Eigen::Vector3f(1, 5, 3));
    tree.erase({{-4, 5, -6}});
    EXPECT_EQ(tree.bounds().max, Eigen::Vector3f(1, 0, 3));
}

TEST(IkdTree, VoxelKeepsThePointNearestToItsCentre) {
    IkdTreeOptions options;
    options.downsample_leaf = 1.F;
    IkdTree tree(options);
    tree.insert({{0.1F, 0.1F, 0.1F}, {0.2F, 0.2F, 0.2F}, {0.9F, 0.9F, 0.9F}}, false);
    const InsertReport nearer = tree.insert({{0.4F, 0.5F, 0.5F}}, true);
    EXPECT_EQ(nearer.added, 1U);
    EXPECT_EQ(nearer.removed, 3U);
    const InsertReport farther = tree.insert({{0.3F, 0.5F, 0.5F}}, true);
    EXPECT_EQ(farther.not_nearer, 1U);
    ASSERT_EQ(tree.size(), 1U);
    EXPECT_EQ(tree.points()[0], Eigen::Vector3f(0.4F, 0.5F, 0.5F));
    tree.insert({{-0.1F, 0.5F, 0.5F}, {1.F, 0.5F, 0.5F}}, true);
    EXPECT_EQ(tree.size(), 3U) << "the neighbouring voxels are their own";
}

TEST(IkdTree, VoxelKeepsItsBestStoredPointAlone) {
    IkdTreeOptions options;
    options.downsample_leaf = 1.F;
    IkdTree tree(options);
    const Eigen::Vector3f best(0.5F, 0.5F, 0.5F);
    tree.insert({{0.1F, 0.1F, 0.1F}, best, best}, false);
    const InsertReport report = tree.insert({{0.6F, 0.6F, 0.6F}}, true);
    EXPECT_EQ(report.not_nearer, 1U);
    EXPECT_EQ(report.removed, 2U);
    EXPECT_EQ(tree.points(), Points{best});
}

TEST(IkdTree, HugeCoordinatesDoNotOverflow) {
    IkdTreeOptions options;
    options.downsample_leaf = 1e-3F;
    IkdTree tree(options);
    const Points far{{3e38F, 3e38F, 3e38F}, {-3e38F, 3e38F, -3e38F}, {1e12F, 0, 0}, {1e12F, 0, 0}};
    const InsertReport report = tree.insert(far, true);
    EXPECT_EQ(report.added, 3U);
    EXPECT_EQ(report.not_nearer, 1U);
    for (int i = 0; i < 40; ++i) tree.insert(far, false);
    EXPECT_TRUE(tree.consistent());
    EXPECT_EQ(found_at(tree, {1e12F, 0, 0}, 5, 0.F), 5);
    EXPECT_EQ(tree.erase({far[0]}), 41U);
}

TEST(IkdTree, EqualDistancesAreOrderedByCoordinates) {
    const Points corners{{1, 1, 1}, {1, -1, 1}, {-1, 1, -1}, {-1, -1, -1}, {1, 1, -1}, {-1, 1, 1}};
    Points reversed(corners.rbegin(), corners.rend());
    IkdTree built, inserted;
    built.build(corners);
    inserted.insert(reversed, false);
    Neighbours a, b;
    built.knn({0, 0, 0}, 4, kInfF, a);
    inserted.knn({0, 0, 0}, 4, kInfF, b);
    const Points expected = sorted(corners);
    for (int i = 0; i < 4; ++i) {
        EXPECT_EQ(a[i].point(), expected[static_cast<std::size_t>(i)]);
        EXPECT_EQ(b[i].point(), expected[static_cast<std::size_t>(i)]);
    }
}

TEST(IkdTree, BuildReplacesAndClearEmpties) {
    IkdTree tree;
    tree.build(Points(100, {1, 1, 1}));
    tree.build({{2, 2, 2}});
    EXPECT_EQ(tree.points(), (Points{{2, 2, 2}}));
    tree.clear();
    EXPECT_TRUE(tree.empty());
    tree.insert({{3, 3, 3}}, true);
    EXPECT_EQ(tree.size(), 1U);
}

TEST(IkdTree, RefusesOptionsOutsideTheirRange) {
    const auto refused = [](auto change) {
        IkdTreeOptions options;
        change(options);
        EXPECT_THROW(IkdTree{options}, ConfigError);
    };
    refused([](auto& o) { o.downsample_leaf = 0.F; });
    refused([](auto& o) { o.downsample_leaf = kNan; });
    refused([](auto& o) { o.delete_ratio = 1.0; });
    refused([](auto& o) { o.balance_ratio = 0.5; });
    refused([](auto& o) { o.balance_ratio = 0.8; });
    refused([](auto& o) { o.rebuild_min_points = 1; });
    refused([](auto& o) { o.background_min_points = 8; });
}

}  // namespace
}  // namespace d2lio::test
