// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtsam/geometry/Pose3.h>
#include <gtsam/linear/NoiseModel.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <stdexcept>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/types.hpp"

/// Between the project's poses and covariances and GTSAM's. GTSAM perturbs a pose on the right by
/// (rotation, translation), both in body axes; the project's position errors are in map axes.
namespace d2lio::liosam {

/// Positions beyond this (m) are taken as garbage: their squares spoil every double beside them.
constexpr double kMaxCoordinate = 1e7;

/// Whether `pose` is finite, within kMaxCoordinate and a rotation to 1e-3.
inline bool is_rigid(const Pose& pose) {
    if (!pose.R.allFinite() || !pose.t.allFinite()) return false;
    const double skew = (pose.R.transpose() * pose.R - Mat3::Identity()).cwiseAbs().maxCoeff();
    return skew < 1e-3 && pose.R.determinant() > 0.0 &&
           pose.t.cwiseAbs().maxCoeff() < kMaxCoordinate;
}

inline gtsam::Pose3 to_gtsam(const Pose& pose) {
    return {gtsam::Rot3(renormalise_so3(pose.R)), pose.t};
}

inline Pose from_gtsam(const gtsam::Pose3& pose) {
    return {renormalise_so3(pose.rotation().matrix()), pose.translation()};
}

/// d(rotation body, position map)/d(GTSAM's tangent at a pose with rotation `R`), 6x6.
inline gtsam::Matrix6 map_axes(const Mat3& R) {
    gtsam::Matrix6 J = gtsam::Matrix6::Identity();
    J.bottomRightCorner<3, 3>() = R;
    return J;
}

/// Noise model of a joint covariance. It is scaled by its standard deviations first: they span ten
/// decades (velocity 1e4 m/s, bias 1e-6), and the Cholesky factor of the correlations does not
/// mind. GTSAM's own conversion inverts as it is, and its "smart" one, which looks for entries
/// above 1e-9 over the diagonal only, takes small correlations for none.
/// @throws std::invalid_argument if the covariance is not positive definite
inline gtsam::SharedNoiseModel joint_noise(const Eigen::MatrixXd& covariance) {
    const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd> llt(correlation);
    const gtsam::Matrix W = llt.matrixL().solve(Eigen::MatrixXd(scale.asDiagonal()));
    if (llt.info() != Eigen::Success || !W.allFinite()) {
        throw std::invalid_argument("covariance is not positive definite");
    }
    return gtsam::noiseModel::Gaussian::SqrtInformation(W, false);
}

}  // namespace d2lio::liosam
