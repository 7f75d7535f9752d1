// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "imu_processor.hpp"

#include <algorithm>

#include "d2lio/preprocess/imu_check.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kGravity = 9.81;         ///< m/s^2, scale of the accelerometer at rest
constexpr double kGravityLength = 9.809;  ///< m/s^2, length of the gravity state

/// FAST-LIO2's initial covariance.
Mat23x23 initial_covariance() {
    using I = StateIndex;
    Vec23 p = Vec23::Ones();
    p.segment<3>(I::kExtrinsicRot).setConstant(1e-5);
    p.segment<3>(I::kExtrinsicPos).setConstant(1e-5);
    p.segment<3>(I::kGyroBias).setConstant(1e-4);
    p.segment<3>(I::kAccelBias).setConstant(1e-3);
    p.segment<2>(I::kGravity).setConstant(1e-5);
    return p.asDiagonal();
}

/// Readings that no start can be made from. Anything else that looks wrong is told, but scaling to
/// 9.81 m/s^2 and averaging still work on it, as they do upstream.
bool hopeless(ImuCheckStatus status) {
    return status == ImuCheckStatus::kNotFinite || status == ImuCheckStatus::kNoGravity;
}

}  // namespace

ImuProcessor::ImuProcessor(const HostConfig& config)
    : init_samples_(config.init_samples),
      extrinsic_(config.extrinsic()),
      Q_(config.noise.matrix()),
      exact_(config.exact_jacobians) {}

void ImuProcessor::reset() {
    initialised_ = has_last_end_ = false;
    count_ = 0;
    seen_.clear();
    note_.clear();
}

bool ImuProcessor::initialise(const std::vector<ImuSample>& samples, NavState& x, Mat23x23& P) {
    for (const ImuSample& s : samples) {
        if (count_ == 0) mean_accel_ = mean_gyro_ = Vec3::Zero();
        ++count_;
        mean_accel_ += (s.accel - mean_accel_) / count_;
        mean_gyro_ += (s.gyro - mean_gyro_) / count_;
        seen_.push_back(s);
        last_ = s;
    }
    if (count_ < init_samples_) return true;
    ImuCheckOptions options;
    options.samples = seen_.size();
    const ImuCheck check = check_imu(seen_, options);
    const std::string note = check.ok() ? std::string() : to_string(check);
    if (hopeless(check.status)) reset();
    note_ = note;
    if (hopeless(check.status)) return false;
    x = NavState{};
    x.extrinsic_rot = extrinsic_.R;
    x.extrinsic_pos = extrinsic_.t;
    x.gyro_bias = mean_gyro_;
    x.gravity = -kGravityLength * mean_accel_.normalized();
    P = initial_covariance();
    accel_scale_ = kGravity / mean_accel_.norm();
    initialised_ = true;
    seen_.clear();
    return true;
}

ImuInput ImuProcessor::mean(const ImuSample& a, const ImuSample& b) const {
    return {0.5 * (a.gyro + b.gyro), 0.5 * accel_scale_ * (a.accel + b.accel)};
}

void ImuProcessor::add_knot(double offset, const NavState& x, const ImuInput& u) {
    MotionKnot k;
    k.offset = offset;
    k.rot = x.rot;
    k.pos = x.pos;
    k.vel = x.vel;
    k.gyro = u.gyro - x.gyro_bias;
    k.accel = x.rot * (u.accel - x.accel_bias) + x.gravity;
    knots_.push_back(k);
}

const std::vector<MotionKnot>& ImuProcessor::propagate(const MeasureGroup& group,
                                                       double noise_scale, NavState& x,
                                                       Mat23x23& P) {
    const Mat12 Q = noise_scale * Q_;
    ImuInput u = mean(last_, last_);
    knots_.clear();
    add_knot(0.0, x, u);
    for (const ImuSample& sample : group.imu) {
        const ImuSample head = last_;
        last_ = sample;
        if (has_last_end_ && sample.stamp < last_end_) continue;
        u = mean(head, sample);
        interval_sum_ += seconds_between(sample.stamp, head.stamp);
        ++intervals_;
        const bool straddles = has_last_end_ && head.stamp < last_end_;
        const double dt = seconds_between(sample.stamp, straddles ? last_end_ : head.stamp);
        d2lio::propagate(x, P, u, dt, Q, exact_);
        add_knot(seconds_between(sample.stamp, group.begin), x, u);
    }
    // Samples end at or before the scan does: hold the last input to its end.
    const Stamp from = has_last_end_ ? std::max(last_.stamp, last_end_) : last_.stamp;
    d2lio::propagate(x, P, u, seconds_between(group.end, from), Q, exact_);
    last_end_ = group.end;
    has_last_end_ = true;
    return knots_;
}

}  // namespace d2lio::fastlio
