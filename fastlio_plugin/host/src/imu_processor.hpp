// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "d2lio/fastlio/config.hpp"
#include "d2lio/preprocess/deskew.hpp"

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
    const std::string& note() const { return note_; }
    /// Mean period of the samples used so far, s; 0 before any.
    double mean_period() const { return intervals_ > 0 ? interval_sum_ / intervals_ : 0.0; }
    void reset();

  private:
    /// Mean of two samples, scaled to 9.81 m/s^2 at rest.
    ImuInput mean(const ImuSample& a, const ImuSample& b) const;
    void add_knot(double offset, const NavState& x, const ImuInput& u);

    int init_samples_;
    Pose extrinsic_;
    Mat12 Q_;
    bool exact_;

    bool initialised_ = false;
    std::string note_;
    int count_ = 0;
    Vec3 mean_accel_ = Vec3::Zero(), mean_gyro_ = Vec3::Zero();
    std::vector<ImuSample> seen_;  ///< samples of the start-up, for the check
    double accel_scale_ = 1.0;
    ImuSample last_;
    double interval_sum_ = 0.0;  ///< s
    int intervals_ = 0;
    Stamp last_end_ = 0;
    bool has_last_end_ = false;
    std::vector<MotionKnot> knots_;
};

}  // namespace d2lio::fastlio
