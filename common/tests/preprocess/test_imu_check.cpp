// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "d2lio/preprocess/imu_check.hpp"

namespace d2lio {
namespace {

constexpr double kGravity = 9.81;
constexpr std::size_t kSamples = 200;

// Standstill with sensor noise, upright; `scale` is the length of gravity in stored units.
std::vector<ImuSample> at_rest(double scale = kGravity) {
    std::mt19937 rng(3);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<ImuSample> samples(kSamples);
    for (std::size_t i = 0; i < kSamples; ++i) {
        samples[i].stamp = static_cast<Stamp>(i) * 5'000'000;
        for (int a = 0; a < 3; ++a) {
            samples[i].gyro[a] = 0.01 * noise(rng);
            samples[i].accel[a] = scale * ((a == 2 ? 1.0 : 0.0) + 0.005 * noise(rng));
        }
    }
    return samples;
}

TEST(ImuCheck, GoodStart) {
    const ImuCheck check = check_imu(at_rest());
    EXPECT_TRUE(check.ok()) << to_string(check);
    EXPECT_NEAR(check.mean_accel_norm, kGravity, 0.05);
    EXPECT_EQ(check.samples, ImuCheckOptions{}.samples);
}

TEST(ImuCheck, UnitG) {
    const ImuCheck check = check_imu(at_rest(1.0));
    EXPECT_EQ(check.status, ImuCheckStatus::kInG);
    EXPECT_NE(to_string(check).find("unit is g"), std::string::npos);
}

TEST(ImuCheck, NoGravityAndImplausibleScale) {
    EXPECT_EQ(check_imu(at_rest(0.01)).status, ImuCheckStatus::kNoGravity);
    EXPECT_EQ(check_imu(at_rest(5.0)).status, ImuCheckStatus::kImplausible);
    EXPECT_EQ(check_imu(at_rest(981.0)).status, ImuCheckStatus::kImplausible);
    EXPECT_NE(to_string(check_imu(at_rest(981.0))).find("9.81"), std::string::npos);
}

TEST(ImuCheck, ConstantReadings) {
    std::vector<ImuSample> samples(kSamples);
    for (ImuSample& sample : samples) sample.accel.z() = kGravity;
    EXPECT_EQ(check_imu(samples).status, ImuCheckStatus::kConstant);
    EXPECT_EQ(check_imu(std::vector<ImuSample>(kSamples)).status, ImuCheckStatus::kConstant);
}

TEST(ImuCheck, NotFinite) {
    std::vector<ImuSample> samples = at_rest();
    samples[50].gyro.y() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(check_imu(samples).status, ImuCheckStatus::kNotFinite);
}

TEST(ImuCheck, TooFewSamples) {
    EXPECT_EQ(check_imu({}).status, ImuCheckStatus::kTooFew);
    std::vector<ImuSample> samples = at_rest();
    samples.resize(ImuCheckOptions{}.samples - 1);
    EXPECT_EQ(check_imu(samples).status, ImuCheckStatus::kTooFew);
}

TEST(ImuCheck, SaturatedAxis) {
    constexpr double kGyroRange = 4.363323;  // 250 deg/s
    std::vector<ImuSample> samples = at_rest();
    for (std::size_t i = 30; i < 36; ++i) samples[i].gyro.x() = -kGyroRange;
    const ImuCheck check = check_imu(samples);
    EXPECT_EQ(check.status, ImuCheckStatus::kSaturated);
    EXPECT_EQ(check.saturated_value, -kGyroRange);
    EXPECT_EQ(check.saturated_run, 6U);
    samples = at_rest();
    for (std::size_t i = 60; i < 64; ++i) samples[i].accel.y() = 2.0 * kGravity;
    EXPECT_EQ(check_imu(samples).status, ImuCheckStatus::kSaturated);
}

TEST(ImuCheck, SinglePeaksAreNotSaturation) {
    std::vector<ImuSample> samples = at_rest();
    for (std::size_t i = 10; i < 90; i += 8) samples[i].gyro.x() = 4.5;
    const ImuCheck check = check_imu(samples);
    EXPECT_TRUE(check.ok());
    EXPECT_EQ(check.saturated_run, 1U);
}

TEST(ImuCheck, QuantisedReadingsAtRestAreNotSaturation) {
    std::vector<ImuSample> samples(kSamples);
    for (std::size_t i = 0; i < kSamples; ++i) {
        const double step = i / 8 % 2 == 0 ? 0.0 : 1.0;  // runs of eight at either value
        samples[i].gyro.x() = 0.01 * step;
        samples[i].accel.z() = 9.7 + 0.2 * step;
    }
    EXPECT_TRUE(check_imu(samples).ok()) << to_string(check_imu(samples));
}

}  // namespace
}  // namespace d2lio
