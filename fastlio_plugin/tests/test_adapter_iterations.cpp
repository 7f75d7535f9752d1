// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "noise_tunnel.hpp"

/// What method noise_aware does in the later iterations of a scan.
namespace d2lio::fastlio {
namespace {

using test::iterate;
using test::noise_aware;
using test::Solved;
using test::Tunnel;

constexpr double kSingle = 1e-5;  // normals go to the host in single precision; 5 m

struct Iterated {
    Solved first, second;
    ScanDiagnostics told;
};

Iterated solve_twice(const Tunnel& t, bool search, int extrinsic = 6) {
    Adapter a;
    noise_aware(a);
    EXPECT_EQ(a.begin_scan(t.input()), Status::kOk);
    Iterated out{iterate(a, t, true, extrinsic), iterate(a, t, search, extrinsic), {}};
    EXPECT_EQ(a.end_scan(t.view(), true, nullptr, 0), Status::kOk);
    out.told = a.diagnostics();
    return out;
}

TEST(NoiseAwareIterations, RowsEndAsInTheFirstOne) {
    const Tunnel t(2);
    for (const bool search : {false, true}) {
        const Iterated s = solve_twice(t, search);
        ASSERT_EQ(s.first.after.rows(), s.second.after.rows());
        EXPECT_LT((s.first.after - s.second.after).cwiseAbs().maxCoeff(), kSingle);
        EXPECT_LT((s.first.residual_after - s.second.residual_after).cwiseAbs().maxCoeff(),
                  kSingle);
        EXPECT_EQ(s.told.blind, 1);
        EXPECT_EQ(s.told.cleaned, s.first.after.rows() - 2);
    }
}

TEST(NoiseAwareIterations, NormalsComeCleanButForTheRowsThatSpeak) {
    const Iterated s = solve_twice(Tunnel(2), false);
    EXPECT_GT(s.first.before.bottomRows(598).col(0).norm(), 0.5);
    EXPECT_LT(s.second.before.bottomRows(598).col(0).norm(), kSingle);
    EXPECT_EQ(s.second.before.topLeftCorner(2, 3), s.first.before.topLeftCorner(2, 3));
}

TEST(NoiseAwareIterations, RowsThatKeepTheirNormalTeachTheExtrinsic) {
    const Iterated s = solve_twice(Tunnel(2), false);
    EXPECT_GT(s.second.after.topRightCorner(2, 6).norm(), 0.5);
    EXPECT_LT((s.second.after.topRightCorner(2, 6) - s.first.after.topRightCorner(2, 6)).norm(),
              kSingle);
    EXPECT_EQ(s.second.after.bottomRightCorner(598, 6).norm(), 0.0);
}

TEST(NoiseAwareIterations, AScanBeginsWithWholeNormals) {
    Adapter a;
    const Tunnel t(0);
    const Solved first = solve(noise_aware(a), t), next = solve(a, t);
    EXPECT_EQ(first.before, next.before);
}

}  // namespace
}  // namespace d2lio::fastlio
