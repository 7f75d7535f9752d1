// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/imu/hold.hpp"

#include <Eigen/Cholesky>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {
namespace {

using I = StateIndex;
using Vec9 = Eigen::Matrix<double, 9, 1>;
using Mat9 = Eigen::Matrix<double, 9, 9>;

/// Of a body at rest: m^2, rad^2, (m/s)^2.
constexpr double kRestPosition = 1e-6, kRestRotation = 1e-8, kRestVelocity = 1e-6;

}  // namespace

void hold_still(const Pose& rest, NavState& x, Mat23x23& P) {
    Eigen::Matrix<double, 9, 23> H = Eigen::Matrix<double, 9, 23>::Zero();
    H.block<3, 3>(0, I::kPos).setIdentity();
    H.block<3, 3>(3, I::kRot).setIdentity();
    H.block<3, 3>(6, I::kVel).setIdentity();
    Vec9 error, variance;
    error << rest.t - x.pos, log_so3(x.rot.transpose() * rest.R), -x.vel;
    variance << Vec3::Constant(kRestPosition), Vec3::Constant(kRestRotation),
        Vec3::Constant(kRestVelocity);
    const Mat9 R = variance.asDiagonal();
    const Eigen::LLT<Mat9> S(H * P * H.transpose() + R);
    if (S.info() != Eigen::Success) return;
    const Eigen::Matrix<double, 23, 9> K = S.solve(H * P).transpose();
    const NavState moved = state_plus(x, K * error);
    const Mat23x23 left = Mat23x23::Identity() - K * H;  // Joseph form: stays positive definite
    const Mat23x23 reduced = left * P * left.transpose() + K * R * K.transpose();
    if (!moved.is_finite() || !reduced.allFinite()) return;
    x = moved;
    P = 0.5 * (reduced + reduced.transpose());
}

void anchor_attitude(Mat23x23& P) {
    constexpr double kAnchored = 1e-6;  ///< rad^2
    P.middleRows<3>(I::kRot).setZero();
    P.middleCols<3>(I::kRot).setZero();
    P.diagonal().segment<3>(I::kRot).setConstant(kAnchored);
}

Mat23x23 start_covariance() {
    Vec23 p = Vec23::Ones();
    p.segment<3>(I::kExtrinsicRot).setConstant(1e-5);
    p.segment<3>(I::kExtrinsicPos).setConstant(1e-5);
    p.segment<3>(I::kGyroBias).setConstant(1e-4);
    p.segment<3>(I::kAccelBias).setConstant(1e-3);
    p.segment<2>(I::kGravity).setConstant(1e-5);
    return p.asDiagonal();
}

}  // namespace d2lio
