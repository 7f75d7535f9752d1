// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <vector>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "random_state.hpp"

/// A tunnel as method noise_aware of the adapter sees it.
namespace d2lio::fastlio::test {

using d2lio::test::Random;

constexpr double kVariance = 0.001;
constexpr double kMapNoise = 0.02;  // m
constexpr int kSettling = 20;       // scans that a filter which did not begin at rest gets whole

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor>;

/// A point on a surface and its five neighbours in the map.
struct Target {
    Vec3 origin, u, v;  ///< u, v span the surface
    double bend = 0.0;  ///< 1/m, along u, towards u x v
    std::array<float, 15> neighbours{};
    std::array<float, 3> p{};

    Vec3 at(double a, double b) const {
        return origin + a * u + b * v + 0.5 * bend * a * a * u.cross(v);
    }
    void fill(Random& random, double noise) {
        constexpr double kPlaces[5][2] = {
            {-0.25, -0.2}, {0.2, -0.25}, {0.25, 0.2}, {-0.2, 0.25}, {0, 0}};
        const auto put = [](const Vec3& w, float* to) {
            for (int k = 0; k < 3; ++k) to[k] = static_cast<float>(w[k]);
        };
        for (std::size_t i = 0; i < 5; ++i) {
            put(at(kPlaces[i][0], kPlaces[i][1]) + noise * random.normal() * u.cross(v),
                &neighbours[3 * i]);
        }
        put(at(0.05, 0.05), p.data());
    }
    Candidate candidate(std::size_t index) const {
        static const std::array<float, 5> kNear{0.01F, 0.02F, 0.03F, 0.04F, 0.05F};
        Candidate c{};
        c.index = index;
        c.fresh = true;
        c.imu_range = c.lidar_range = 5.0;
        c.p_map = p.data();
        c.neighbours = neighbours.data();
        c.sq_distances = kNear.data();
        c.neighbour_step = 3;
        c.distance_step = 1;
        c.neighbour_count = 5;
        return c;
    }
};

/// A bare tunnel along x around the sensor, with `faces` walls across it.
struct Tunnel {
    Pose pose{exp_so3(Vec3(0.1, -0.2, 0.4)), Vec3(1.0, 0.3, -0.2)};
    Mat23x23 P = 1e-4 * Mat23x23::Identity();
    std::vector<Target> targets;
    std::size_t faces;

    explicit Tunnel(std::size_t faces_, unsigned seed = 1, double noise = kMapNoise,
                    double bend = 0.0, const Vec3& centre = Vec3::Zero())
        : faces(faces_) {
        pose.t += centre;
        P(0, 0) = 1e-2;  // long along the tunnel
        Random random(seed);
        for (std::size_t i = 0; i < faces; ++i) {
            targets.push_back({Vec3(6.0, random.uniform(-2, 2), random.uniform(-2, 2)),
                               Vec3::UnitY(), Vec3::UnitZ()});
        }
        while (targets.size() < 600) {
            const double angle = random.uniform(0.0, 6.283);
            const Vec3 inward(0.0, -std::cos(angle), -std::sin(angle));
            const Vec3 u = Vec3::UnitX().cross(inward);
            targets.push_back(
                {Vec3(random.uniform(-8, 8), 0.0, 0.0) - 3.0 * inward, u, inward.cross(u), bend});
        }
        for (Target& t : targets) {
            t.origin += centre;
            t.fill(random, noise);
        }
    }
    PoseView view() const { return {pose.R.data(), pose.t.data()}; }
    ScanInput input(bool at_rest = false) const {
        return {view(), view(), P.data(), 23, 0, 3, targets.size(), at_rest};
    }
};

/// The rows a host makes of what the adapter accepts, before and after conditioning.
struct Solved {
    RowMatrix before, after;
    Eigen::VectorXd residual, residual_after;
    std::vector<Vec3> points;  ///< map frame
    ScanDiagnostics told;

    bool touched() const { return before != after || residual != residual_after; }
};

/// One iteration of a scan. @param fresh after a search.
inline Solved iterate(Adapter& adapter, const Tunnel& t, bool fresh, int extrinsic = 6) {
    Solved s;
    std::vector<Correspondence> matches;
    for (std::size_t i = 0; i < t.targets.size(); ++i) {
        Correspondence m{};
        Candidate candidate = t.targets[i].candidate(i);
        candidate.fresh = fresh;
        if (adapter.accept(candidate, &m) != Verdict::kAccepted) continue;
        matches.push_back(m);
        s.points.push_back(Eigen::Map<const Eigen::Vector3f>(t.targets[i].p.data()).cast<double>());
    }
    const auto n = static_cast<Eigen::Index>(matches.size());
    s.before.resize(n, 12);
    s.residual.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const Vec3 normal = Eigen::Map<const Eigen::Vector3f>(matches[i].normal).cast<double>();
        const Vec3 c = t.pose.R.transpose() * normal;
        const Vec3 p_imu = t.pose.R.transpose() * (s.points[i] - t.pose.t);
        s.before.row(k) << normal.transpose(), p_imu.cross(c).transpose(),
            Vec3(1, 2, 3).transpose(), c.transpose();
        s.residual[k] = -static_cast<double>(matches[i].residual);
    }
    s.after = s.before;
    s.residual_after = s.residual;
    PriorBlock prior{};
    EXPECT_EQ(adapter.condition({s.after.data(), s.residual_after.data(), static_cast<int>(n), 12,
                                 1, 0, 3, extrinsic},
                                t.view(), kVariance, &prior),
              Status::kOk);
    EXPECT_EQ(prior.count, 0);
    return s;
}

/// A scan of one iteration.
inline Solved solve(Adapter& adapter, const Tunnel& t, bool at_rest = false, int extrinsic = 6) {
    EXPECT_EQ(adapter.begin_scan(t.input(at_rest)), Status::kOk);
    Solved s = iterate(adapter, t, true, extrinsic);
    EXPECT_EQ(adapter.end_scan(t.view(), true, nullptr, 0), Status::kOk);
    s.told = adapter.diagnostics();
    return s;
}

/// Scans that see nothing, so that nothing is learnt but the time.
inline void pass_scans(Adapter& adapter, int scans, bool at_rest = false) {
    Tunnel empty(0);
    for (int i = 0; i < scans; ++i) {
        adapter.begin_scan(empty.input(at_rest));
        adapter.end_scan(empty.view(), true, nullptr, 0);
    }
}

inline Adapter& noise_aware(Adapter& adapter, int scans = kSettling) {
    EXPECT_TRUE(adapter.set("degeneracy.method", "noise_aware"));
    EXPECT_TRUE(adapter.check());
    pass_scans(adapter, scans);
    return adapter;
}

}  // namespace d2lio::fastlio::test
