// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "d2lio/degeneracy/scan_error.hpp"
#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "noise_tunnel.hpp"

namespace d2lio::fastlio {
namespace {

using test::iterate;
using test::kSettling;
using test::kVariance;
using test::noise_aware;
using test::pass_scans;
using test::RowMatrix;
using test::solve;
using test::Solved;
using test::Tunnel;

constexpr double kExact = 1e-12;

TEST(NoiseAware, ReadsSurfacesAndAddsNoPrior) {
    Adapter a;
    EXPECT_FALSE(a.reads_surfaces() || a.starts_at_rest());
    noise_aware(a, 0);
    EXPECT_TRUE(a.reads_surfaces() && a.starts_at_rest());
    EXPECT_FALSE(a.has_prior());
    ASSERT_TRUE(a.set("degeneracy.rest", "false"));
    EXPECT_FALSE(a.starts_at_rest());
    EXPECT_TRUE(a.reads_surfaces());
}

TEST(NoiseAware, ABareTunnelLosesItsAxis) {
    Adapter a;
    const Solved s = solve(noise_aware(a), Tunnel(0));
    ASSERT_GT(s.after.rows(), 500);
    EXPECT_GT(s.before.col(0).norm(), 0.5);  // noise has put as much as that into the rows
    EXPECT_LT(s.after.col(0).norm(), 1e-9);
    EXPECT_EQ(s.told.blind, 1);
    EXPECT_GT(s.told.noise_share[0], 0.5);
    EXPECT_LT(s.told.noise_share[1], 0.1);
    EXPECT_EQ(s.told.cleaned, s.after.rows());
    EXPECT_LT((s.after.middleCols<2>(1) - s.before.middleCols<2>(1)).norm(), kExact);
    EXPECT_EQ(s.residual_after, s.residual);  // the points lie beside their neighbours as before
}

TEST(NoiseAware, AFaceAcrossTheTunnelKeepsIt) {
    Adapter a;
    const Solved s = solve(noise_aware(a), Tunnel(1));
    ASSERT_EQ(s.told.blind, 1);
    EXPECT_GT(std::abs(s.before(0, 0)), 0.98);
    const double weight = s.after(0, 0) / s.before(0, 0);
    EXPECT_NEAR(weight, 1.0 - 0.5 * 20.0 / 21.0, 0.01);  // half, but whole in all its parts
    EXPECT_LT((s.after.row(0).head<6>() - weight * s.before.row(0).head<6>()).norm(), 1e-5);
    EXPECT_NEAR(s.residual_after[0], weight * s.residual[0], kExact);
    EXPECT_LT(s.after.bottomRows(s.after.rows() - 1).col(0).norm(), 1e-9);
}

TEST(NoiseAware, ManyFacesMakeItSeeing) {
    Adapter a;
    const Solved s = solve(noise_aware(a), Tunnel(30));
    EXPECT_EQ(s.told.blind, 0);
    EXPECT_EQ(s.told.cleaned, 0);
    EXPECT_LT(s.told.noise_share[0], 0.3);
    EXPECT_FALSE(s.touched());
}

TEST(NoiseAware, AScanAfterOneThatSawWellIsLookedAtByASampleAndJudgedFromTheNextOn) {
    Adapter a;
    EXPECT_LT(solve(noise_aware(a), Tunnel(60)).told.noise_share[0], 0.1);
    const Solved entering = solve(a, Tunnel(0));
    EXPECT_GT(entering.told.noise_share[0], 0.4);
    EXPECT_EQ(entering.told.blind, 0);
    EXPECT_FALSE(entering.touched());
    const Solved inside = solve(a, Tunnel(0));
    EXPECT_EQ(inside.told.blind, 1);
    EXPECT_TRUE(inside.touched());
    const Solved leaving = solve(a, Tunnel(60));  // every surface is looked at once more
    EXPECT_EQ(leaving.told.blind, 0);
    EXPECT_EQ(leaving.told.cleaned, 0);
    EXPECT_EQ(leaving.before, leaving.after);  // residuals may lose the sag of a bend
}

TEST(NoiseAware, AnAxisThatWasBlindStaysSoWhileItWavers) {
    const Tunnel wavering(8);
    const auto leaks = [&](Adapter& a) {
        const Solved s = solve(a, wavering);
        EXPECT_GT(s.told.noise_share[0], 0.3);
        EXPECT_LT(s.told.noise_share[0], 0.4);
        return s.after.bottomRows(s.after.rows() - 8).col(0).norm();  // of the tunnel's own rows
    };
    Adapter a;
    const double at_first = leaks(noise_aware(a));
    EXPECT_GT(at_first, 0.1);
    solve(a, Tunnel(0));
    EXPECT_LT(leaks(a), 1e-9);
    EXPECT_LT(leaks(a), 1e-9);
    solve(a, Tunnel(30));  // seen in between
    solve(a, wavering);    // what follows is looked at by a sample
    EXPECT_EQ(leaks(a), at_first);
    solve(a, Tunnel(0));
    a.reset();
    pass_scans(a, kSettling);
    EXPECT_EQ(leaks(a), at_first);
}

TEST(NoiseAware, RotationFollowsTheCleanedNormal) {
    Adapter a;
    const Tunnel t(0);
    const Solved s = solve(noise_aware(a), t);
    for (Eigen::Index k = 0; k < s.after.rows(); ++k) {
        const Vec3 n = s.after.row(k).head<3>();
        const Vec3 p_imu =
            t.pose.R.transpose() * (s.points[static_cast<std::size_t>(k)] - t.pose.t);
        const Vec3 expected = p_imu.cross(t.pose.R.transpose() * n);
        ASSERT_LT((Vec3(s.after.row(k).segment<3>(3)) - expected).norm(), 1e-5) << k;
    }
    EXPECT_GT((s.after.middleCols<3>(3) - s.before.middleCols<3>(3)).norm(), 0.5);
}

TEST(NoiseAware, CleanedRowsTeachTheExtrinsicNothing) {
    Adapter a, b;
    const Solved s = solve(noise_aware(a), Tunnel(0));
    EXPECT_GT(s.before.rightCols<6>().norm(), 1.0);
    EXPECT_EQ(s.after.rightCols<6>().norm(), 0.0);
    const Solved none =
        solve(noise_aware(b), Tunnel(0), false, -1);  // a host without those columns
    EXPECT_EQ(none.after.rightCols<6>(), none.before.rightCols<6>());
    EXPECT_EQ(none.after.leftCols<6>(), s.after.leftCols<6>());
}

TEST(NoiseAware, RowsInColumnsGiveTheSame) {
    Adapter a, b;
    const Tunnel t(1);
    const Solved rows = solve(noise_aware(a), t);
    noise_aware(b);
    b.begin_scan(t.input());
    Correspondence m{};
    for (std::size_t i = 0; i < t.targets.size(); ++i) b.accept(t.targets[i].candidate(i), &m);
    Eigen::Matrix<double, Eigen::Dynamic, 12> columns = rows.before;
    Eigen::VectorXd r = rows.residual;
    PriorBlock prior{};
    const auto n = static_cast<int>(columns.rows());
    b.condition({columns.data(), r.data(), n, 1, n, 0, 3, 6}, t.view(), kVariance, &prior);
    EXPECT_EQ(RowMatrix(columns), rows.after);
    EXPECT_EQ(r, rows.residual_after);
}

TEST(NoiseAware, RowsOfSomebodyElseAreLeftAlone) {
    Adapter a;
    const Tunnel t(0);
    const Solved s = solve(noise_aware(a), t);
    RowMatrix H = s.before.topRows(300);
    Eigen::VectorXd r = s.residual.head(300);
    PriorBlock prior{};
    for (const bool offered : {false, true}) {  // nothing was offered here, or more than these
        ASSERT_EQ(a.begin_scan(t.input()), Status::kOk);
        Correspondence m{};
        for (std::size_t i = 0; offered && i < t.targets.size(); ++i) {
            a.accept(t.targets[i].candidate(i), &m);
        }
        EXPECT_EQ(
            a.condition({H.data(), r.data(), 300, 12, 1, 0, 3, 6}, t.view(), kVariance, &prior),
            Status::kOk);
        EXPECT_EQ(H, s.before.topRows(300));
        EXPECT_EQ(r, s.residual.head(300));
        a.end_scan(t.view(), true, nullptr, 0);
        EXPECT_EQ(a.diagnostics().cleaned, 0);
        EXPECT_TRUE(std::isnan(a.diagnostics().noise_share[0]));
    }
}

TEST(NoiseAware, AtRestRowsAreOnlyLookedAt) {
    Adapter a;
    const Solved s = solve(noise_aware(a), Tunnel(0), true);
    EXPECT_FALSE(s.touched());
    EXPECT_EQ(s.told.blind, 1);  // but told
    EXPECT_EQ(s.told.cleaned, 0);
}

TEST(NoiseAware, AFilterThatDidNotBeginAtRestGetsItsFirstScansWhole) {
    Adapter a;
    noise_aware(a, kSettling - 1);
    EXPECT_FALSE(solve(a, Tunnel(0)).touched());
    EXPECT_TRUE(solve(a, Tunnel(0)).touched());
}

TEST(NoiseAware, AScanHasNoErrorOfItsOwnWhileTheVelocityIsLearnt) {
    Adapter a;
    noise_aware(a, kSettling);
    EXPECT_EQ(a.scan_error(1.0).rotation, 0.0);
    pass_scans(a, 1);
    EXPECT_GT(a.scan_error(1.0).rotation, 0.0);
    Adapter rested;
    noise_aware(rested, 0);
    pass_scans(rested, 1, true);
    EXPECT_GT(rested.scan_error(1.0).rotation, 0.0);
}

TEST(NoiseAware, AfterARestItActsFromTheFirstMotionOn) {
    Adapter a, b;
    noise_aware(a, 0);
    pass_scans(a, 1, true);
    EXPECT_TRUE(solve(a, Tunnel(0)).touched());
    noise_aware(b, 0);
    EXPECT_FALSE(solve(b, Tunnel(0)).touched());
}

TEST(NoiseAware, ResetSettlesAnew) {
    Adapter a;
    ASSERT_TRUE(solve(noise_aware(a), Tunnel(0)).touched());
    a.reset();
    EXPECT_TRUE(a.reads_surfaces());
    EXPECT_FALSE(solve(a, Tunnel(0)).touched());
    Adapter b;
    noise_aware(b, 0);
    pass_scans(b, 1, true);
    b.reset();
    EXPECT_FALSE(solve(b, Tunnel(0)).touched());
}

/// In a vault the planes cut the surface; what is learnt of its bend puts the points back on it.
TEST(NoiseAware, LearnsTheBendOfAVaultAndResetForgetsIt) {
    // Fitted normals look at the map's origin: from far off half of them look away from the sensor.
    for (const Vec3& centre : {Vec3(0.0, 0.0, 0.0), Vec3(0.0, 20.0, 5.0)}) {
        Adapter a;
        noise_aware(a);
        const Tunnel vault(0, 3, 0.0, 1.0 / 3.0, centre);
        const auto distance = [&] { return solve(a, vault).residual_after.cwiseAbs().mean(); };
        const double flat = distance();
        EXPECT_GT(flat, 3e-3);
        for (int i = 0; i < 5; ++i) distance();
        const double bent = distance();
        EXPECT_LT(bent, 0.4 * flat);
        a.reset();
        EXPECT_EQ(distance(), flat);
    }
}

TEST(NoiseAware, OtherMethodsMeasurePlainDistancesAndTouchNoRow) {
    Adapter plain;
    const Tunnel vault(0, 3, 0.0, 1.0 / 3.0);
    pass_scans(plain, kSettling);
    const Solved first = solve(plain, vault), last = solve(plain, vault);
    EXPECT_EQ(first.residual, last.residual);
    EXPECT_FALSE(last.touched());
    EXPECT_TRUE(std::isnan(last.told.noise_share[0]));
}

TEST(NoiseAware, SharesThatDoNotFitTogetherAreRefused) {
    Adapter a;
    EXPECT_TRUE(a.check());
    ASSERT_TRUE(a.set("degeneracy.share_low", "0.3"));
    for (const char* high : {"0.3", "0.2"}) {
        ASSERT_TRUE(a.set("degeneracy.share_high", high));
        EXPECT_FALSE(a.check());
        EXPECT_NE(std::string(a.error()).find("degeneracy.share_high"), std::string::npos);
        EXPECT_NE(std::string(a.error()).find("degeneracy.share_low"), std::string::npos);
    }
    ASSERT_TRUE(a.set("degeneracy.share_low", "0.1"));
    EXPECT_TRUE(a.check());
    for (const char* key :
         {"degeneracy.share_low", "degeneracy.share_high", "degeneracy.significance"}) {
        EXPECT_FALSE(a.set(key, "-1")) << key;
        EXPECT_FALSE(a.set(key, "nan")) << key;
    }
}

TEST(NoiseAware, ParametersReachTheMethod) {
    Adapter strict;
    ASSERT_TRUE(strict.set("degeneracy.significance", "500"));
    EXPECT_NEAR(solve(noise_aware(strict), Tunnel(1)).after(0, 0), 0.0, 1e-9);
    Adapter a;
    a.set("degeneracy.share_high", "1000");
    a.set("degeneracy.share_low", "900");
    EXPECT_FALSE(solve(noise_aware(a), Tunnel(0)).touched());
}

}  // namespace
}  // namespace d2lio::fastlio
