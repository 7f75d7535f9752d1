// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "random_state.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kVariance = 0.001;
constexpr double kExact = 1e-9;

/// Five neighbours on the plane z = 0 around the origin of a patch, with what accept needs.
struct Patch {
    float neighbours[15] = {0.1F, 0,    0,    -0.1F, 0.05F, 0,     0, 0.2F,
                            0,    0.2F, 0.2F, 0,     -0.2F, -0.2F, 0};
    float sq[5] = {0.01F, 0.02F, 0.04F, 0.08F, 0.09F};
    float p[3] = {0.F, 0.F, 0.05F};
    Candidate candidate(std::size_t index = 0) const {
        Candidate c{};
        c.index = index;
        c.fresh = true;
        c.imu_range = c.lidar_range = 10.0;
        c.p_map = p;
        c.neighbours = neighbours;
        c.sq_distances = sq;
        c.neighbour_step = 3;
        c.distance_step = 1;
        c.neighbour_count = 5;
        return c;
    }
    void lift(float z) {  // planes through the origin of the map cannot be expressed upstream
        for (int i = 0; i < 5; ++i) neighbours[3 * i + 2] += z;
        p[2] += z;
    }
};

struct Scene {
    Pose previous, predicted;
    Mat23x23 P = Mat23x23::Identity() * 1e-2;
    ScanInput input(std::size_t points = 4) const {
        return {{previous.R.data(), previous.t.data()},
                {predicted.R.data(), predicted.t.data()},
                P.data(),
                23,
                0,
                3,
                points,
                false};
    }
    PoseView view() const { return {predicted.R.data(), predicted.t.data()}; }
};

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor>;

Rows view(RowMatrix& H, Eigen::VectorXd& r) {
    return {H.data(), r.data(), static_cast<int>(H.rows()), 12, 1, 0, 3, 6};
}

TEST(Adapter, RefusesUnknownKeysAndBadValuesByName) {
    Adapter a;
    EXPECT_TRUE(a.set("rejection.mode", "kiss"));
    EXPECT_STREQ(a.error(), "");
    EXPECT_FALSE(a.set("rejection.mode", "kis"));
    EXPECT_NE(std::string(a.error()).find("rejection.mode"), std::string::npos);
    EXPECT_FALSE(a.set("rejection.tua", "2"));
    EXPECT_FALSE(a.set("degeneracy.w", "nan"));
    EXPECT_TRUE(a.rejects());
    EXPECT_FALSE(a.has_prior());
}

TEST(Adapter, OffAppliesUpstreamsGates) {
    Adapter a;
    Patch patch;
    patch.lift(2.F);
    Correspondence m{};
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(patch.candidate(0), &m), Verdict::kAccepted);
    EXPECT_NEAR(std::abs(m.residual), 0.05, 1e-5);
    EXPECT_NEAR(std::abs(m.normal[2]), 1.0, 1e-5);
    Patch far = patch;
    far.sq[4] = 5.01F;
    EXPECT_EQ(a.accept(far.candidate(1), &m), Verdict::kFarNeighbours);
    Patch off = patch;
    off.p[2] += 0.4F;  // sqrt(10) / 9 = 0.351 m is the bound at 10 m
    EXPECT_EQ(a.accept(off.candidate(2), &m), Verdict::kResidual);
    Candidate few = patch.candidate(3);
    few.neighbour_count = 4;
    EXPECT_EQ(a.accept(few, &m), Verdict::kFewNeighbours);
}

TEST(Adapter, ModesSwitchTheHostsDistanceGatesOff) {
    Adapter a;
    a.set("rejection.mode", "none");
    Patch far;
    far.lift(2.F);
    far.sq[4] = 50.F;
    far.p[2] += 1.F;
    Correspondence m{};
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(far.candidate(0), &m), Verdict::kAccepted);
    a.set("rejection.keep_host_gate", "true");
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(far.candidate(0), &m), Verdict::kFarNeighbours);
}

TEST(Adapter, FixedThresholdCutsAtTau) {
    Adapter a;
    a.set("rejection.mode", "fixed");
    a.set("rejection.tau", "0.5");
    Patch p;
    p.lift(2.F);
    p.sq[0] = 0.2499F;
    Correspondence m{};
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(p.candidate(0), &m), Verdict::kAccepted);
    p.sq[0] = 0.2501F;
    EXPECT_EQ(a.accept(p.candidate(1), &m), Verdict::kThreshold);
}

TEST(Adapter, ARejectedPointStaysOutUntilTheNextSearch) {
    Adapter a;
    Patch off;
    off.lift(2.F);
    off.p[2] += 0.4F;
    Correspondence m{};
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(off.candidate(0), &m), Verdict::kResidual);
    off.p[2] -= 0.4F;
    Candidate again = off.candidate(0);
    again.fresh = false;
    EXPECT_EQ(a.accept(again, &m), Verdict::kResidual);
    EXPECT_EQ(a.accept(off.candidate(0), &m), Verdict::kAccepted);
}

TEST(Adapter, SingularPlanesHaveTheirOwnReason) {
    Adapter a;
    a.set("rejection.mode", "none");
    Patch line;
    for (int i = 0; i < 5; ++i) {
        line.neighbours[3 * i] = 0.1F * static_cast<float>(i);
        line.neighbours[3 * i + 1] = 1.F;
        line.neighbours[3 * i + 2] = 2.F;
    }
    Correspondence m{};
    a.begin_scan(Scene().input());
    EXPECT_EQ(a.accept(line.candidate(0), &m), Verdict::kSingularPlane);
    a.end_scan(Scene().view(), true, nullptr, 0);
    EXPECT_EQ(a.diagnostics().counts.singular_plane, 1);
}

/// A mode that keeps the host's gates and whose threshold never binds decides as upstream does: the
/// thin patch that a mode of ours would call singular is a plane to upstream.
TEST(Adapter, KeptHostGatesWithAnIdleThresholdDecideAsOff) {
    Adapter off, kept;
    kept.set("rejection.mode", "fixed");
    kept.set("rejection.keep_host_gate", "true");
    kept.set("rejection.tau", "2.2361");
    off.begin_scan(Scene().input(200));
    kept.begin_scan(Scene().input(200));
    std::mt19937 random(11);
    std::uniform_real_distribution<float> unit(-1.F, 1.F);
    int accepted = 0;
    for (std::size_t i = 0; i < 200; ++i) {
        Patch patch;
        for (int k = 0; k < 5; ++k) {
            patch.neighbours[3 * k] = unit(random);
            const float width = i % 2 == 0 ? 1e-3F : 1.F;
            patch.neighbours[3 * k + 1] = width * unit(random);
            patch.neighbours[3 * k + 2] = 2.F + 0.08F * width * unit(random);
            patch.sq[k] = 1.2F * static_cast<float>(k + 1);
        }
        patch.sq[4] = 4.F + 2.F * std::abs(unit(random));
        patch.p[2] = 2.F + 0.5F * unit(random);
        Correspondence a{}, b{};
        const Verdict verdict = off.accept(patch.candidate(i), &a);
        EXPECT_EQ(kept.accept(patch.candidate(i), &b), verdict) << i;
        if (verdict != Verdict::kAccepted) continue;
        ++accepted;
        EXPECT_EQ(a.residual, b.residual);
    }
    EXPECT_GT(accepted, 20);
    EXPECT_LT(accepted, 180);
}

TEST(Adapter, BadCallsAreRefusedWithoutHarm) {
    Adapter a;
    EXPECT_FALSE(a.set(nullptr, "1"));
    EXPECT_FALSE(a.set("rejection.tau", nullptr));
    EXPECT_FALSE(a.set_map_voxel(-1.0));
    EXPECT_EQ(a.param(10000).key, nullptr);
    EXPECT_EQ(a.diagnostics_name(10000), nullptr);
    EXPECT_TRUE(std::isnan(a.diagnostics_value(10000)));
    const Scene scene;  // the views point into it
    ScanInput in = scene.input();
    in.covariance = nullptr;
    EXPECT_EQ(a.begin_scan(in), Status::kBadInput);
    in = scene.input();
    in.rotation_index = 21;
    EXPECT_EQ(a.begin_scan(in), Status::kBadInput);
    EXPECT_TRUE(a.check());
    a.set("rejection.mode", "point_adaptive");
    a.set("rejection.motion", "deviation");
    a.set("rejection.epsilon_0", "0");
    EXPECT_FALSE(a.check());
    EXPECT_NE(std::string(a.error()).find("epsilon_0"), std::string::npos);
}

TEST(Adapter, BadInputFallsBackToTheHostsGatesAndIsNotTheLastScan) {
    Adapter a;
    a.set("rejection.mode", "fixed");
    a.set("rejection.tau", "0.01");
    Patch patch;
    patch.lift(2.F);
    Correspondence m{};
    Scene s;
    a.begin_scan(s.input());
    EXPECT_EQ(a.accept(patch.candidate(0), &m), Verdict::kThreshold);
    a.end_scan(s.view(), true, nullptr, 0);
    Scene bad;
    bad.P(0, 0) = std::numeric_limits<double>::infinity();
    EXPECT_EQ(a.begin_scan(bad.input()), Status::kBadInput);
    EXPECT_EQ(a.accept(patch.candidate(0), &m), Verdict::kAccepted);
    a.end_scan(s.view(), true, nullptr, 0);
    EXPECT_EQ(a.diagnostics().counts.threshold, 0);
    EXPECT_EQ(a.diagnostics().counts.accepted, 1);
}

TEST(Adapter, NaNInputRunsWithoutThePlugIn) {
    Adapter a;
    a.set("degeneracy.method", "paper");
    Scene s;
    s.predicted.t.x() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(a.begin_scan(s.input()), Status::kBadInput);
    RowMatrix H = RowMatrix::Ones(30, 12);
    Eigen::VectorXd r = Eigen::VectorXd::Ones(30);
    PriorBlock prior{};
    EXPECT_EQ(a.condition(view(H, r), s.view(), kVariance, &prior), Status::kNoScan);
    EXPECT_EQ(prior.count, 0);
    EXPECT_EQ(a.end_scan(s.view(), true, nullptr, 0), Status::kNoScan);
}

/// Random rows with little information along the map's x axis.
RowMatrix weak_rows(test::Random& random, Eigen::Index n) {
    RowMatrix H = RowMatrix::Zero(n, 12);
    for (Eigen::Index i = 0; i < n; ++i) {
        const Vec3 normal(0.02 * random.normal(), random.normal(), random.normal());
        H.block<1, 3>(i, 0) = normal.normalized().transpose();
        H.block<1, 3>(i, 3) = 3.0 * random.vec3(1.0).transpose();
    }
    return H;
}

TEST(Adapter, PriorRowsEqualTheInformationForm) {
    Adapter a;
    a.set("degeneracy.method", "paper");
    a.set("degeneracy.lambda_min", "1e-9");
    test::Random random(1);
    Scene s;
    s.P = random.covariance();
    ASSERT_EQ(a.begin_scan(s.input()), Status::kOk);
    RowMatrix H = weak_rows(random, 200);
    const RowMatrix before = H;
    Eigen::VectorXd r = Eigen::VectorXd::Zero(200);
    PriorBlock prior{};
    ASSERT_EQ(a.condition(view(H, r), s.view(), kVariance, &prior), Status::kOk);
    EXPECT_EQ(H, before);  // this method adds rows and leaves the scan's alone
    ASSERT_EQ(prior.count, 6);
    Eigen::Matrix<double, 6, 6, Eigen::RowMajor> J;
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) J(i, j) = prior.jacobian[i][j];
    }
    const Mat6 information = J.transpose() * J / kVariance;
    // The same weight from its definition, w P^-1/2 (A^T A)^-1 P^-1/2.
    const auto weight = [](const Mat3& AtA, const Mat3& P) -> Mat3 {
        const Eigen::SelfAdjointEigenSolver<Mat3> root(P);
        return 30.0 * root.operatorInverseSqrt() * AtA.inverse() * root.operatorInverseSqrt();
    };
    const Mat3 W_t = weight(H.leftCols<3>().transpose() * H.leftCols<3>(), s.P.block<3, 3>(0, 0));
    const Mat3 W_r =
        weight(H.middleCols<3>(3).transpose() * H.middleCols<3>(3), s.P.block<3, 3>(3, 3));
    EXPECT_LT((information.topLeftCorner<3, 3>() - W_t).norm(), 1e-8 * W_t.norm());
    EXPECT_LT((information.bottomRightCorner<3, 3>() - W_r).norm(), 1e-8 * W_r.norm());
    EXPECT_LT((information.topRightCorner<3, 3>().norm()), kExact);
}

TEST(Adapter, ColumnMajorRowsGiveTheSame) {
    test::Random random(2);
    RowMatrix H = weak_rows(random, 50);
    Eigen::Matrix<double, Eigen::Dynamic, 12> C = H;
    Eigen::VectorXd r = Eigen::VectorXd::Zero(50);
    PriorBlock p{}, q{};
    Adapter a;
    a.set("degeneracy.method", "paper");
    a.begin_scan(Scene().input());
    a.condition(view(H, r), Scene().view(), kVariance, &p);
    a.condition({C.data(), r.data(), 50, 1, 50, 0, 3, 6}, Scene().view(), kVariance, &q);
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) EXPECT_EQ(p.jacobian[i][j], q.jacobian[i][j]);
    }
}

TEST(Adapter, RemapTakesTheWeakDirectionOutOfTheRows) {
    Adapter a;
    a.set("degeneracy.method", "remap");
    a.set("degeneracy.threshold_r", "0");
    test::Random random(3);
    RowMatrix H = weak_rows(random, 400);
    Eigen::VectorXd r = Eigen::VectorXd::Zero(400);
    PriorBlock prior{};
    a.begin_scan(Scene().input());
    a.condition(view(H, r), Scene().view(), kVariance, &prior);
    EXPECT_EQ(prior.count, 1);  // which holds it
    const Eigen::SelfAdjointEigenSolver<Mat3> left(H.leftCols<3>().transpose() * H.leftCols<3>());
    EXPECT_LT(left.eigenvalues()[0], kExact);
    EXPECT_GT(left.eigenvalues()[1], 50.0);
}

/// The step of the filter with the rows H | r and those of the prior.
Vec3 position_step(const Scene& s, const RowMatrix& H, const Eigen::VectorXd& r,
                   const PriorBlock& prior) {
    Mat23x23 information = kVariance * s.P.inverse();
    Eigen::Matrix<double, 23, 1> Htr = Eigen::Matrix<double, 23, 1>::Zero();
    information.topLeftCorner<12, 12>() += H.transpose() * H;
    Htr.head<12>() = H.transpose() * r;
    for (int i = 0; i < prior.count; ++i) {
        const Eigen::Map<const Vec6> h(prior.jacobian[i]);
        information.topLeftCorner<6, 6>() += h * h.transpose();
        Htr.head<6>() += h * prior.residual[i];
    }
    return information.ldlt().solve(Htr).head<3>();
}

/// Taking a direction out of the rows is not enough where P couples it with what they see.
TEST(Adapter, WhatIsHeldKeepsThePredictionWhateverPCouplesItWith) {
    const std::map<std::string, std::map<std::string, std::string>> methods{
        {"remap", {{"degeneracy.threshold_r", "0"}}},
        {"tsvd", {}},
        {"xicp", {{"degeneracy.kappa_2", "40"}, {"degeneracy.kappa_3", "40"}}}};
    for (const auto& [method, params] : methods) {
        Adapter a;
        ASSERT_TRUE(a.set("degeneracy.method", method.c_str()));
        for (const auto& [key, value] : params) ASSERT_TRUE(a.set(key.c_str(), value.c_str()));
        test::Random random(6);
        Scene s;
        s.P = random.covariance();
        a.begin_scan(s.input());
        RowMatrix H = weak_rows(random, 300);
        Eigen::VectorXd r = 0.1 * H.col(1) + 0.05 * H.col(2);  // the scan has moved across
        const Vec3 weakest =
            Eigen::SelfAdjointEigenSolver<Mat3>(H.leftCols<3>().transpose() * H.leftCols<3>())
                .eigenvectors()
                .col(0);
        PriorBlock prior{};
        ASSERT_EQ(a.condition(view(H, r), s.view(), kVariance, &prior), Status::kOk);
        EXPECT_EQ(prior.count, 1) << method;
        const Vec3 free = position_step(s, H, r, PriorBlock{});
        const Vec3 held = position_step(s, H, r, prior);
        EXPECT_GT(std::abs(weakest.dot(free)), 0.01) << method;
        EXPECT_LT(std::abs(weakest.dot(held)), 1e-5) << method;
        EXPECT_NEAR(held.y(), 0.1, 0.01) << method;
        EXPECT_NEAR(held.z(), 0.05, 0.01) << method;
        Eigen::MatrixXd Hx = Eigen::MatrixXd::Zero(301, 23);
        Hx.topLeftCorner<300, 12>() = H;
        const Mat23x23 without =
            Mat23x23(s.P.inverse() + Hx.transpose() * Hx / kVariance).inverse();
        for (int j = 0; j < 6; ++j) Hx(300, j) = prior.jacobian[0][j];
        Mat23x23 P = Mat23x23(s.P.inverse() + Hx.transpose() * Hx / kVariance).inverse();
        EXPECT_EQ(a.end_scan(s.view(), true, P.data(), 23), Status::kOk);
        EXPECT_LT((P - without).norm(), 1e-6 * without.norm()) << method;
    }
}

TEST(Adapter, TheKeptCovarianceDoesNotClaimThePrior) {
    test::Random random(4);
    Scene s;
    s.P = random.covariance();
    RowMatrix H = weak_rows(random, 100);
    Eigen::VectorXd r = Eigen::VectorXd::Zero(100);
    PriorBlock prior{};
    Adapter a;
    a.set("degeneracy.method", "paper");
    a.begin_scan(s.input());
    a.condition(view(H, r), s.view(), kVariance, &prior);
    Eigen::MatrixXd Hx = Eigen::MatrixXd::Zero(100, 23), Hp = Eigen::MatrixXd::Zero(6, 23);
    Hx.leftCols<12>() = H;
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) Hp(i, j) = prior.jacobian[i][j];
    }
    const Mat23x23 data = s.P.inverse() + Hx.transpose() * Hx / kVariance;
    const Mat23x23 without = data.inverse();
    Mat23x23 P = (data + Hp.transpose() * Hp / kVariance).inverse();
    EXPECT_GT((P - without).norm(), 1e-3 * without.norm());
    EXPECT_EQ(a.end_scan(s.view(), true, P.data(), 23), Status::kOk);
    EXPECT_LT((P - without).norm(), 1e-6 * without.norm());
}

TEST(Adapter, DiagnosticsNameTheWeakDirection) {
    Adapter a;
    test::Random random(5);
    RowMatrix H = weak_rows(random, 2000);
    Eigen::VectorXd r = Eigen::VectorXd::Zero(2000);
    PriorBlock prior{};
    a.begin_scan(Scene().input());
    a.condition(view(H, r), Scene().view(), kVariance, &prior);
    Pose posterior;
    posterior.t = Vec3(0.3, 0.04, 0.0);
    a.end_scan({posterior.R.data(), posterior.t.data()}, true, nullptr, 0);
    const ScanDiagnostics& d = a.diagnostics();
    EXPECT_EQ(d.weak_t, 1);
    EXPECT_GT(d.v_t(0, 0), 0.999);
    EXPECT_NEAR(d.correction_weak_t, 0.3, 0.01);
    EXPECT_EQ(d.correction, posterior.t);
    std::map<std::string, double> columns;
    for (std::size_t i = 0; i < a.diagnostics_size(); ++i) {
        columns[a.diagnostics_name(i)] = a.diagnostics_value(i);
    }
    EXPECT_EQ(columns.at("weak_t"), 1.0);
    EXPECT_EQ(columns.at("lambda_t_1"), d.lambda_t[0]);
}

}  // namespace
}  // namespace d2lio::fastlio
