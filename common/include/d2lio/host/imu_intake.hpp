// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "d2lio/imu/propagation.hpp"
#include "d2lio/preprocess/deskew.hpp"
#include "d2lio/preprocess/synchronizer.hpp"

/// What every host does with inertial samples before its estimator sees them.
namespace d2lio {

/// Averages the first samples of a run and checks them.
class ImuStart {
  public:
    enum class Progress {
        kCollecting,
        kReady,
        kFault,  ///< readings that no start can be made from; collecting begins anew
    };

    explicit ImuStart(int samples) : needed_(samples) {}

    Progress add(const std::vector<ImuSample>& samples);
    const Vec3& mean_accel() const { return mean_accel_; }  ///< m/s^2 as measured
    const Vec3& mean_gyro() const { return mean_gyro_; }    ///< rad/s
    /// Largest standard deviation of an axis, rad/s and m/s^2: how still the sensor was.
    double gyro_spread() const { return gyro_spread_; }
    double accel_spread() const { return accel_spread_; }
    bool in_g() const { return in_g_; }  ///< readings look like g instead of m/s^2
    /// One line about the readings; empty if they look right.
    const std::string& note() const { return note_; }
    void reset();

  private:
    int needed_;
    Vec3 mean_accel_ = Vec3::Zero(), mean_gyro_ = Vec3::Zero();
    double gyro_spread_ = 0.0, accel_spread_ = 0.0;
    bool in_g_ = false;
    std::vector<ImuSample> seen_;
    std::string note_;
};

/// An inertial input held over `dt` seconds, ending `offset` seconds after the scan's begin.
struct ImuStep : ImuInput {
    double dt = 0.0;
    double offset = 0.0;
};

/// Cuts samples into steps from one scan's end to the next one's: the mean of two neighbouring
/// samples between them, the last input held to the scan's end (FAST-LIO2).
class ImuStepper {
  public:
    /// @param accel_scale multiplies the accelerations (to m/s^2).
    void start(const ImuSample& newest, double accel_scale);
    /// One step per sample used, and one more (of length >= 0) to the scan's end. Without an
    /// earlier scan the steps begin at the newest sample of start().
    const std::vector<ImuStep>& cut(const MeasureGroup& group);
    const std::vector<ImuStep>& steps() const { return steps_; }  ///< of the last cut()
    /// Mean period of the samples used so far, s; 0 before any.
    double mean_period() const { return intervals_ > 0 ? interval_sum_ / intervals_ : 0.0; }
    const ImuSample& newest() const { return last_; }
    void reset() { *this = ImuStepper{}; }

  private:
    double accel_scale_ = 1.0;
    ImuSample last_;
    double interval_sum_ = 0.0;  ///< s
    int intervals_ = 0;
    Stamp last_end_ = 0;
    bool has_last_end_ = false;
    std::vector<ImuStep> steps_;
};

/// The de-skewing knot at a state reached under input u.
MotionKnot motion_knot(double offset, const NavState& x, const ImuInput& u);

}  // namespace d2lio
