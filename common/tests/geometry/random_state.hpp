// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <random>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/geometry/state.hpp"

namespace d2lio::test {

/// Seeded source of random vectors and states.
class Random {
  public:
    explicit Random(unsigned seed) : engine_(seed) {}
    double uniform(double lo, double hi) {
        return std::uniform_real_distribution<double>(lo, hi)(engine_);
    }
    double normal() { return std::normal_distribution<double>()(engine_); }
    Eigen::VectorXd vector(Eigen::Index n, double scale) {
        Eigen::VectorXd v(n);
        for (Eigen::Index i = 0; i < n; ++i) v[i] = uniform(-scale, scale);
        return v;
    }
    Vec3 vec3(double scale) { return vector(3, scale); }
    Mat3 rotation() { return exp_so3(vec3(1.7)); }
    NavState state() {
        NavState x;
        x.pos = vec3(10.0);
        x.rot = rotation();
        x.extrinsic_rot = rotation();
        x.extrinsic_pos = vec3(0.5);
        x.vel = vec3(5.0);
        x.gyro_bias = vec3(0.02);
        x.accel_bias = vec3(0.2);
        x.gravity = 9.809 * vec3(1.0).normalized();
        return x;
    }
    Mat23x23 covariance() {
        const Mat23x23 A = Mat23x23::NullaryExpr([this] { return normal(); });
        return A * A.transpose() * 1e-3 + Mat23x23::Identity() * 1e-4;
    }

  private:
    std::mt19937 engine_;
};

}  // namespace d2lio::test
