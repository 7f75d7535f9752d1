// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/pose_uncertainty.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {
namespace {

using I = StateIndex;

/// Of a body at rest where the map begins: m^2, rad^2.
constexpr double kKnownPosition = 1e-6, kKnownRotation = 1e-8;
/// No scan is straighter than this: angles of the beams, and which points of a surface it sampled.
constexpr double kStraightness = 0.5e-3;  ///< rad
/// A direction that the scan sees to no better than this has the prediction's error, not the
/// scan's: m, rad.
constexpr double kSeenPosition = 0.02, kSeenRotation = 0.005;

Mat6 map_from_body(const Mat3& R) {
    Mat6 J = Mat6::Identity();
    J.bottomRightCorner<3, 3>() = R;
    return J;
}

/// S information S with S = (information + floor)^-1: its inverse where the scan sees well, nothing
/// where it does not.
Mat6 noise_of_scan(const Mat6& information) {
    Mat6 seen = information;
    seen.diagonal().head<3>().array() += 1.0 / (kSeenPosition * kSeenPosition);
    seen.diagonal().tail<3>().array() += 1.0 / (kSeenRotation * kSeenRotation);
    const Eigen::LLT<Mat6> llt(seen);
    if (llt.info() != Eigen::Success) return Mat6::Zero();
    const Mat6 S = llt.solve(Mat6::Identity());
    return S * information * S;
}

}  // namespace

template <typename Rows>
void PoseUncertainty::transform(const Rows& rows) {
    rows(C_);
    C_.transposeInPlace();
    rows(C_);
    C_ = 0.5 * (C_ + C_.transpose()).eval();
}

void PoseUncertainty::begin(const Mat23x23& P) {
    take(P);
    C_.topRows<6>().setZero();
    C_.leftCols<6>().setZero();
    C_.diagonal().segment<3>(I::kPos).setConstant(kKnownPosition);
    C_.diagonal().segment<3>(I::kRot).setConstant(kKnownRotation);
}

void PoseUncertainty::take(const Mat23x23& P) {
    clear();
    begun_ = true;
    C_.topLeftCorner<I::kSize, I::kSize>() = P;
}

/// One step over the whole interval: P does not change its shape within a tenth of a second. Of the
/// blocks of propagation_jacobian() only those that are not identity or zero.
void PoseUncertainty::predict(const NavState& from, const NavState& to,
                              const std::vector<ImuStep>& steps, const Mat12& noise) {
    ImuInput mean;
    double T = 0.0;
    for (const ImuStep& s : steps) {
        mean.gyro += s.dt * s.gyro;
        mean.accel += s.dt * s.accel;
        T += s.dt;
    }
    if (!(T > 0.0)) return;
    mean.gyro /= T;
    mean.accel /= T;
    const Mat23x23 F = propagation_jacobian(from, mean, T, true);
    const Mat3 turn = F.block<3, 3>(I::kRot, I::kRot), gyro = F.block<3, 3>(I::kRot, I::kGyroBias);
    const Mat3 tilt = F.block<3, 3>(I::kVel, I::kRot),
               accel = F.block<3, 3>(I::kVel, I::kAccelBias);
    const Eigen::Matrix<double, 3, 2> gravity = F.block<3, 2>(I::kVel, I::kGravity);
    const Mat3 lever = -hat(to.pos - from.pos);  // a turned map, farther along
    transform([&](Joint& C) {
        using Rows3 = Eigen::Matrix<double, 3, kSize>;
        const Rows3 faster = tilt * C.middleRows<3>(I::kRot) +
                             accel * C.middleRows<3>(I::kAccelBias) +
                             gravity * C.middleRows<2>(I::kGravity);
        C.middleRows<3>(I::kPos) += T * (C.middleRows<3>(I::kVel) + 0.5 * faster);
        C.middleRows<3>(I::kVel) += faster;
        const Rows3 turned = turn * C.middleRows<3>(I::kRot) + gyro * C.middleRows<3>(I::kGyroBias);
        C.middleRows<3>(I::kRot) = turned;
        C.middleRows<3>(kMap) += (lever * C.middleRows<3>(kMap + 3)).eval();
    });
    const Mat23x12 W = propagation_noise_jacobian(from, mean, T);
    C_.topLeftCorner<I::kSize, I::kSize>() += W * noise * W.transpose();
    if (!C_.allFinite()) clear();
}

void PoseUncertainty::update(const NavState& x, const Match& match) {
    const Mat6 J = map_from_body(x.rot);
    const double misfit = std::max(match.misfit, 1.0);
    scan_noise_ = map_noise_ * J * noise_of_scan(match.information / misfit) * J.transpose();
    scan_noise_.diagonal().tail<3>().array() += kStraightness * kStraightness;
    if (!matched_) C_.bottomRightCorner<6, 6>() += scan_noise_;  // of the map's first scan
    matched_ = true;
    // Without an extrinsic that is estimated the gain has six columns.
    const bool pose_only = match.gain.rightCols<6>().isZero(0.0);
    transform([&](Joint& C) {  // e -= K H (e - m)
        Eigen::Matrix<double, 6, kSize> apart = C.topRows<6>();
        apart -= J.transpose() * C.bottomRows<6>();
        const Eigen::Matrix<double, 6, kSize> extrinsic = C.middleRows<6>(6);
        C.topRows<I::kSize>() -= match.gain.leftCols<6>() * apart;
        if (!pose_only) C.topRows<I::kSize>() -= match.gain.rightCols<6>() * extrinsic;
    });
    C_.topLeftCorner<I::kSize, I::kSize>() += misfit * match.noise;
    if (!C_.allFinite()) clear();
}

void PoseUncertainty::grow(const NavState& x, double share) {
    const double a = std::min(std::max(share, 0.0), 1.0);
    const Mat6 J = map_from_body(x.rot);
    transform([&](Joint& C) {
        C.bottomRows<6>() = ((1.0 - a) * C.bottomRows<6>() + a * J * C.topRows<6>()).eval();
    });
    C_.bottomRightCorner<6, 6>() += a * scan_noise_;
}

Mat6 PoseUncertainty::covariance(const NavState& x) const {
    const Mat6 J = map_from_body(x.rot);
    return J * C_.topLeftCorner<6, 6>() * J.transpose();
}

}  // namespace d2lio
