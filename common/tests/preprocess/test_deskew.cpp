// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "../geometry/random_state.hpp"
#include "d2lio/preprocess/deskew.hpp"

namespace d2lio {
namespace {

constexpr double kTolerance = 2e-5;  // m, float coordinates at 20 m
constexpr double kPeriod = 0.005;    // s, IMU

/// Constant body rate, constant world acceleration: the motion model of the knots is exact.
struct Motion {
    Vec3 gyro{0.3, -0.5, 1.1}, vel{3.0, -1.0, 0.2}, accel{0.5, 1.0, -0.3};
    Pose at(double t) const { return {exp_so3(gyro * t), Vec3(vel * t + 0.5 * accel * t * t)}; }
    std::vector<MotionKnot> knots(int count) const {
        std::vector<MotionKnot> out;
        for (int i = 0; i < count; ++i) {
            const double t = i * kPeriod;
            out.push_back({t, at(t).R, at(t).t, vel + accel * t, gyro, accel});
        }
        return out;
    }
};

Pose extrinsic() { return {exp_so3(Vec3(0.02, -0.03, 1.0)), Vec3(0.03, 0.05, 0.08)}; }

TEST(Deskew, PutsAFixedPointWhereItIsAtTheScanEnd) {
    const Motion motion;
    test::Random random(1);
    const Pose end = motion.at(0.1);
    std::vector<LidarPoint> points;
    std::vector<Vec3> expected;
    for (int i = 0; i < 500; ++i) {
        const double t = random.uniform(1e-6, 0.1);  // unsorted on purpose
        const Vec3 world = random.vec3(12.0);
        const Vec3 seen = (motion.at(t) * extrinsic()).inverse() * world;
        LidarPoint p;
        p.x = static_cast<float>(seen.x());
        p.y = static_cast<float>(seen.y());
        p.z = static_cast<float>(seen.z());
        p.dt_ns = static_cast<std::int32_t>(t * 1e9);
        points.push_back(p);
        expected.push_back((end * extrinsic()).inverse() * world);
    }
    deskew(points, motion.knots(20), end, extrinsic());  // last knot 95 ms: the rest extrapolates
    for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_LT((points[i].xyz().cast<double>() - expected[i]).norm(), kTolerance);
    }
}

TEST(Deskew, LeavesPointsAtTimeZeroAndScansWithoutMotionAlone) {
    const Motion motion;
    LidarPoint p;
    p.x = 1.F;
    std::vector<LidarPoint> points{p};
    deskew(points, motion.knots(20), motion.at(0.1), extrinsic());
    EXPECT_EQ(points[0].x, 1.F);
    points[0].dt_ns = 50'000'000;
    deskew(points, {}, motion.at(0.1), extrinsic());
    EXPECT_EQ(points[0].x, 1.F);
}

}  // namespace
}  // namespace d2lio
