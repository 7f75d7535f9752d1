// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>

#include "d2lio/geometry/so3.hpp"
#include "loop_closer.hpp"

namespace d2lio::liosam {
namespace {

constexpr Stamp kSecond = 1'000'000'000;
constexpr double kAligned = 0.01;  ///< m and rad

/// Walls, floor and a few boxes around the origin, seen from anywhere.
std::vector<Eigen::Vector3f> scene() {
    std::vector<Eigen::Vector3f> out;
    std::mt19937 random(3);
    std::uniform_real_distribution<float> u(-1.F, 1.F);
    const Eigen::Vector3f half(9.F, 6.F, 2.F);
    for (int i = 0; i < 9000; ++i) {
        Eigen::Vector3f p(u(random) * half.x(), u(random) * half.y(), u(random) * half.z());
        const int axis = i % 3;
        p[axis] = u(random) > 0 ? half[axis] : -half[axis];
        if (i % 7 == 0) p = Eigen::Vector3f(3.F, 2.F + u(random), u(random));  // a board
        out.push_back(p);
    }
    return out;
}

std::vector<Eigen::Vector3f> seen_from(const Pose& T) {
    std::vector<Eigen::Vector3f> out;
    const auto world = scene();
    for (std::size_t i = 0; i < world.size(); i += 4) {
        out.push_back((T.inverse() * world[i].cast<double>()).cast<float>());
    }
    return out;
}

/// Ten keyframes on a walk, a long pause, and one more where the first was, with a drifted pose.
struct Walk {
    KeyframeMap map;
    Pose truth{exp_so3(Vec3(0, 0, 0.3)), Vec3(0.5, -0.2, 0.0)};
    Pose drift{exp_so3(Vec3(0.005, 0, 0.02)), Vec3(0.3, -0.25, 0.1)};

    explicit Walk(double pause_s = 60.0, bool same_place = true) {
        for (int i = 0; i < 10; ++i) {
            const Pose T{exp_so3(Vec3(0, 0, 0.1 * i)), Vec3(0.4 * i, 0.1 * i, 0)};
            map.add(T, i * kSecond, {}, seen_from(T));
        }
        auto cloud = seen_from(truth);
        if (!same_place) {
            for (Eigen::Vector3f& p : cloud) p = p.cwiseProduct(Eigen::Vector3f(0.5F, 2.F, 2.F));
        }
        map.add(truth * drift, static_cast<Stamp>(pause_s * 1e9), {}, cloud);
    }
};

LoopOptions enabled() {
    LoopOptions o;
    o.enabled = true;
    return o;
}

TEST(LoopCloser, MeasuresTheTransformToThePlaceSeenBefore) {
    const Walk walk;
    LoopCloser closer(enabled(), 1);
    const auto loop = closer.find(walk.map);
    ASSERT_TRUE(loop.has_value());
    EXPECT_EQ(loop->to, 10U);
    const Pose expected = walk.map[loop->from].pose.inverse() * walk.truth;
    EXPECT_LT((loop->T_from_to.t - expected.t).norm(), kAligned);
    EXPECT_LT(log_so3(expected.R.transpose() * loop->T_from_to.R).norm(), kAligned);
    EXPECT_LT(loop->fitness, 0.3);
}

TEST(LoopCloser, FindsNothingWhereThereIsNothing) {
    EXPECT_FALSE(LoopCloser(enabled(), 1).find(KeyframeMap()).has_value());
    EXPECT_FALSE(LoopCloser(LoopOptions{}, 1).find(Walk().map).has_value());         // disabled
    EXPECT_FALSE(LoopCloser(enabled(), 1).find(Walk(20.0).map).has_value());         // too recent
    EXPECT_FALSE(LoopCloser(enabled(), 1).find(Walk(60.0, false).map).has_value());  // elsewhere
    LoopOptions near = enabled();
    near.search_radius = 0.05;
    EXPECT_FALSE(LoopCloser(near, 1).find(Walk().map).has_value());
}

TEST(LoopCloser, WaitsBetweenAttemptsUntilReset) {
    const Walk walk;
    LoopCloser closer(enabled(), 1);
    EXPECT_TRUE(closer.find(walk.map).has_value());
    EXPECT_FALSE(closer.find(walk.map).has_value());
    closer.reset();
    EXPECT_TRUE(closer.find(walk.map).has_value());
}

}  // namespace
}  // namespace d2lio::liosam
