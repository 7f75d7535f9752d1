// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/imu_intake.hpp"

#include <algorithm>
#include <cmath>

#include "d2lio/preprocess/imu_check.hpp"

namespace d2lio {
namespace {

/// Anything else that looks wrong is told, but averaging still works on it, as it does upstream.
bool hopeless(ImuCheckStatus status) {
    return status == ImuCheckStatus::kNotFinite || status == ImuCheckStatus::kNoGravity;
}

double spread(const std::vector<ImuSample>& samples, const Vec3& mean, Vec3 ImuSample::*field) {
    Vec3 sum = Vec3::Zero();
    for (const ImuSample& s : samples) sum += (s.*field - mean).cwiseAbs2();
    return std::sqrt(sum.maxCoeff() / static_cast<double>(samples.size()));
}

}  // namespace

ImuStart::Progress ImuStart::add(const std::vector<ImuSample>& samples) {
    for (const ImuSample& s : samples) {
        if (seen_.empty()) mean_accel_ = mean_gyro_ = Vec3::Zero();
        seen_.push_back(s);
        const auto n = static_cast<double>(seen_.size());
        mean_accel_ += (s.accel - mean_accel_) / n;
        mean_gyro_ += (s.gyro - mean_gyro_) / n;
    }
    if (seen_.empty() || static_cast<int>(seen_.size()) < needed_) return Progress::kCollecting;
    ImuCheckOptions options;
    options.samples = seen_.size();
    const ImuCheck check = check_imu(seen_, options);
    note_ = check.ok() ? std::string() : to_string(check);
    in_g_ = check.status == ImuCheckStatus::kInG;
    gyro_spread_ = spread(seen_, mean_gyro_, &ImuSample::gyro);
    accel_spread_ = spread(seen_, mean_accel_, &ImuSample::accel);
    seen_.clear();
    return hopeless(check.status) ? Progress::kFault : Progress::kReady;
}

void ImuStart::reset() { *this = ImuStart(needed_); }

void ImuStepper::start(const ImuSample& newest, double accel_scale) {
    reset();
    last_ = newest;
    accel_scale_ = accel_scale;
}

const std::vector<ImuStep>& ImuStepper::cut(const MeasureGroup& group) {
    const auto mean = [this](const ImuSample& a, const ImuSample& b) -> ImuInput {
        return {0.5 * (a.gyro + b.gyro), 0.5 * accel_scale_ * (a.accel + b.accel)};
    };
    ImuInput u = mean(last_, last_);
    steps_.clear();
    for (const ImuSample& sample : group.imu) {
        const ImuSample head = last_;
        last_ = sample;
        if (has_last_end_ && sample.stamp < last_end_) continue;
        u = mean(head, sample);
        interval_sum_ += seconds_between(sample.stamp, head.stamp);
        ++intervals_;
        const bool straddles = has_last_end_ && head.stamp < last_end_;
        const double dt = seconds_between(sample.stamp, straddles ? last_end_ : head.stamp);
        steps_.push_back({u, dt, seconds_between(sample.stamp, group.begin)});
    }
    // Samples end at or before the scan does: hold the last input to its end.
    const Stamp from = has_last_end_ ? std::max(last_.stamp, last_end_) : last_.stamp;
    steps_.push_back(
        {u, seconds_between(group.end, from), seconds_between(group.end, group.begin)});
    last_end_ = group.end;
    has_last_end_ = true;
    return steps_;
}

MotionKnot motion_knot(double offset, const NavState& x, const ImuInput& u) {
    MotionKnot k;
    k.offset = offset;
    k.rot = x.rot;
    k.pos = x.pos;
    k.vel = x.vel;
    k.gyro = u.gyro - x.gyro_bias;
    k.accel = x.rot * (u.accel - x.accel_bias) + x.gravity;
    return k;
}

}  // namespace d2lio
