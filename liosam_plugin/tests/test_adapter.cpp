// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "d2lio/degeneracy/prior.hpp"
#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/liosam/adapter.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kVariance = 1e-3;
constexpr double kExact = 1e-9;
constexpr double kNumeric = 1e-6;  ///< of central differences

Mat3 rotation(const Vec3& rpy) {
    return (Eigen::AngleAxisd(rpy[2], Vec3::UnitZ()) * Eigen::AngleAxisd(rpy[1], Vec3::UnitY()) *
            Eigen::AngleAxisd(rpy[0], Vec3::UnitX()))
        .toRotationMatrix();
}

Pose pose_of(const Vec6& x) { return {rotation(x.head<3>()), x.tail<3>()}; }

/// A scan whose prediction differs from the last estimate, and rows that leave x nearly free.
struct Scene {
    Vec6 predicted_x = (Vec6() << 0.1, -0.2, 1.3, 4.0, -2.0, 0.5).finished();
    Pose previous, predicted = pose_of(predicted_x);
    Mat6 P = Mat6::Identity() * 1e-4;
    Mat6 AtA = Mat6::Zero();
    Vec6 Atb = Vec6::Zero();

    explicit Scene(double along_x = 2.0) {
        P.topLeftCorner<3, 3>().diagonal() << 1e-6, 2e-6, 3e-6;
        P.bottomRightCorner<3, 3>() << 4e-4, 1e-4, 0, 1e-4, 3e-4, 0, 0, 0, 2e-4;
        std::mt19937 random(5);
        std::normal_distribution<double> noise(0.0, 1.0);
        for (int i = 0; i < 400; ++i) {
            Vec6 row;
            for (int k = 0; k < 6; ++k) row[k] = noise(random);
            row[3] *= std::sqrt(along_x / 400.0);
            AtA += row * row.transpose();
            Atb += 0.01 * noise(random) * row;
        }
    }
    /// Points into this scene, so never of a temporary one.
    ScanInput input(std::size_t corners = 0, std::size_t surfaces = 4) const& {
        return {{previous.R.data(), previous.t.data()},
                {predicted.R.data(), predicted.t.data()},
                P.data(),
                corners,
                surfaces};
    }
    ScanInput input(std::size_t = 0, std::size_t = 4) const&& = delete;
};

/// Five squared distances, rising to `farthest`.
struct Near {
    float sq[5];
    explicit Near(float nearest = 0.01F, float farthest = 0.25F)
        : sq{nearest, 0.04F, 0.09F, 0.16F, farthest} {}
    Candidate candidate(std::size_t index = 0, double range = 10.0,
                        Feature feature = Feature::kSurface) const {
        return {feature, index, range, sq, 1, 5};
    }
};

constexpr float kInfinity = std::numeric_limits<float>::infinity();

TEST(LioSamAdapter, OffPassesUpstreamsDistanceAndWeightThrough) {
    Adapter a;
    Scene scene;
    ASSERT_EQ(a.begin_scan(scene.input()), Status::kOk);
    EXPECT_FLOAT_EQ(a.gate(Near().candidate(0)), 0.25F);
    EXPECT_EQ(a.gate(Near(0.01F, 1.0F).candidate(1)), kInfinity);
    Candidate few = Near().candidate(2);
    few.neighbour_count = 4;
    EXPECT_EQ(a.gate(few), kInfinity);
    EXPECT_FLOAT_EQ(a.gate(Near().candidate(3)), 0.25F);
    EXPECT_DOUBLE_EQ(a.weigh(Feature::kSurface, 0, 0.7), 0.7);
    EXPECT_DOUBLE_EQ(a.weigh(Feature::kSurface, 3, 0.1), 0.0);
    a.end_scan({scene.predicted.R.data(), scene.predicted.t.data()}, true);
    const CorrespondenceCounts& c = a.diagnostics().counts;
    EXPECT_EQ(c.offered, 4);
    EXPECT_EQ(c.accepted, 1);
    EXPECT_EQ(c.far_neighbours, 1);
    EXPECT_EQ(c.few_neighbours, 1);
    EXPECT_EQ(c.residual, 1);
}

TEST(LioSamAdapter, FixedLooksAtTheNearestPointAndKeepsAWeight) {
    Adapter a;
    ASSERT_TRUE(a.set("rejection.mode", "fixed"));
    ASSERT_TRUE(a.set("rejection.tau", "0.5"));
    Scene scene;
    ASSERT_EQ(a.begin_scan(scene.input(2, 2)), Status::kOk);
    EXPECT_EQ(a.gate(Near(0.24F, 9.0F).candidate(0, 10.0, Feature::kCorner)), 0.0F);
    EXPECT_EQ(a.gate(Near(0.26F, 9.0F).candidate(1, 10.0, Feature::kCorner)), kInfinity);
    EXPECT_EQ(a.gate(Near(0.24F, 9.0F).candidate(0)), 0.0F);
    EXPECT_EQ(a.gate(Near(0.24F, 9.0F).candidate(1)), 0.0F);
    EXPECT_DOUBLE_EQ(a.weigh(Feature::kCorner, 0, 0.9), 0.9);
    EXPECT_GT(a.weigh(Feature::kSurface, 0, -3.0), 0.1);  // upstream accepts above 0.1
    EXPECT_EQ(a.weigh(Feature::kSurface, 0, kNaN), 0.0);
    a.mark_singular(Feature::kSurface, 1);
    a.end_scan({scene.predicted.R.data(), scene.predicted.t.data()}, true);
    const CorrespondenceCounts& c = a.diagnostics().counts;
    EXPECT_EQ(c.accepted, 2);
    EXPECT_EQ(c.threshold, 1);
    EXPECT_EQ(c.singular_plane, 1);
    EXPECT_DOUBLE_EQ(a.diagnostics().epsilon_max, 0.5);
}

TEST(LioSamAdapter, KeptHostGateComesOnTop) {
    Adapter a;
    ASSERT_TRUE(a.set("rejection.mode", "fixed"));
    ASSERT_TRUE(a.set("rejection.keep_host_gate", "true"));
    Scene scene;
    a.begin_scan(scene.input());
    EXPECT_EQ(a.gate(Near(0.01F, 2.0F).candidate(0)), kInfinity);
    EXPECT_FLOAT_EQ(a.gate(Near(0.01F, 0.5F).candidate(1)), 0.5F);
    EXPECT_EQ(a.weigh(Feature::kSurface, 1, 0.05), 0.0);
}

TEST(LioSamAdapter, PointAdaptiveThresholdGrowsWithRange) {
    Adapter a;
    ASSERT_TRUE(a.set("rejection.mode", "point_adaptive"));
    ASSERT_TRUE(a.set("rejection.epsilon_0", "0.1"));
    Scene scene;
    scene.previous = scene.predicted;
    scene.previous.R = scene.predicted.R * exp_so3(Vec3(0, 0, -0.02));
    a.begin_scan(scene.input());
    // 2 * 10 m * sin(0.01) + 0.1 m = 0.30 m; at 1 m 0.12 m.
    EXPECT_EQ(a.gate(Near(0.29F * 0.29F).candidate(0, 10.0)), 0.0F);
    EXPECT_EQ(a.gate(Near(0.31F * 0.31F).candidate(1, 10.0)), kInfinity);
    EXPECT_EQ(a.gate(Near(0.13F * 0.13F).candidate(2, 1.0)), kInfinity);
}

TEST(LioSamAdapter, EulerJacobianIsTheDerivativeOfTheRotation) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> angle(-1.2, 1.2);
    constexpr double kStep = 1e-6;
    for (int trial = 0; trial < 50; ++trial) {
        const Vec3 rpy(angle(random), angle(random), 3.0 * angle(random));
        Mat3 E;
        euler_jacobian(rpy[0], rpy[1], E.data());
        for (int k = 0; k < 3; ++k) {
            const Vec3 d = kStep * Vec3::Unit(k);
            const Vec3 numeric =
                log_so3(rotation(rpy - d).transpose() * rotation(rpy + d)) / (2.0 * kStep);
            EXPECT_LT((E.col(k) - numeric).norm(), kNumeric);
        }
    }
}

/// W of the method under test for the scene's own rows, from the core.
PriorTerm paper_term(const Scene& s, const Mat6& AtA, double w) {
    DegeneracyConfig config;
    config.method = DegeneracyMethod::kPaper;
    config.w = w;
    const Spectrum spectrum{decompose(AtA.topLeftCorner<3, 3>()),
                            decompose(AtA.bottomRightCorner<3, 3>())};
    return DirectionalPrior(config).evaluate(spectrum, s.P.topLeftCorner<3, 3>(),
                                             s.P.bottomRightCorner<3, 3>());
}

/// Rows of the scene as LIO-SAM sees them: in roll, pitch, yaw at x.
struct EulerEquations {
    Mat6 AtA;
    Vec6 Atb;
    EulerEquations(const Scene& s, const Vec6& x) {
        Mat6 J = Mat6::Identity();
        Mat3 E;
        euler_jacobian(x[0], x[1], E.data());
        J.topLeftCorner<3, 3>() = E;
        AtA = J.transpose() * s.AtA * J;
        Atb = J.transpose() * s.Atb;
    }
};

TEST(LioSamAdapter, PriorIsTheGradientOfItsCostInLioSamsVariables) {
    Scene s;
    Adapter a;
    ASSERT_TRUE(a.set("degeneracy.method", "paper"));
    ASSERT_EQ(a.begin_scan(s.input()), Status::kOk);
    const Vec6 x = s.predicted_x + (Vec6() << 0.02, -0.03, 0.04, 0.1, -0.2, 0.05).finished();
    EulerEquations eq(s, x);
    const EulerEquations before = eq;
    ASSERT_EQ(a.condition(x.data(), kVariance, {eq.AtA.data(), eq.Atb.data()}), Status::kOk);

    const PriorTerm term = paper_term(s, s.AtA, 30.0);
    const auto error = [&](const Vec6& at) -> Vec6 {
        const Pose p = pose_of(at);
        Vec6 e;
        e << log_so3(s.predicted.R.transpose() * p.R), p.t - s.predicted.t;
        return e;
    };
    Mat6 W = Mat6::Zero();
    W.topLeftCorner<3, 3>() = kVariance * term.W_r;
    W.bottomRightCorner<3, 3>() = kVariance * term.W_t;
    Mat6 J;
    for (int k = 0; k < 6; ++k) {
        const Vec6 d = 1e-6 * Vec6::Unit(k);
        J.col(k) = (error(x + d) - error(x - d)) / 2e-6;
    }
    const Mat6 added = eq.AtA - before.AtA;
    const Vec6 gradient = before.Atb - eq.Atb;  // A^T b is minus the gradient
    EXPECT_LT((added - J.transpose() * W * J).norm(), kNumeric * added.norm());
    EXPECT_LT((gradient - J.transpose() * W * error(x)).norm(), kNumeric * gradient.norm());
    EXPECT_GT(added.norm(), 1.0);
}

TEST(LioSamAdapter, BothSetsOfVariablesTakeTheSameStep) {
    Scene s;
    for (const char* method : {"none", "paper", "remap", "tsvd"}) {
        Adapter a;
        ASSERT_TRUE(a.set("degeneracy.method", method));
        a.begin_scan(s.input());
        const Vec6 x = s.predicted_x + Vec6::Constant(0.01);
        const Pose pose = pose_of(x);
        EulerEquations euler(s, x);
        a.condition(x.data(), kVariance, {euler.AtA.data(), euler.Atb.data()});
        Mat6 AtA = s.AtA;
        Vec6 Atb = s.Atb;
        a.condition_tangent({pose.R.data(), pose.t.data()}, kVariance, {AtA.data(), Atb.data()});
        Vec6 step = euler.AtA.ldlt().solve(euler.Atb);
        Mat3 E;
        euler_jacobian(x[0], x[1], E.data());
        step.head<3>() = (E * step.head<3>()).eval();
        EXPECT_LT((step - AtA.ldlt().solve(Atb)).norm(), kExact) << method;
    }
}

TEST(LioSamAdapter, RemapReturnsWeakDirectionsToThePrediction) {
    Scene s(2.0);  // far below the threshold of 100
    Adapter a;
    ASSERT_TRUE(a.set("degeneracy.method", "remap"));
    a.begin_scan(s.input());
    Pose x = s.predicted;
    x.t += Vec3(0.3, 0.1, -0.2);
    Mat6 AtA = s.AtA;
    Vec6 Atb = s.Atb;
    a.condition_tangent({x.R.data(), x.t.data()}, kVariance, {AtA.data(), Atb.data()});
    a.end_scan({x.R.data(), x.t.data()}, true);
    const Vec6 step = AtA.ldlt().solve(Atb);
    const Vec3 weak = a.diagnostics().v_t.col(0);
    EXPECT_NEAR(weak.dot(step.tail<3>()), -weak.dot(x.t - s.predicted.t), 1e-6);
    EXPECT_GT(std::abs(weak.x()), 0.99);
}

TEST(LioSamAdapter, XIcpCountsTheRowsItIsShownAndDoesNothingWithoutThem) {
    Scene s(2.0);
    Adapter a;
    ASSERT_TRUE(a.set("degeneracy.method", "xicp"));
    EXPECT_TRUE(a.counts_rows());
    a.begin_scan(s.input());
    const Vec3 shift(0.3, 0.1, -0.2);
    const Vec3 t = s.predicted.t + shift;
    const PoseView at{s.predicted.R.data(), t.data()};
    Mat6 AtA = s.AtA;
    Vec6 Atb = s.Atb;
    a.condition_tangent(at, kVariance, {AtA.data(), Atb.data()});
    EXPECT_EQ(AtA, s.AtA);
    EXPECT_EQ(Atb, s.Atb);
    std::vector<Vec6> rows;  // two hundred in each direction but x
    for (int i = 0; i < 1200; ++i) {
        if (i % 6 != 3) rows.push_back(Vec6::Unit(i % 6));
    }
    const int count = static_cast<int>(rows.size());
    const RowView view{{rows[0].data(), count, 6, 1}, {rows[0].data() + 3, count, 6, 1}};
    a.condition_tangent(at, kVariance, {AtA.data(), Atb.data(), &view});
    a.end_scan(at, true);
    const Vec3 weak = a.diagnostics().v_t.col(0);
    EXPECT_GT(std::abs(weak.x()), 0.98);
    const Vec6 step = AtA.ldlt().solve(Atb);
    EXPECT_NEAR(weak.dot(step.tail<3>()), -weak.dot(shift), 1e-6);
    EXPECT_GT((step.tail<3>() + shift).norm(), 0.1);  // the other directions are the scan's
}

TEST(LioSamAdapter, DegenerateFlagIsOfTheRowsAloneHoweverStrongThePrior) {
    for (const double along_x : {2.0, 400.0}) {
        Scene s(along_x);
        Adapter a;
        ASSERT_TRUE(a.set("degeneracy.method", "paper"));
        ASSERT_TRUE(a.set("degeneracy.w", "1e9"));
        a.begin_scan(s.input());
        for (int iteration = 0; iteration < 3; ++iteration) {
            Mat6 AtA = s.AtA;
            Vec6 Atb = s.Atb;
            a.condition_tangent({s.predicted.R.data(), s.predicted.t.data()}, kVariance,
                                {AtA.data(), Atb.data()});
            EXPECT_EQ(a.degenerate(), along_x < 10.0);
        }
    }
}

TEST(LioSamAdapter, NoneLeavesTheEquationsUntouchedToTheBit) {
    Scene s;
    Adapter a;
    a.begin_scan(s.input());
    EulerEquations eq(s, s.predicted_x);
    const EulerEquations before = eq;
    EXPECT_EQ(a.condition(s.predicted_x.data(), kVariance, {eq.AtA.data(), eq.Atb.data()}),
              Status::kOk);
    EXPECT_EQ(eq.AtA, before.AtA);
    EXPECT_EQ(eq.Atb, before.Atb);
    EXPECT_EQ(a.has_prior(), false);
}

TEST(LioSamAdapter, BadInputRunsOnTheHostsGatesAndChangesNothing) {
    Scene s;
    Adapter a;
    ASSERT_TRUE(a.set("rejection.mode", "fixed"));
    ASSERT_TRUE(a.set("degeneracy.method", "paper"));
    Mat6 AtA = s.AtA;
    Vec6 Atb = s.Atb;
    const NormalEquations eq{AtA.data(), Atb.data()};
    const PoseView view{s.predicted.R.data(), s.predicted.t.data()};
    EXPECT_EQ(a.condition_tangent(view, kVariance, eq), Status::kNoScan);
    s.P(4, 4) = kNaN;
    EXPECT_EQ(a.begin_scan(s.input()), Status::kBadInput);
    EXPECT_EQ(a.gate(Near(0.01F, 2.0F).candidate(0)), kInfinity);  // upstream's 1 m^2
    EXPECT_EQ(a.condition_tangent(view, kVariance, eq), Status::kNoScan);
    const Scene whole;
    ScanInput none = whole.input();
    none.covariance = nullptr;
    EXPECT_EQ(a.begin_scan(none), Status::kBadInput);
    EXPECT_EQ(a.gate(Near().candidate(77)), kInfinity);  // no such feature
    EXPECT_EQ(a.weigh(Feature::kSurface, 77, 1.0), 0.0);
    EXPECT_EQ(a.end_scan(view, false), Status::kNoScan);

    const Scene good;
    ASSERT_EQ(a.begin_scan(good.input()), Status::kOk);
    Vec6 steep = good.predicted_x;
    steep[1] = M_PI / 2;
    EXPECT_EQ(a.condition(steep.data(), kVariance, eq), Status::kSingular);
    steep[1] = kNaN;
    EXPECT_EQ(a.condition(steep.data(), kVariance, eq), Status::kBadInput);
    EXPECT_EQ(AtA, s.AtA);
    AtA(0, 0) = kNaN;
    EXPECT_EQ(a.condition_tangent(view, kVariance, eq), Status::kBadInput);
}

TEST(LioSamAdapter, RefusesUnknownKeysAndBadValuesByName) {
    Adapter a;
    EXPECT_FALSE(a.set("rejection.mode", "kis"));
    EXPECT_NE(std::string(a.error()).find("rejection.mode"), std::string::npos);
    EXPECT_FALSE(a.set("degeneracy.w", "nan"));
    EXPECT_FALSE(a.set("no.such.key", "1"));
}

}  // namespace
}  // namespace d2lio::liosam
