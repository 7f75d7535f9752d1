// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

#include "d2lio/geometry/so3.hpp"
#include "imu_graph.hpp"

namespace d2lio::liosam::test {

using Vec15 = Eigen::Matrix<double, 15, 1>;

/// What is true at one instant.
struct Truth {
    Pose pose;
    Vec3 vel = Vec3::Zero(), gyro_bias = Vec3::Zero(), accel_bias = Vec3::Zero();
};

/// A body that swings and turns, its IMU with exactly the noise the options state, and a scan
/// matcher with exactly the covariance it states.
class ImuSim {
  public:
    ImuSim(unsigned seed, const ImuGraphOptions& options) : options_(options), engine_(seed) {
        truth.pose.R = exp_so3(Vec3(0.2, -0.1, 1.2));
        truth.pose.t = Vec3(3.0, -2.0, 1.0);
        truth.vel = Vec3(1.0, 0.5, -0.2);
        truth.gyro_bias = normal3(options.prior_bias_sigma);
        truth.accel_bias = normal3(options.prior_bias_sigma);
    }

    /// Moves on by `n` steps of `dt` seconds and gives what the IMU reads.
    std::vector<ImuStep> advance(int n, double dt) {
        std::vector<ImuStep> steps;
        for (int i = 0; i < n; ++i) steps.push_back(step(dt));
        const double root = std::sqrt(n * dt);
        truth.gyro_bias += normal3(root * options_.gyro_bias_walk);
        truth.accel_bias += normal3(root * options_.accel_bias_walk);
        return steps;
    }

    /// The true pose with an error drawn from `covariance` (rotation body, position map).
    Pose measure(const Mat6& covariance) {
        const Mat6 L = covariance.llt().matrixL();
        const Vec6 e = L * Vec6::NullaryExpr([this] { return normal(); });
        return {truth.pose.R * exp_so3(e.head<3>()), truth.pose.t + e.tail<3>()};
    }

    /// Estimate [-] truth in the blocks of GraphIndex.
    Vec15 error(const GraphState& s) const {
        Vec15 e;
        e << log_so3(s.T_map_imu.R.transpose() * truth.pose.R), truth.pose.t - s.T_map_imu.t,
            truth.vel - s.vel, truth.gyro_bias - s.gyro_bias, truth.accel_bias - s.accel_bias;
        return e;
    }

    Vec3 gravity() const { return {0.0, 0.0, -options_.gravity}; }
    double normal() { return normal_(engine_); }
    Vec3 normal3(double sigma) {
        return sigma * Vec3::NullaryExpr([this] { return normal(); });
    }

    Truth truth;

  private:
    ImuStep step(double dt) {
        const double t = time_;
        const Vec3 omega(0.5 * std::sin(1.1 * t), 0.4 * std::cos(0.7 * t), 0.8);
        const Vec3 accel(1.5 * std::cos(0.9 * t), 1.2 * std::sin(1.3 * t), 0.6 * std::cos(0.5 * t));
        const Vec3 force = truth.pose.R.transpose() * (accel - gravity());
        ImuStep s;
        s.gyro = omega + truth.gyro_bias + normal3(options_.gyro_noise / std::sqrt(dt));
        s.accel = force + truth.accel_bias + normal3(options_.accel_noise / std::sqrt(dt));
        s.dt = dt;
        truth.pose.t += truth.vel * dt + 0.5 * accel * dt * dt +
                        normal3(options_.integration_noise * std::sqrt(dt));
        truth.vel += accel * dt;
        truth.pose.R = renormalise_so3(truth.pose.R * exp_so3(omega * dt));
        time_ += dt;
        return s;
    }

    ImuGraphOptions options_;
    std::mt19937 engine_;
    std::normal_distribution<double> normal_;
    double time_ = 0.0;
};

/// Covariance of a matcher that sees little along the map's x axis and about the body's z axis.
inline Mat6 matcher_covariance() {
    Vec6 sigma;
    sigma << 0.002, 0.003, 0.02, 0.2, 0.01, 0.02;
    Mat6 P = sigma.cwiseAbs2().asDiagonal();
    P(3, 5) = P(5, 3) = 0.3 * sigma[3] * sigma[5];
    P(2, 4) = P(4, 2) = 0.4 * sigma[2] * sigma[4];
    return P;
}

}  // namespace d2lio::liosam::test
