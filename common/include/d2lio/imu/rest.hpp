// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "d2lio/imu/propagation.hpp"

namespace d2lio {

/// Whether a body that began at rest still rests, judged from its inertial samples alone, and how
/// noisy they are meanwhile.
///
/// The means of the newest half second, and of every shorter stretch up to now, are compared with
/// those of everything before: 5.5 sigma of white noise on any of the six axes is motion, and so is
/// shaking beyond 0.015 g or 0.02 rad/s (standard deviations; an idling engine may pass, a drive on
/// a road or a hand does not). Smooth motion at constant speed from the first sample on cannot be
/// told from rest.
class RestDetector {
  public:
    /// One scan's samples, in order.
    void add(const std::vector<ImuSample>& samples);
    bool resting() const { return resting_; }
    /// Whether enough samples of rest have been seen for the noise to be known.
    bool knows_noise() const;
    /// Variance of a sample about the mean, axes averaged; (rad/s)^2 and (readings' unit)^2.
    double gyro_variance() const;
    double accel_variance() const;
    /// Noise to expect in motion, from that at rest: four times the variances (vibration, scale
    /// errors), and bias walks in proportion; not below a tactical-grade sensor's. Only where
    /// knows_noise().
    /// @param accel_scale readings to m/s^2.
    ProcessNoise noise(double accel_scale) const;
    void reset() { *this = RestDetector(); }

  private:
    using Vec6d = Eigen::Matrix<double, 6, 1>;  ///< gyro, accelerometer
    struct Block {
        double count = 0.0;
        Vec6d sum = Vec6d::Zero();
        Vec6d squares = Vec6d::Zero();  ///< about the block's own mean
    };
    static Block block_of(const std::vector<ImuSample>& samples);
    void merge(const Block& block);
    bool moves() const;
    bool shakes() const;
    double gravity_squared() const;
    double least_accel() const;  ///< variance

    bool resting_ = true;
    Block past_;
    double past_blocks_ = 0.0;
    std::deque<Block> recent_;
};

}  // namespace d2lio
