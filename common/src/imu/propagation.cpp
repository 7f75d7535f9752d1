// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/imu/propagation.hpp"

#include "d2lio/geometry/so3.hpp"
#include "d2lio/geometry/sphere.hpp"

namespace d2lio {

using I = StateIndex;

Mat12 ProcessNoise::matrix() const {
    Eigen::Matrix<double, 12, 1> q;
    q << Vec3::Constant(gyro), Vec3::Constant(accel), Vec3::Constant(gyro_bias),
        Vec3::Constant(accel_bias);
    return q.asDiagonal();
}

NavState propagate_state(const NavState& x, const ImuInput& u, double dt) {
    NavState y = x;
    y.pos += x.vel * dt;
    y.rot = renormalise_so3(x.rot * exp_so3((u.gyro - x.gyro_bias) * dt));
    y.vel += (x.rot * (u.accel - x.accel_bias) + x.gravity) * dt;
    return y;
}

Mat23x23 propagation_jacobian(const NavState& x, const ImuInput& u, double dt, bool exact) {
    const Vec3 phi = (u.gyro - x.gyro_bias) * dt;
    Mat23x23 F = Mat23x23::Identity();
    F.block<3, 3>(I::kPos, I::kVel) = Mat3::Identity() * dt;
    if (exact) F.block<3, 3>(I::kRot, I::kRot) = exp_so3(-phi);
    F.block<3, 3>(I::kRot, I::kGyroBias) = -right_jacobian_so3(phi) * dt;
    F.block<3, 3>(I::kVel, I::kRot) = -x.rot * hat(u.accel - x.accel_bias) * dt;
    F.block<3, 3>(I::kVel, I::kAccelBias) = -x.rot * dt;
    F.block<3, 2>(I::kVel, I::kGravity) = sphere_plus_jacobian(x.gravity, Vec2::Zero()) * dt;
    return F;
}

Mat23x12 propagation_noise_jacobian(const NavState& x, const ImuInput& u, double dt) {
    Mat23x12 W = Mat23x12::Zero();
    W.block<3, 3>(I::kRot, 0) = -right_jacobian_so3((u.gyro - x.gyro_bias) * dt);
    W.block<3, 3>(I::kVel, 3) = -x.rot;
    W.block<3, 3>(I::kGyroBias, 6) = Mat3::Identity();
    W.block<3, 3>(I::kAccelBias, 9) = Mat3::Identity();
    return W;
}

void propagate(NavState& x, Mat23x23& P, const ImuInput& u, double dt, const Mat12& Q, bool exact) {
    const Mat23x23 F = propagation_jacobian(x, u, dt, exact);
    const Mat23x12 W = propagation_noise_jacobian(x, u, dt) * dt;
    const Mat23x23 next = F * P * F.transpose() + W * Q * W.transpose();
    P = 0.5 * (next + next.transpose());
    x = propagate_state(x, u, dt);
}

}  // namespace d2lio
