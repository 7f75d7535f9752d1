// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "d2lio/fastlio/config.hpp"
#include "d2lio/host/imu_intake.hpp"

namespace d2lio::fastlio {

/// Start-up and forward propagation, as FAST-LIO2's IMU processing.
class ImuProcessor {
  public:
    explicit ImuProcessor(const HostConfig& config);

    bool initialised() const { return initialised_; }
    /// Averages one group's samples; once there are enough, sets the state and covariance to start
    /// from. note() then says what looks wrong with the readings.
    /// @returns false when no start can be made from them; averaging begins anew.
    bool initialise(const std::vector<ImuSample>& samples, NavState& x, Mat23x23& P);
    /// Propagates to `end` and returns the knots for de-skewing, offsets relative to `begin`.
    /// @param noise_scale multiplies the process noise (IMU gaps), >= 1.
    const std::vector<MotionKnot>& propagate(const MeasureGroup& group, double noise_scale,
                                             NavState& x, Mat23x23& P);
    /// One line about the readings of the start-up; empty if they look right.
    const std::string& note() const { return start_.note(); }
    /// Mean period of the samples used so far, s; 0 before any.
    double mean_period() const { return stepper_.mean_period(); }
    /// Inputs of the last propagate().
    const std::vector<ImuStep>& steps() const { return stepper_.steps(); }
    /// Covariance of the readings that the last propagate() integrated, sum of dt^2 Q.
    Mat12 integrated_noise() const;
    double accel_scale() const { return accel_scale_; }  ///< readings to m/s^2
    /// Noise from here on instead of the configured one.
    void expect(const ProcessNoise& noise) { Q_ = noise.matrix(); }
    void reset();

  private:
    Pose extrinsic_;
    Mat12 configured_Q_, Q_;
    bool exact_;
    bool initialised_ = false;
    ImuStart start_;
    ImuStepper stepper_;
    std::vector<MotionKnot> knots_;
    double accel_scale_ = 1.0;
};

}  // namespace d2lio::fastlio
