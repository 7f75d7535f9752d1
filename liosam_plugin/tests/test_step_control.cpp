// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <string>

#include "d2lio/liosam/adapter.hpp"
#include "step_control.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kFree = 6;

TEST(StepControl, HalvesEveryStepThatTurnsBackAfterTheFreeIterations) {
    StepControl control;
    control.begin();
    Vec6 step = Vec6::Constant(1e-3);
    double expected = 1.0;
    for (int i = 1; i <= 10; ++i, step = -step) {
        if (i > kFree) expected *= 0.5;
        EXPECT_EQ(control.factor(step, Mat6::Identity()), expected);
    }
    control.begin();
    EXPECT_EQ(control.factor(step, Mat6::Identity()), 1.0);
}

/// A scan that creeps on, as in a tunnel, keeps its whole steps however many it needs.
TEST(StepControl, LeavesSlowConvergenceAlone) {
    StepControl control;
    control.begin();
    Vec6 step = Vec6::Constant(1e-2);
    for (int i = 0; i < 30; ++i, step *= 0.95) {
        EXPECT_EQ(control.factor(step, Mat6::Identity()), 1.0);
    }
}

/// What turns back is judged by the cost: a rotation and a translation that move the points the
/// same way do not turn back, although their numbers do.
TEST(StepControl, JudgesInTheMetricOfTheNormalEquations) {
    Vec6 row = Vec6::Zero();
    row[0] = 10.0;  // points 10 m away
    row[3] = 1.0;
    const Mat6 AtA = row * row.transpose();
    Vec6 turn = Vec6::Zero(), shift = Vec6::Zero();
    turn[0] = 1e-3;
    turn[3] = -1e-3;
    shift[3] = 5e-3;
    ASSERT_LT(turn.dot(shift), 0.0);
    StepControl control;
    control.begin();
    for (int i = 0; i < 10; ++i) {
        EXPECT_EQ(control.factor(i % 2 == 0 ? turn : shift, AtA), 1.0);
    }
}

/// With off, and where the host's gates are kept, every step is the host's own.
TEST(StepControl, IsOnlyForTheModesThatReplaceTheHostsGates) {
    for (const char* kept : {"off", "fixed", "none"}) {
        Adapter adapter;
        ASSERT_TRUE(adapter.set("rejection.mode", kept));
        const char* const gates = std::string(kept) == "fixed" ? "true" : "false";
        ASSERT_TRUE(adapter.set("rejection.keep_host_gate", gates));
        const Mat3 R = Mat3::Identity();
        const Vec3 t = Vec3::Zero();
        const PoseView pose{R.data(), t.data()};
        const Mat6 P = Mat6::Identity();
        ASSERT_EQ(adapter.begin_scan({pose, pose, P.data(), 1, 1}), Status::kOk);
        const Mat6 AtA = Mat6::Identity();
        Vec6 step = Vec6::Constant(1e-3);
        double factor = 1.0;
        for (int i = 0; i < 10; ++i, step = -step) {
            factor = adapter.step_factor(step.data(), AtA.data());
        }
        EXPECT_EQ(factor < 1.0, std::string(kept) == "none") << kept;
    }
}

}  // namespace
}  // namespace d2lio::liosam
