// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "imu_graph_interval.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio::liosam {
namespace {

// Preintegration keeps its rotation as a vector, whose differential is singular at a full turn.
constexpr double kMaxRotation = 5.0;  // rad

// s. GTSAM makes equalities of sigmas below 1e-8, which shorter intervals would come to.
constexpr double kMinDuration = 1e-4;

constexpr double kMaxDuration = 60.0;  // s, of a bridged interval: beyond, nothing is known anyway

boost::shared_ptr<gtsam::PreintegrationParams> make_params(const ImuGraphOptions& o, double accel,
                                                           double gyro) {
    auto p = gtsam::PreintegrationParams::MakeSharedU(o.gravity);
    p->accelerometerCovariance = gtsam::I_3x3 * (accel * accel);
    p->gyroscopeCovariance = gtsam::I_3x3 * (gyro * gyro);
    p->integrationCovariance = gtsam::I_3x3 * (o.integration_noise * o.integration_noise);
    return p;
}

bool has_duration(const ImuStep& step) { return std::isfinite(step.dt) && step.dt > 0.0; }

bool has_input(const ImuStep& step) { return step.gyro.allFinite() && step.accel.allFinite(); }

double duration_of(const std::vector<ImuStep>& steps) {
    double sum = 0.0;
    for (const ImuStep& step : steps) sum += has_duration(step) ? step.dt : 0.0;
    return std::min(sum, kMaxDuration);
}

bool is_usable(const gtsam::PreintegratedImuMeasurements& m) {
    return m.deltaTij() >= kMinDuration && m.preintegrated().allFinite() &&
           m.preintMeasCov().allFinite() && m.preintegrated_H_biasAcc().allFinite() &&
           m.preintegrated_H_biasOmega().allFinite() && m.theta().norm() < kMaxRotation;
}

}  // namespace

IntervalIntegrator::IntervalIntegrator(const ImuGraphOptions& options)
    : max_step_(options.max_step),
      params_(make_params(options, options.accel_noise, options.gyro_noise)),
      bridge_params_(make_params(options, options.bridge_accel_noise, options.bridge_gyro_noise)) {}

IntervalIntegrator::Interval IntervalIntegrator::integrate(const GraphEstimate& from,
                                                           const std::vector<ImuStep>& steps,
                                                           GraphCounts& counts) {
    const double duration = duration_of(steps);
    if (duration > 0.0) last_duration_ = std::max(duration, kMinDuration);
    if (auto m = measured(from, steps, counts)) return {*m, false};
    ++counts.bridged_intervals;
    return {bridge(from, last_duration_), true};
}

std::optional<gtsam::PreintegratedImuMeasurements> IntervalIntegrator::measured(
    const GraphEstimate& from, const std::vector<ImuStep>& steps, GraphCounts& counts) const {
    gtsam::PreintegratedImuMeasurements m(params_, from.bias);
    const ImuStep* input = nullptr;  // last usable one; before the first, the first
    for (auto s = steps.rbegin(); s != steps.rend(); ++s) {
        if (has_input(*s)) input = &*s;
    }
    if (input == nullptr) {
        counts.held_steps += steps.size();
        return std::nullopt;
    }
    bool usable = true;
    for (const ImuStep& step : steps) {
        if (has_input(step)) {
            input = &step;
        } else {
            ++counts.held_steps;
        }
        if (!has_duration(step)) {
            if (step.dt != 0.0) ++counts.skipped_steps;
            continue;
        }
        if (step.dt > max_step_) usable = false;
        if (usable) m.integrateMeasurement(input->accel, input->gyro, step.dt);
    }
    if (!usable || !is_usable(m)) return std::nullopt;
    return m;
}

gtsam::PreintegratedImuMeasurements IntervalIntegrator::bridge(const GraphEstimate& from,
                                                               double duration) const {
    gtsam::PreintegratedImuMeasurements m(bridge_params_, from.bias);
    // What a perfect sensor would read in unaccelerated flight without rotation.
    const gtsam::Vector3 accel =
        from.bias.accelerometer() - from.pose.rotation().unrotate(bridge_params_->n_gravity);
    m.integrateMeasurement(accel, from.bias.gyroscope(), duration);
    return m;
}

}  // namespace d2lio::liosam
