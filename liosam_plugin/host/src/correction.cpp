// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "correction.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

namespace d2lio::liosam {
namespace {

constexpr double kLostFactor = 100.0;  ///< on the degenerate sigmas
constexpr double kStartSigma = 1e-3;   ///< rad and m
constexpr double kSteepest = 1.4;      ///< rad of pitch up to which LIO-SAM blends

Mat6 diagonal(double rotation, double translation) {
    Mat6 C = Mat6::Zero();
    C.diagonal() << Vec3::Constant(rotation * rotation), Vec3::Constant(translation * translation);
    return C;
}

/// small^2 I + (large^2 - small^2) V V^T over the weak columns of v.
Mat3 widened(double small, double large, const Mat3& v, int weak) {
    Mat3 C = small * small * Mat3::Identity();
    for (int i = 0; i < weak; ++i) {
        C += (large * large - small * small) * v.col(i) * v.col(i).transpose();
    }
    return C;
}

}  // namespace

Mat6 upstream_correction(const CorrectionNoise& n, bool degenerate) {
    return degenerate ? diagonal(n.degenerate_rotation, n.degenerate_translation)
                      : diagonal(n.rotation, n.translation);
}

Mat6 weak_correction(const CorrectionNoise& n, const ScanDiagnostics& s) {
    Mat6 C = diagonal(n.rotation, n.translation);
    if (!s.v_r.allFinite() || !s.v_t.allFinite()) return C;
    C.topLeftCorner<3, 3>() = widened(n.rotation, n.degenerate_rotation, s.v_r, s.weak_r);
    C.bottomRightCorner<3, 3>() = widened(n.translation, n.degenerate_translation, s.v_t, s.weak_t);
    return C;
}

Mat6 lost_covariance(const CorrectionNoise& n) {
    return diagonal(kLostFactor * n.degenerate_rotation, kLostFactor * n.degenerate_translation);
}

Mat6 pose_covariance(const Mat6& P, const Mat6& AtA, double variance) {
    const Eigen::LLT<Mat6> prior(P);
    if (prior.info() != Eigen::Success) return P;
    const Mat6 information = prior.solve(Mat6::Identity()) + AtA / variance;
    const Eigen::LLT<Mat6> llt(0.5 * (information + information.transpose()));
    if (llt.info() != Eigen::Success) return P;
    const Mat6 C = llt.solve(Mat6::Identity());
    return C.allFinite() ? Mat6(0.5 * (C + C.transpose())) : P;
}

Mat6 start_covariance() { return diagonal(kStartSigma, kStartSigma); }

Mat6 turn_position(const Mat3& R, const Mat6& C) {
    Mat6 J = Mat6::Identity();
    J.bottomRightCorner<3, 3>() = R;
    return J * C * J.transpose();
}

Mat6 ros_order(const Pose& T, const Mat6& C) {
    Mat6 J = Mat6::Zero();
    J.topRightCorner<3, 3>().setIdentity();
    J.bottomLeftCorner<3, 3>() = T.R;
    return J * C * J.transpose();
}

/// The up direction in body axes fixes roll and pitch: it is turned part of the way.
Mat3 blend_tilt(const Mat3& R, const Mat3& world, double weight) {
    const double pitch = std::asin(std::min(1.0, std::max(-1.0, -world(2, 0))));
    if (!(weight > 0.0) || !world.allFinite() || !(std::abs(pitch) < kSteepest)) return R;
    const Vec3 up = R.row(2), wanted = world.row(2);
    const Eigen::Quaterniond whole = Eigen::Quaterniond::FromTwoVectors(wanted, up);
    const Mat3 part = Eigen::Quaterniond::Identity().slerp(weight, whole).toRotationMatrix();
    Mat3 out = R * part;
    // A turn of the up direction may turn the heading a little: give it back.
    const double yaw = std::atan2(R(1, 0), R(0, 0)) - std::atan2(out(1, 0), out(0, 0));
    return Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * out;
}

}  // namespace d2lio::liosam
