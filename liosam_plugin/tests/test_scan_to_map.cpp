// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/geometry/so3.hpp"
#include "line_fit.hpp"
#include "scan_to_map.hpp"

namespace d2lio::liosam {
namespace {

using Cloud = std::vector<Eigen::Vector3f>;
using ParamMap = std::map<std::string, std::string>;

constexpr double kAligned = 2e-3;  ///< m and rad: float maps with 5 mm of noise, 1000 points
const float kNotANumber = std::numeric_limits<float>::quiet_NaN();

/// Points on the walls, floor and edges of a box, and the same as a scan seen from `truth`.
struct Box {
    Cloud walls, edges;
    Pose truth{exp_so3(Vec3(0.05, -0.03, 0.4)), Vec3(0.4, -0.3, 0.2)};
    IkdTree wall_map, edge_map;
    MatchOptions options;

    /// @param ends whether the box has walls across x; without them it is a corridor along x.
    explicit Box(bool ends = true, double noise = 0.005) {
        std::mt19937 random(11);
        std::uniform_real_distribution<float> u(-1.F, 1.F);
        std::normal_distribution<float> error(0.F, static_cast<float>(noise));
        const Eigen::Vector3f half(6.F, 4.F, 1.5F);
        for (int i = 0; i < 12000; ++i) {
            Eigen::Vector3f p(u(random) * half.x(), u(random) * half.y(), u(random) * half.z());
            const int axis = i % (ends ? 3 : 2) + (ends ? 0 : 1);
            p[axis] = (u(random) > 0 ? half[axis] : -half[axis]) + error(random);
            walls.push_back(p + Eigen::Vector3f(20.F, 10.F, 3.F));  // away from the origin
        }
        for (int i = 0; i < 400; ++i) {
            const float z = u(random) * half.z();
            Eigen::Vector3f p(u(random) > 0 ? half.x() : -half.x(),
                              u(random) > 0 ? half.y() : -half.y(), z);
            p += Eigen::Vector3f(error(random), error(random), 0.F);
            edges.push_back(p + Eigen::Vector3f(20.F, 10.F, 3.F));
        }
        truth.t += Vec3(20, 10, 3);
        wall_map.build(walls);
        edge_map.build(edges);
    }
    Cloud seen(const Cloud& map, std::size_t step) const {
        Cloud out;
        for (std::size_t i = 0; i < map.size(); i += step) {
            out.push_back((truth.inverse() * map[i].cast<double>()).cast<float>());
        }
        return out;
    }
    Pose guess(double size = 1.0) const {
        return {truth.R * exp_so3(size * Vec3(0.02, -0.015, 0.03)),
                truth.t + size * Vec3(0.10, -0.08, 0.06)};
    }
};

/// One whole scan through adapter and matcher.
struct Matching {
    MatchReport report;
    Pose estimate;
    ScanDiagnostics diagnostics;

    Matching(const Box& box, const Cloud& corners, const Cloud& surfaces, const Pose& guess,
             const ParamMap& params = {}, int threads = 1) {
        Adapter adapter;
        for (const auto& [key, value] : params)
            EXPECT_TRUE(adapter.set(key.c_str(), value.c_str()));
        Mat6 P = Mat6::Identity() * 1e-6;
        const Pose previous = guess;
        adapter.begin_scan({{previous.R.data(), previous.t.data()},
                            {guess.R.data(), guess.t.data()},
                            P.data(),
                            corners.size(),
                            surfaces.size()});
        ScanToMap matcher(adapter, box.options, threads);
        estimate = guess;
        report = matcher.align({corners, surfaces, box.edge_map, box.wall_map}, estimate);
        adapter.end_scan({estimate.R.data(), estimate.t.data()}, report.converged);
        diagnostics = adapter.diagnostics();
    }
    double error(const Pose& truth) const {
        return (estimate.t - truth.t).norm() + log_so3(truth.R.transpose() * estimate.R).norm();
    }
};

TEST(ScanToMap, FindsThePoseWithEveryModeAndMethod) {
    const Box box;
    const Cloud corners = box.seen(box.edges, 5), surfaces = box.seen(box.walls, 13);
    for (const char* mode : {"off", "none", "fixed", "kiss", "point_adaptive"}) {
        for (const char* method : {"none", "remap"}) {
            const Matching run(box, corners, surfaces, box.guess(),
                               {{"rejection.mode", mode}, {"degeneracy.method", method}});
            EXPECT_EQ(run.report.status, MatchStatus::kOk);
            EXPECT_TRUE(run.report.converged);
            EXPECT_LT(run.error(box.truth), kAligned) << mode << " " << method;
            EXPECT_FALSE(run.report.degenerate);
        }
    }
}

/// A ring on a wall: its five points lie on a line but for their noise.
TEST(ScanToMap, NeighboursOnALineHaveAPlaneInLioSamOnly) {
    Box box;
    Cloud ring;
    for (int i = 0; i < 3; ++i) ring.emplace_back(0.F, 0.3F * float(i), 0.F);
    ring.emplace_back(0.F, 0.9F, 1e-4F);
    ring.emplace_back(1e-4F, 1.2F, 0.F);
    for (Eigen::Vector3f& p : ring) p += Eigen::Vector3f(5.F, 0.F, 1.F);
    box.wall_map.build(ring);
    const Cloud scan = box.seen(ring, 1);
    Matching run(box, {}, scan, box.truth);
    EXPECT_EQ(run.diagnostics.counts.singular_plane, 0);
    box.options.min_spread_ratio = PlaneFitOptions{}.min_spread_ratio;
    run = Matching(box, {}, scan, box.truth);
    EXPECT_EQ(run.diagnostics.counts.singular_plane, 3);  // the ends have neighbours too far away
}

TEST(ScanToMap, CornersAloneFixAPose) {
    Box box(true, 0.0);
    box.options.eigenvalue_threshold = 0.0;  // 130 rows are too few for it
    const Matching run(box, box.seen(box.edges, 3), {}, box.guess());
    EXPECT_EQ(run.report.status, MatchStatus::kOk);
    const Vec3 d = run.estimate.t - box.truth.t;
    EXPECT_LT(d.head<2>().norm(), kAligned);  // vertical edges leave z alone
}

TEST(ScanToMap, NoPitchIsSingular) {
    Box box;
    box.truth.R = exp_so3(Vec3(0, M_PI / 2, 0)) * box.truth.R;
    const Matching run(box, box.seen(box.edges, 5), box.seen(box.walls, 13), box.guess());
    EXPECT_LT(run.error(box.truth), kAligned);
}

TEST(ScanToMap, InACorridorUpstreamsRemedyKeepsTheGuessAlongIt) {
    const Box box(false, 0.0);
    const Matching run(box, {}, box.seen(box.walls, 13), box.guess());
    EXPECT_TRUE(run.report.remapped);
    EXPECT_TRUE(run.report.degenerate);
    EXPECT_NEAR(run.estimate.t.x(), box.guess().t.x(), 0.02);
    EXPECT_LT((run.estimate.t - box.truth.t).tail<2>().norm(), kAligned);
}

TEST(ScanToMap, InACorridorThePriorReturnsToThePrediction) {
    const Box box(false);
    const Matching run(box, {}, box.seen(box.walls, 13), box.guess(),
                       {{"degeneracy.method", "paper"}, {"degeneracy.w", "1000"}});
    EXPECT_TRUE(run.report.degenerate);
    EXPECT_FALSE(run.report.remapped);
    EXPECT_NEAR(run.estimate.t.x(), box.guess().t.x(), 5e-3);
    EXPECT_EQ(run.diagnostics.weak_t, 1);
    EXPECT_GT(std::abs(run.diagnostics.v_t(0, 0)), 0.99);
}

TEST(ScanToMap, InformationIsTheSecondDerivativeOfTheCost) {
    // Point-to-plane rows against planes do not change with a small step, so the cost's change is
    // d^T (A^T A) d / 2 around the optimum.
    Box box(true, 0.0);
    box.options.max_iterations = 50;
    box.options.rotation_epsilon = box.options.translation_epsilon = 1e-7;
    Cloud surfaces;
    std::vector<Eigen::Index> axes;  // of the wall a point lies on
    const Vec3 half(6.0, 4.0, 1.5);
    for (std::size_t i = 0; i < box.walls.size(); i += 7) {
        const Vec3 p = box.walls[i].cast<double>() - Vec3(20, 10, 3);
        const auto axis = static_cast<Eigen::Index>(i % 3);
        const Vec3 share = p.cwiseAbs().cwiseQuotient(half);
        if (share.sum() - share[axis] > 1.4) continue;  // near an edge planes mix
        surfaces.push_back((box.truth.inverse() * box.walls[i].cast<double>()).cast<float>());
        axes.push_back(axis);
    }
    const Matching best(box, {}, surfaces, box.truth);
    const auto cost = [&](const Vec6& d) {
        const Pose T{best.estimate.R * exp_so3(d.head<3>()), best.estimate.t + d.tail<3>()};
        double sum = 0.0;
        for (std::size_t i = 0; i < surfaces.size(); ++i) {
            const Vec3 q = T * surfaces[i].cast<double>() - Vec3(20, 10, 3);
            sum += 0.5 * std::pow(std::abs(q[axes[i]]) - half[axes[i]], 2);
        }
        return sum;
    };
    for (int k = 0; k < 6; ++k) {
        const Vec6 d = 1e-3 * Vec6::Unit(k);
        const double numeric = (cost(d) + cost(-d) - 2.0 * cost(Vec6::Zero())) / 1e-6;
        EXPECT_NEAR(best.report.information(k, k) / numeric, 1.0, 0.05) << k;
    }
}

/// After scans that fitted to millimetres the kernel is narrow; then the guess is 1.1 m and 18
/// degrees off, as at a start in motion.
TEST(ScanToMap, ANarrowKernelDoesNotHoldAScanThatIsFarFromTheMap) {
    Box box;
    box.options.kernel_scale = 0.1;
    box.options.eigenvalue_threshold = 0.0;  // the kernel's weights are too small for it
    const Cloud surfaces = box.seen(box.walls, 13);
    Adapter adapter;
    ASSERT_TRUE(adapter.set("degeneracy.method", "noise_aware"));
    ScanToMap matcher(adapter, box.options, 1);
    const Mat6 P = Mat6::Identity() * 1e-6;
    for (const Pose& guess : {box.truth, box.truth, box.guess(8.0)}) {
        Pose estimate = guess;
        const PoseView at{guess.R.data(), guess.t.data()};
        adapter.begin_scan({at, at, P.data(), 0, surfaces.size()});
        matcher.align({{}, surfaces, box.edge_map, box.wall_map}, estimate);
        adapter.end_scan({estimate.R.data(), estimate.t.data()}, true);
        EXPECT_LT((estimate.t - box.truth.t).norm(), kAligned);
    }
}

TEST(ScanToMap, ThreadCountDoesNotChangeABit) {
    const Box box;
    const Cloud corners = box.seen(box.edges, 3), surfaces = box.seen(box.walls, 7);
    const Matching one(box, corners, surfaces, box.guess(), {}, 1);
    const Matching three(box, corners, surfaces, box.guess(), {}, 3);
    EXPECT_EQ(one.estimate.R, three.estimate.R);
    EXPECT_EQ(one.estimate.t, three.estimate.t);
    EXPECT_EQ(one.report.information, three.report.information);
}

TEST(ScanToMap, TooFewFeaturesLeaveTheGuess) {
    const Box box;
    Cloud few = box.seen(box.walls, 13);
    few.resize(30);
    const Matching run(box, {}, few, box.guess());
    EXPECT_EQ(run.report.status, MatchStatus::kFewRows);
    EXPECT_EQ(run.estimate.t, box.guess().t);
    EXPECT_EQ(Matching(box, {}, {}, box.guess()).report.status, MatchStatus::kFewRows);
}

TEST(ScanToMap, EmptyMapsAndPointsThatAreNoneAreSurvived) {
    Box box;
    Cloud surfaces = box.seen(box.walls, 13);
    surfaces[3].x() = kNotANumber;
    surfaces[4] = Eigen::Vector3f::Constant(1e30F);
    const Matching run(box, {}, surfaces, box.guess(), {{"rejection.mode", "none"}});
    EXPECT_TRUE(run.estimate.t.allFinite());
    box.wall_map.clear();
    EXPECT_EQ(Matching(box, {}, surfaces, box.guess()).report.status, MatchStatus::kFewRows);
}

TEST(LineFit, FindsTheLineAndRefusesBlobs) {
    const float line[] = {0, 0, 0, 1, 1, 0, 2, 2, 0, 3, 3, 0, 4, 4, 0};
    Line fit;
    ASSERT_TRUE(fit_line(line, 3, 5, fit));
    EXPECT_NEAR(std::abs(fit.direction.dot(Eigen::Vector3f(1, 1, 0).normalized())), 1.0, 1e-6);
    EXPECT_NEAR(fit.away_from({2, 2, 1}).z(), 1.0, 1e-6);
    EXPECT_NEAR(fit.away_from({2, 2, 0}).dot(fit.direction), 0.0, 1e-6);  // on the line
    const float blob[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0.5F, 0.5F, 0};
    EXPECT_FALSE(fit_line(blob, 3, 5, fit));
    const float same[] = {1, 2, 3, 1, 2, 3, 1, 2, 3};
    EXPECT_FALSE(fit_line(same, 3, 3, fit));
    const float bad[] = {0, 0, 0, 1, 1, kNotANumber, 2, 2, 0};
    EXPECT_FALSE(fit_line(bad, 3, 3, fit));
    EXPECT_FALSE(fit_line(line, 3, 1, fit));
}

}  // namespace
}  // namespace d2lio::liosam
