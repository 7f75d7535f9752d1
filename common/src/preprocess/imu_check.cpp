// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/imu_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace d2lio {
namespace {

constexpr double kInGTolerance = 0.15;  // |mean accel| in g about 1

struct Saturation {
    double value = 0.0;
    std::size_t run = 0;
};

using Reading = double (*)(const ImuSample&, int axis);

double gyro_of(const ImuSample& sample, int axis) { return sample.gyro[axis]; }
double accel_of(const ImuSample& sample, int axis) { return sample.accel[axis]; }

// Longest run at the axis' extreme magnitude.
Saturation longest_extreme_run(const std::vector<ImuSample>& samples, std::size_t count,
                               Reading reading, int axis) {
    Saturation found;
    for (std::size_t i = 0; i < count; ++i) {
        const double value = reading(samples[i], axis);
        if (std::abs(value) > std::abs(found.value)) found.value = value;
    }
    std::size_t run = 0;
    for (std::size_t i = 0; i < count; ++i) {
        run = reading(samples[i], axis) == found.value ? run + 1 : 0;
        found.run = std::max(found.run, run);
    }
    return found;
}

Saturation worst_saturation(const std::vector<ImuSample>& samples, std::size_t count,
                            double min_gyro, double min_accel) {
    Saturation worst;
    for (int axis = 0; axis < 3; ++axis) {
        const Saturation gyro = longest_extreme_run(samples, count, gyro_of, axis);
        const Saturation accel = longest_extreme_run(samples, count, accel_of, axis);
        if (std::abs(gyro.value) >= min_gyro && gyro.run > worst.run) worst = gyro;
        if (std::abs(accel.value) >= min_accel && accel.run > worst.run) worst = accel;
    }
    return worst;
}

bool all_finite(const std::vector<ImuSample>& samples, std::size_t count) {
    return std::all_of(
        samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count),
        [](const ImuSample& s) { return s.gyro.allFinite() && s.accel.allFinite(); });
}

bool all_identical(const std::vector<ImuSample>& samples, std::size_t count) {
    return std::all_of(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count),
                       [&](const ImuSample& s) {
                           return s.gyro == samples[0].gyro && s.accel == samples[0].accel;
                       });
}

void fill_means(const std::vector<ImuSample>& samples, ImuCheck& check) {
    for (std::size_t i = 0; i < check.samples; ++i) {
        check.mean_accel_norm += samples[i].accel.norm();
        check.mean_gyro_norm += samples[i].gyro.norm();
    }
    check.mean_accel_norm /= static_cast<double>(check.samples);
    check.mean_gyro_norm /= static_cast<double>(check.samples);
}

ImuCheckStatus judge_gravity(double mean, const ImuCheckOptions& options) {
    if (mean < options.no_gravity_below) return ImuCheckStatus::kNoGravity;
    if (std::abs(mean - 1.0) < kInGTolerance) return ImuCheckStatus::kInG;
    const bool plausible = std::abs(mean - options.gravity) <= options.gravity_tolerance;
    return plausible ? ImuCheckStatus::kOk : ImuCheckStatus::kImplausible;
}

ImuCheckStatus judge_saturation(const std::vector<ImuSample>& samples,
                                const ImuCheckOptions& options, ImuCheck& check) {
    // Decided on the unit that the readings seem to have.
    const bool in_g = check.mean_accel_norm < 0.5 * options.gravity;
    const double min_accel = options.saturation_accel_g * (in_g ? 1.0 : options.gravity);
    const Saturation worst =
        worst_saturation(samples, check.samples, options.saturation_gyro, min_accel);
    check.saturated_value = worst.value;
    check.saturated_run = worst.run;
    const bool saturated = worst.run >= std::max<std::size_t>(options.saturation_run, 1);
    return saturated ? ImuCheckStatus::kSaturated : check.status;
}

std::string format(const char* pattern, double value, std::size_t count) {
    char text[256];
    std::snprintf(text, sizeof text, pattern, value, count);
    return text;
}

}  // namespace

ImuCheck check_imu(const std::vector<ImuSample>& samples, const ImuCheckOptions& options) {
    ImuCheck check;
    check.samples = std::min(samples.size(), options.samples);
    if (check.samples == 0 || check.samples < options.samples) return check;
    if (!all_finite(samples, check.samples)) {
        check.status = ImuCheckStatus::kNotFinite;
        return check;
    }
    fill_means(samples, check);
    if (check.samples > 1 && all_identical(samples, check.samples)) {
        check.status = ImuCheckStatus::kConstant;
        return check;
    }
    check.status = judge_gravity(check.mean_accel_norm, options);
    // Saturation may itself be what makes the mean implausible.
    if (check.status == ImuCheckStatus::kOk || check.status == ImuCheckStatus::kImplausible) {
        check.status = judge_saturation(samples, options, check);
    }
    return check;
}

std::string to_string(const ImuCheck& check) {
    switch (check.status) {
        case ImuCheckStatus::kOk:
            return format("IMU plausible: mean |accel| %.3f m/s^2 over %zu samples",
                          check.mean_accel_norm, check.samples);
        case ImuCheckStatus::kTooFew:
            return "IMU not checked: only " + std::to_string(check.samples) + " samples";
        case ImuCheckStatus::kNotFinite:
            return "IMU readings hold NaN or Inf";
        case ImuCheckStatus::kConstant:
            return "IMU readings are identical over " + std::to_string(check.samples) +
                   " samples: dead sensor, or simulated without noise";
        case ImuCheckStatus::kNoGravity:
            return format(
                "mean |accel| is %.3f m/s^2 over %zu samples, expected about 9.81: "
                "gravity was removed or the accelerometer is not connected",
                check.mean_accel_norm, check.samples);
        case ImuCheckStatus::kInG:
            return format(
                "mean |accel| is %.3f over %zu samples, expected about 9.81 m/s^2: "
                "the unit is g",
                check.mean_accel_norm, check.samples);
        case ImuCheckStatus::kImplausible:
            return format(
                "mean |accel| is %.3f m/s^2 over %zu samples, expected about 9.81: "
                "wrong unit or scale",
                check.mean_accel_norm, check.samples);
        case ImuCheckStatus::kSaturated:
            return format("an IMU axis sticks at %.4g for %zu samples in a row: saturated",
                          check.saturated_value, check.saturated_run);
    }
    return "?";
}

}  // namespace d2lio
