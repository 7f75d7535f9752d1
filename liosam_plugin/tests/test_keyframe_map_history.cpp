// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
// The submap does not depend on how it came about, and memory does not grow.
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "d2lio/preprocess/voxel_grid.hpp"
#include "keyframe_map.hpp"
#include "random_state.hpp"

namespace d2lio::liosam {
namespace {

using Points = std::vector<Eigen::Vector3f>;
using Indices = std::vector<std::size_t>;

constexpr Stamp kSecond = 1'000'000'000;

Points cloud(test::Random& random, std::size_t n) {
    Points points(n);
    for (Eigen::Vector3f& p : points) p = random.vec3(15.0).cast<float>();
    return points;
}

Points sorted(const IkdTree& tree) {
    Points points = tree.points();
    std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
        return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
    });
    return points;
}

void expect_same_trees(const KeyframeMap& a, const KeyframeMap& b) {
    ASSERT_EQ(a.submap(), b.submap());
    ASSERT_EQ(sorted(a.corners()), sorted(b.corners()));
    ASSERT_EQ(sorted(a.surfaces()), sorted(b.surfaces()));
}

/// The same keyframes at their present poses, brought in at once.
void expect_as_from_scratch(const KeyframeMap& map, Stamp now) {
    KeyframeMap fresh(map.options());
    for (std::size_t i = 0; i < map.size(); ++i) {
        fresh.add(map[i].pose, map[i].stamp, map[i].corners, map[i].surfaces);
    }
    fresh.refresh(now);
    expect_same_trees(map, fresh);
}

/// The clouds of the submap, joined and voxel-filtered. Points at a border may round to the next
/// voxel, so a few centroids differ.
void expect_as_voxel_grid(const KeyframeMap& map) {
    constexpr float kRounding = 1e-4F;
    constexpr double kAtBorder = 2e-3;
    Points joined, expected;
    for (const std::size_t i : map.submap()) {
        for (const Eigen::Vector3f& p : map[i].surfaces) {
            joined.emplace_back((map[i].pose * p.cast<double>()).cast<float>());
        }
    }
    voxel_grid(joined, map.options().surface_leaf, expected);
    const auto missing = std::count_if(expected.begin(), expected.end(), [&map](const auto& p) {
        Neighbours found;
        map.surfaces().knn(p, 1, kRounding * kRounding, found);
        return found.count == 0;
    });
    const double allowed = kAtBorder * static_cast<double>(expected.size());
    EXPECT_LE(static_cast<double>(missing), allowed);
    EXPECT_NEAR(static_cast<double>(map.surfaces().size()), static_cast<double>(expected.size()),
                allowed);
}

/// A walk that keeps returning to the origin, with stops, turns and irregular time steps.
class Walk {
  public:
    explicit Walk(unsigned seed) : random_(seed) {}

    void step(KeyframeMap& map) {
        now_ += static_cast<Stamp>(random_.uniform(0.05, 2.0) * 1e9);
        if (random_.uniform(0.0, 1.0) < 0.1) now_ += 20 * kSecond;
        if (random_.uniform(0.0, 1.0) < 0.8) pose_.t = (pose_.t + random_.vec3(4.0)) * 0.98;
        pose_.R = random_.rotation();
        map.add(pose_, now_, cloud(random_, 40), cloud(random_, 120));
    }
    /// A loop closure: the later a keyframe, the more it moves.
    void close_loop(KeyframeMap& map, std::size_t from) {
        const Vec3 drift = random_.vec3(0.02);
        for (std::size_t i = from; i < map.size(); ++i) {
            Pose pose = map[i].pose;
            pose.t += drift * static_cast<double>(i - from);
            map.set_pose(i, pose);
        }
        pose_ = map.back().pose;
    }
    Stamp now() const { return now_; }

  private:
    test::Random random_;
    Pose pose_;
    Stamp now_ = 0;
};

SubmapOptions small_submap() {
    SubmapOptions options;
    options.search_radius = 12.0;
    return options;
}

TEST(KeyframeMapHistory, WalkWithRevisitsEqualsARebuildToTheBit) {
    for (unsigned seed = 0; seed < 3; ++seed) {
        KeyframeMap map(small_submap());
        Walk walk(seed);
        for (int i = 1; i <= 200; ++i) {
            walk.step(map);
            map.refresh(walk.now());
            if (i % 10 == 0) expect_as_from_scratch(map, walk.now());
            if (i % 50 == 0) expect_as_voxel_grid(map);
        }
    }
}

TEST(KeyframeMapHistory, LoopClosuresEqualARebuildToTheBit) {
    KeyframeMap map(small_submap());
    Walk walk(7);
    for (int i = 1; i <= 200; ++i) {
        walk.step(map);
        map.refresh(walk.now());
        if (i % 20 != 0) continue;
        // Now and then all of the submap, now and then its newest part.
        walk.close_loop(map, i % 40 == 0 ? 0 : map.size() - 3);
        EXPECT_TRUE(map.refresh(walk.now()));
        expect_as_from_scratch(map, walk.now());
    }
}

TEST(KeyframeMapHistory, HowOftenRefreshIsCalledDoesNotMatter) {
    KeyframeMap often(small_submap()), seldom(small_submap());
    Walk walk(8), same_walk(8);
    for (int i = 1; i <= 150; ++i) {
        walk.step(often);
        same_walk.step(seldom);
        often.refresh(walk.now());
    }
    seldom.refresh(walk.now());
    expect_same_trees(often, seldom);
}

TEST(KeyframeMapEviction, FarthestGoFirstAndPosesStay) {
    SubmapOptions options;
    options.max_clouds = 3;
    KeyframeMap map(options);
    test::Random random(1);
    for (const double x : {0.0, 10.0, -30.0, 20.0, 20.0}) {
        map.add({Mat3::Identity(), Vec3(x, 0, 0)}, 0, cloud(random, 10), cloud(random, 10));
    }
    // At the fourth keyframe -30 is the farthest, at the fifth 0.
    EXPECT_EQ(map.size(), 5U);
    EXPECT_EQ(map.clouds(), 3U);
    EXPECT_FALSE(map[0].has_clouds);
    EXPECT_TRUE(map[0].surfaces.empty());
    EXPECT_TRUE(map[1].has_clouds);
    EXPECT_FALSE(map[2].has_clouds);
    EXPECT_EQ(map[2].pose.t.x(), -30.0);
    EXPECT_EQ(map[4].surfaces.size(), 10U);
}

TEST(KeyframeMapEviction, OlderGoFirstAtOnePlace) {
    SubmapOptions options;
    options.max_clouds = 2;
    KeyframeMap map(options);
    for (int i = 0; i < 5; ++i) map.add(Pose(), i * kSecond, {}, {{1.F, 1.F, 1.F}});
    map.refresh(5 * kSecond);
    EXPECT_EQ(map.submap(), (Indices{3, 4}));
}

TEST(KeyframeMapEviction, LeavesTheSubmapAsIfItNeverWereThere) {
    SubmapOptions options = small_submap();
    options.max_clouds = 25;
    KeyframeMap map(options);
    Walk walk(9);
    for (int i = 1; i <= 150; ++i) {
        walk.step(map);
        if (i % 3 != 0) map.refresh(walk.now());
        if (i % 10 != 0) continue;
        map.refresh(walk.now());
        ASSERT_LE(map.clouds(), 25U);
        // A map of the remaining ones alone; their indices differ.
        KeyframeMap remaining(options);
        for (std::size_t k = 0; k < map.size(); ++k) {
            const Keyframe& f = map[k];
            if (f.has_clouds) remaining.add(f.pose, f.stamp, f.corners, f.surfaces);
        }
        remaining.refresh(walk.now());
        ASSERT_EQ(sorted(map.surfaces()), sorted(remaining.surfaces()));
        ASSERT_EQ(sorted(map.corners()), sorted(remaining.corners()));
    }
}

TEST(KeyframeMapEviction, RevisitOfAForgottenPlaceIsSafe) {
    SubmapOptions options;
    options.max_clouds = 20;
    KeyframeMap map(options);
    test::Random random(2);
    const auto visit = [&](double x) {
        const Stamp now = static_cast<Stamp>(map.size()) * 20 * kSecond;
        map.add({Mat3::Identity(), Vec3(x, 0.5, 0.5)}, now, {}, cloud(random, 50));
        map.refresh(now);
    };
    for (int i = 0; i <= 100; ++i) visit(3.0 * i);
    EXPECT_FALSE(map[0].has_clouds);
    visit(0.0);
    EXPECT_EQ(map.submap(), (Indices{101})) << "what was here is gone";
    EXPECT_FALSE(map.surfaces().empty());
    map.set_pose(0, {Mat3::Identity(), Vec3(1.0, 0.5, 0.5)});
    EXPECT_FALSE(map.refresh(101 * 20 * kSecond));
}

TEST(KeyframeMapEviction, MemoryIsBoundedOverALongRun) {
    constexpr std::size_t kPerKeyframe = 2 * sizeof(Keyframe);  // capacity may be twice the size
    SubmapOptions options = small_submap();
    options.max_clouds = 50;
    KeyframeMap map(options);
    Walk walk(10);
    const auto run = [&](int steps) {
        for (int i = 0; i < steps; ++i) {
            walk.step(map);
            map.refresh(walk.now());
        }
    };
    run(300);
    const std::size_t settled = map.memory_bytes() - map.size() * sizeof(Keyframe);
    run(2000);
    EXPECT_LT(map.memory_bytes(), 2 * settled + map.size() * kPerKeyframe);
}

}  // namespace
}  // namespace d2lio::liosam
