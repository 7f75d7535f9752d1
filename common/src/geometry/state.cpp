// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/geometry/state.hpp"

#include "d2lio/geometry/so3.hpp"
#include "d2lio/geometry/sphere.hpp"

namespace d2lio {

using I = StateIndex;

bool NavState::is_finite() const {
    return pos.allFinite() && rot.allFinite() && extrinsic_rot.allFinite() &&
           extrinsic_pos.allFinite() && vel.allFinite() && gyro_bias.allFinite() &&
           accel_bias.allFinite() && gravity.allFinite();
}

NavState state_plus(const NavState& x, const Vec23& d) {
    NavState y;
    y.pos = x.pos + d.segment<3>(I::kPos);
    y.rot = renormalise_so3(x.rot * exp_so3(d.segment<3>(I::kRot)));
    y.extrinsic_rot = renormalise_so3(x.extrinsic_rot * exp_so3(d.segment<3>(I::kExtrinsicRot)));
    y.extrinsic_pos = x.extrinsic_pos + d.segment<3>(I::kExtrinsicPos);
    y.vel = x.vel + d.segment<3>(I::kVel);
    y.gyro_bias = x.gyro_bias + d.segment<3>(I::kGyroBias);
    y.accel_bias = x.accel_bias + d.segment<3>(I::kAccelBias);
    y.gravity = sphere_plus(x.gravity, d.segment<2>(I::kGravity));
    return y;
}

Vec23 state_minus(const NavState& a, const NavState& b) {
    Vec23 d;
    d.segment<3>(I::kPos) = a.pos - b.pos;
    d.segment<3>(I::kRot) = log_so3(b.rot.transpose() * a.rot);
    d.segment<3>(I::kExtrinsicRot) = log_so3(b.extrinsic_rot.transpose() * a.extrinsic_rot);
    d.segment<3>(I::kExtrinsicPos) = a.extrinsic_pos - b.extrinsic_pos;
    d.segment<3>(I::kVel) = a.vel - b.vel;
    d.segment<3>(I::kGyroBias) = a.gyro_bias - b.gyro_bias;
    d.segment<3>(I::kAccelBias) = a.accel_bias - b.accel_bias;
    d.segment<2>(I::kGravity) = sphere_minus(a.gravity, b.gravity);
    return d;
}

Mat23x23 state_transport(const NavState& x, const Vec23& d, bool exact) {
    Mat23x23 J = Mat23x23::Identity();
    J.block<3, 3>(I::kRot, I::kRot) = right_jacobian_so3(d.segment<3>(I::kRot));
    J.block<3, 3>(I::kExtrinsicRot, I::kExtrinsicRot) =
        right_jacobian_so3(d.segment<3>(I::kExtrinsicRot));
    const Vec2 u = d.segment<2>(I::kGravity);
    J.block<2, 2>(I::kGravity, I::kGravity) = sphere_minus_jacobian(sphere_plus(x.gravity, u)) *
                                              sphere_plus_jacobian(x.gravity, u, exact);
    return J;
}

}  // namespace d2lio
