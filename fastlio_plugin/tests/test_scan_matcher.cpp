// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "numeric_jacobian.hpp"
#include "random_state.hpp"
#include "scan_matcher.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kStep = 1e-2;       // large: residuals are float
constexpr double kTolerance = 2e-3;  // of central differences of float residuals

/// Points on three tilted planes (map frame) and the scan that sees them from x.
struct Planes {
    std::vector<Eigen::Vector3f> map, scan;

    Planes(test::Random& random, const NavState& x) {
        const Vec3 normals[] = {Vec3(1, 0.2, -0.1), Vec3(0.1, 1, 0.3), Vec3(-0.2, 0.1, 1)};
        for (const Vec3& n : normals) {
            const Vec3 u = n.unitOrthogonal(), v = n.normalized().cross(u);
            const Vec3 origin = 6.0 * n.normalized();
            for (int i = -10; i <= 10; ++i) {
                for (int j = -10; j <= 10; ++j) {
                    map.push_back((origin + 0.3 * i * u + 0.3 * j * v).cast<float>());
                }
            }
            for (int i = 0; i < 20; ++i) {
                const Vec3 p =
                    origin + random.uniform(-2, 2) * u + random.uniform(-2, 2) * v + 0.01 * n;
                scan.push_back((x.T_map_lidar().inverse() * p).cast<float>());
            }
        }
    }
};

TEST(ScanMatcher, RowsAreTheDerivativeOfTheResidual) {
    test::Random random(1);
    NavState x = random.state();
    x.pos = Vec3(0.3, -0.2, 0.1);
    x.extrinsic_pos = random.vec3(0.3);
    const Planes world(random, x);
    IkdTree tree;
    tree.build(world.map);
    Adapter adapter;
    adapter.set("rejection.mode", "none");
    const Mat23x23 P = Mat23x23::Identity();
    const ScanInput input{{x.rot.data(), x.pos.data()},
                          {x.rot.data(), x.pos.data()},
                          P.data(),
                          23,
                          0,
                          3,
                          world.scan.size(),
                          false};
    adapter.begin_scan(input);
    ScanMatcher matcher(adapter, true, 0.001, 1);
    matcher.begin(world.scan, tree);
    Linearisation rows;
    ASSERT_TRUE(matcher.measure(x, true, rows));
    ASSERT_EQ(rows.rows, static_cast<Eigen::Index>(world.scan.size()));
    const Eigen::MatrixXd H = rows.H.topRows(rows.rows);
    const auto error = [&](const Eigen::VectorXd& d) -> Eigen::VectorXd {
        Vec23 full = Vec23::Zero();
        full.head<12>() = d;
        Linearisation out;
        matcher.measure(state_plus(x, full), false, out);  // same neighbours, same planes
        return -out.residual.head(out.rows);
    };
    const Eigen::MatrixXd J = test::numeric_jacobian(error, Eigen::VectorXd::Zero(12), kStep);
    EXPECT_LT((J - H).cwiseAbs().maxCoeff(), kTolerance);
    EXPECT_GT(H.rightCols<6>().cwiseAbs().maxCoeff(), 0.5);
}

TEST(ScanMatcher, TheExtrinsicHasNoColumnsUnlessEstimated) {
    test::Random random(2);
    NavState x;
    const Planes world(random, x);
    IkdTree tree;
    tree.build(world.map);
    Adapter adapter;
    ScanMatcher matcher(adapter, false, 0.001, 1);
    const Mat23x23 P = Mat23x23::Identity();
    adapter.begin_scan({{x.rot.data(), x.pos.data()},
                        {x.rot.data(), x.pos.data()},
                        P.data(),
                        23,
                        0,
                        3,
                        world.scan.size(),
                        false});
    matcher.begin(world.scan, tree);
    Linearisation rows;
    ASSERT_TRUE(matcher.measure(x, true, rows));
    EXPECT_EQ(rows.H.topRows(rows.rows).rightCols<6>().norm(), 0.0);
}

}  // namespace
}  // namespace d2lio::fastlio
