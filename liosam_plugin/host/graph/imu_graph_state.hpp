// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtsam/geometry/Pose3.h>
#include <gtsam/navigation/ImuBias.h>
#include <gtsam/nonlinear/ISAM2.h>
#include <gtsam/nonlinear/NonlinearFactor.h>

#include "imu_graph.hpp"

/// One state of the IMU graph in GTSAM's terms: pose, velocity, bias; error in the order of
/// GTSAM's tangents: rotation, translation (both body), velocity, accelerometer bias, gyro bias.
namespace d2lio::liosam {

/// A state and the joint covariance of its error.
struct GraphEstimate {
    gtsam::Pose3 pose;
    gtsam::Vector3 vel = gtsam::Vector3::Zero();
    gtsam::imuBias::ConstantBias bias;
    Mat15x15 covariance = Mat15x15::Identity();

    bool is_finite() const;
    /// In the project's frames and order.
    GraphState state() const;
};

/// Keys of the three variables of state `index`.
struct StateKeys {
    gtsam::Key pose, vel, bias;
    explicit StateKeys(std::size_t index);
};

/// Joint Gaussian prior on one state. Error: Log(T0^-1 T), v - v0, b - b0.
class StatePrior
    : public gtsam::NoiseModelFactorN<gtsam::Pose3, gtsam::Vector3, gtsam::imuBias::ConstantBias> {
  public:
    /// @throws std::invalid_argument if the covariance is not positive definite
    StatePrior(const StateKeys& keys, const GraphEstimate& mean);

    gtsam::Vector evaluateError(
        const gtsam::Pose3& pose, const gtsam::Vector3& vel,
        const gtsam::imuBias::ConstantBias& bias,
        boost::optional<gtsam::Matrix&> H_pose = boost::none,
        boost::optional<gtsam::Matrix&> H_vel = boost::none,
        boost::optional<gtsam::Matrix&> H_bias = boost::none) const override;
    gtsam::NonlinearFactor::shared_ptr clone() const override;

  private:
    GraphEstimate mean_;
};

/// A measured pose. Error: Log(R0^-1 R), t - t0 in map axes. Unlike the difference in the group of
/// poses, a rotation error does not lean a direction the matcher cannot see against one it can:
/// metres of residual along a tunnel would else turn into centimetres across.
class PoseMeasurement : public gtsam::NoiseModelFactorN<gtsam::Pose3> {
  public:
    /// @param covariance 6x6 of the error @throws std::invalid_argument if not positive definite
    PoseMeasurement(gtsam::Key key, const gtsam::Pose3& measured, const Mat6& covariance);

    gtsam::Vector evaluateError(const gtsam::Pose3& pose,
                                boost::optional<gtsam::Matrix&> H = boost::none) const override;
    gtsam::NonlinearFactor::shared_ptr clone() const override;

  private:
    gtsam::Pose3 measured_;
};

/// Solution and exact joint marginal of state `index`, which must have been eliminated last.
/// The marginal is read off the rows of the square-root information that only these variables
/// share: R^T R is their joint information.
/// @throws std::logic_error if it was not; anything GTSAM throws
GraphEstimate read_estimate(const gtsam::ISAM2& isam, std::size_t index);

}  // namespace d2lio::liosam
