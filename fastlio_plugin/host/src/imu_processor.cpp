// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "imu_processor.hpp"

#include "d2lio/imu/hold.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kGravity = 9.81;         ///< m/s^2, scale of the accelerometer at rest
constexpr double kGravityLength = 9.809;  ///< m/s^2, length of the gravity state

}  // namespace

ImuProcessor::ImuProcessor(const HostConfig& config)
    : extrinsic_(config.intake.extrinsic()),
      configured_Q_(config.noise.matrix()),
      Q_(configured_Q_),
      exact_(config.exact_jacobians),
      start_(config.intake.init_samples) {}

void ImuProcessor::reset() {
    initialised_ = false;
    start_.reset();
    stepper_.reset();
    Q_ = configured_Q_;
}

bool ImuProcessor::initialise(const std::vector<ImuSample>& samples, NavState& x, Mat23x23& P) {
    const ImuStart::Progress progress = start_.add(samples);
    if (progress != ImuStart::Progress::kReady) return progress != ImuStart::Progress::kFault;
    x = NavState{};
    x.extrinsic_rot = extrinsic_.R;
    x.extrinsic_pos = extrinsic_.t;
    x.gyro_bias = start_.mean_gyro();
    x.gravity = -kGravityLength * start_.mean_accel().normalized();
    P = start_covariance();
    accel_scale_ = kGravity / start_.mean_accel().norm();
    stepper_.start(samples.back(), accel_scale_);
    initialised_ = true;
    return true;
}

const std::vector<MotionKnot>& ImuProcessor::propagate(const MeasureGroup& group,
                                                       double noise_scale, NavState& x,
                                                       Mat23x23& P) {
    const Mat12 Q = noise_scale * Q_;
    const std::vector<ImuStep>& steps = stepper_.cut(group);
    knots_.clear();
    knots_.push_back(motion_knot(0.0, x, ImuInput{}));
    for (std::size_t i = 0; i < steps.size(); ++i) {
        d2lio::propagate(x, P, steps[i], steps[i].dt, Q, exact_);
        // The last step has no sample at its end: points there extrapolate the one before.
        if (i + 1 < steps.size()) knots_.push_back(motion_knot(steps[i].offset, x, steps[i]));
    }
    return knots_;
}

Mat12 ImuProcessor::integrated_noise() const {
    double squares = 0.0;
    for (const ImuStep& s : steps()) squares += s.dt * s.dt;
    return squares * Q_;
}

}  // namespace d2lio::fastlio
