// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "d2lio/plugin/plugin.hpp"

/// Covariance of LIO-SAM's initial guess, for a patched upstream, whose mapping node has none at
/// hand. C++14, plain pointers only.
///
/// The guess is the last estimate moved by an increment of the IMU preintegration, so the increment
/// is what is uncertain. An error-state Kalman filter (Sola, Quaternion kinematics for the
/// error-state Kalman filter, 2017, section 5) tells how well velocity and biases are known: it is
/// driven by the IMU and corrected by the matched poses with the noise that upstream's own graph
/// gives them. A covariance does not depend on the measured poses, so none are estimated here.
namespace d2lio {
namespace liosam {

struct GuessNoise {
    double accel = 4e-3;       ///< m/s^2/sqrt(Hz), imuAccNoise
    double gyro = 1.6e-3;      ///< rad/s/sqrt(Hz), imuGyrNoise
    double accel_bias = 6e-5;  ///< m/s^3/sqrt(Hz), imuAccBiasN
    double gyro_bias = 4e-5;   ///< rad/s^2/sqrt(Hz), imuGyrBiasN
    double gravity = 9.80511;  ///< m/s^2, assumed where there are no samples
    double correction_rotation = 0.05, correction_translation = 0.1;  ///< of a matched pose, rad, m
    double degenerate_rotation = 1.0, degenerate_translation = 1.0;   ///< of a degenerate one
};

/// Stamps in s. All functions may be called from any thread. Memory is bounded.
class GuessCovariance {
  public:
    GuessCovariance();
    ~GuessCovariance();

    /// Forgets everything.
    void configure(const GuessNoise& noise);
    /// One sample, in the axes of the frame that is estimated: m/s^2, rad/s. One that is not
    /// finite, or not newer than the last, is ignored.
    void add_imu(double stamp, const double* accel, const double* gyro);
    /// The estimate of a scan: the next horizon begins here. A stamp that is not newer than the
    /// last one starts anew.
    void correct(double stamp, const PoseView& pose, bool degenerate);
    /// Of a guess for `stamp`, relative to the last estimate.
    /// @param covariance 6 x 6 column-major: rotation (right tangent, body), position (map axes),
    /// rad and m. @returns false, and leaves it alone, before the first estimate or for a stamp
    /// that is not newer.
    bool predict(double stamp, double* covariance) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace liosam
}  // namespace d2lio
