// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "d2lio/config/params.hpp"
#include "d2lio/preprocess/point_times.hpp"

namespace d2lio {
namespace {

constexpr Stamp kHeader = 1'700'000'000'123'456'789;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kPoints = 1000;
constexpr std::int32_t kFloat32Ns = 10;  // float32 resolves 7.5 ns at 0.1 s

PointTimes resolve(const std::vector<double>& raw, const PointTimeHint& hint = {},
                   Stamp header = kHeader) {
    return resolve_point_times(raw.data(), raw.size(), header, hint);
}

PointTimes resolve(const std::vector<std::int64_t>& raw, const PointTimeHint& hint = {},
                   Stamp header = kHeader) {
    return resolve_point_times(raw.data(), raw.size(), header, hint);
}

// Evenly spaced over [first, last].
std::vector<double> ramp(double first, double last, std::size_t count = kPoints) {
    std::vector<double> raw(count);
    for (std::size_t i = 0; i < count; ++i) {
        raw[i] = first + (last - first) * static_cast<double>(i) / static_cast<double>(count - 1);
    }
    return raw;
}

struct UnitCase {
    TimeUnit unit;
    double per_second;
};

class EveryUnit : public testing::TestWithParam<UnitCase> {};

TEST_P(EveryUnit, IsFoundFromTheSpan) {
    for (const double period : {0.02, 0.05, 0.1, 0.2}) {
        PointTimeHint hint;
        hint.period_s = period;
        const PointTimes times = resolve(ramp(0.0, 0.98 * period * GetParam().per_second), hint);
        ASSERT_TRUE(times.ok()) << to_string(times);
        EXPECT_EQ(times.unit, GetParam().unit);
        EXPECT_EQ(times.reference, TimeReference::kStart);
        EXPECT_EQ(times.scan_stamp, kHeader);
        EXPECT_NEAR(times.dt_ns.back(), 0.98e9 * period, 1.0);
        EXPECT_FALSE(times.unsorted);
    }
}

TEST_P(EveryUnit, AWrongGivenUnitIsRefused) {
    for (const TimeUnit wrong : {TimeUnit::kSeconds, TimeUnit::kMilliseconds,
                                 TimeUnit::kMicroseconds, TimeUnit::kNanoseconds}) {
        PointTimeHint hint;
        hint.unit = wrong;
        const PointTimes times = resolve(ramp(0.0, 0.1 * GetParam().per_second), hint);
        EXPECT_EQ(times.ok(), wrong == GetParam().unit);
        if (!times.ok()) {
            EXPECT_EQ(times.status, PointTimeStatus::kInconsistentSpan);
            EXPECT_NE(to_string(times).find("set the unit"), std::string::npos);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(PointTimes, EveryUnit,
                         testing::Values(UnitCase{TimeUnit::kSeconds, 1.0},
                                         UnitCase{TimeUnit::kMilliseconds, 1e3},
                                         UnitCase{TimeUnit::kMicroseconds, 1e6},
                                         UnitCase{TimeUnit::kNanoseconds, 1e9}));

TEST(PointTimes, Float32SecondsKeepTheirPrecision) {
    std::vector<double> raw = ramp(0.0, 0.1);
    for (double& value : raw) value = static_cast<double>(static_cast<float>(value));
    const PointTimes times = resolve(raw);
    ASSERT_TRUE(times.ok());
    for (std::size_t i = 0; i < kPoints; ++i) {
        const double exact = 1e8 * static_cast<double>(i) / (kPoints - 1);
        ASSERT_NEAR(times.dt_ns[i], exact, kFloat32Ns);
    }
}

TEST(PointTimes, NegativeTimesCountBackFromAStampAtTheScanEnd) {
    const PointTimes times = resolve(ramp(-0.101, 0.0013));  // VLP-16 driver
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.unit, TimeUnit::kSeconds);
    EXPECT_EQ(times.reference, TimeReference::kEnd);
    EXPECT_EQ(times.scan_stamp, kHeader - 101'000'000);
    EXPECT_EQ(times.dt_ns.front(), 0);
    EXPECT_NEAR(times.dt_ns.back(), 102'300'000, 1.0);
}

TEST(PointTimes, TimesThatCountUpToAStampAtTheScanEndNeedTheHint) {
    PointTimeHint hint;
    hint.reference = TimeReference::kEnd;
    const PointTimes times = resolve(ramp(0.0, 0.1), hint);
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.scan_stamp, kHeader - 100'000'000);
}

TEST(PointTimes, NegativeTimesContradictAStampAtTheScanStart) {
    PointTimeHint hint;
    hint.reference = TimeReference::kStart;
    const PointTimes times = resolve(ramp(-0.1, 0.0), hint);
    EXPECT_EQ(times.status, PointTimeStatus::kInconsistentReference);
    EXPECT_TRUE(times.dt_ns.empty());
    EXPECT_EQ(times.scan_stamp, kHeader);
}

TEST(PointTimes, AbsoluteNanosecondsStayExact) {
    std::vector<std::int64_t> raw(kPoints);
    for (std::size_t i = 0; i < kPoints; ++i) {
        raw[i] = kHeader + 7 + 99'999 * static_cast<std::int64_t>(i);
    }
    const PointTimes times = resolve(raw);
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.unit, TimeUnit::kNanoseconds);
    EXPECT_EQ(times.reference, TimeReference::kAbsolute);
    EXPECT_EQ(times.scan_stamp, kHeader + 7);
    for (std::size_t i = 0; i < kPoints; ++i) {
        ASSERT_EQ(times.dt_ns[i], 99'999 * static_cast<std::int32_t>(i));
    }
}

TEST(PointTimes, AbsoluteFloat64SecondsAndNanoseconds) {
    constexpr double kSecondsResolution = 500.0;      // ns, float64 at 1.7e9 s
    constexpr double kNanosecondsResolution = 512.0;  // ns, float64 at 1.7e18
    const double start = 1'700'000'000.25;
    const PointTimes seconds = resolve(ramp(start, start + 0.1));
    ASSERT_TRUE(seconds.ok()) << to_string(seconds);
    EXPECT_EQ(seconds.unit, TimeUnit::kSeconds);
    EXPECT_EQ(seconds.scan_stamp, 1'700'000'000'250'000'000);
    EXPECT_NEAR(seconds.dt_ns.back(), 1e8, kSecondsResolution);
    const PointTimes nanoseconds = resolve(ramp(start * 1e9, start * 1e9 + 1e8));
    ASSERT_TRUE(nanoseconds.ok());
    EXPECT_EQ(nanoseconds.unit, TimeUnit::kNanoseconds);
    EXPECT_EQ(nanoseconds.reference, TimeReference::kAbsolute);
    EXPECT_NEAR(nanoseconds.dt_ns.back(), 1e8, kNanosecondsResolution);
}

TEST(PointTimes, AbsoluteTimesOfAnotherClockAreNamedUnlessAskedFor) {
    const std::vector<double> uptime = ramp(1622.4, 1622.5);
    const PointTimes times = resolve(uptime);
    EXPECT_EQ(times.status, PointTimeStatus::kClockMismatch);
    EXPECT_NE(to_string(times).find("1622.4"), std::string::npos);
    PointTimeHint hint;
    hint.reference = TimeReference::kAbsolute;
    EXPECT_TRUE(resolve(uptime, hint).ok());
    EXPECT_EQ(resolve(uptime, hint).scan_stamp, 1'622'400'000'000);
    EXPECT_TRUE(resolve(uptime, {}, 0).ok());  // no header stamp to contradict
}

TEST(PointTimes, UnsortedTimesKeepTheOrderOfPoints) {
    std::vector<double> raw = ramp(0.001, 0.1);
    std::shuffle(raw.begin(), raw.end(), std::mt19937(7));
    const PointTimes times = resolve(raw);
    ASSERT_TRUE(times.ok());
    EXPECT_TRUE(times.unsorted);
    EXPECT_EQ(times.scan_stamp, kHeader + 1'000'000);
    for (std::size_t i = 0; i < kPoints; ++i) {
        ASSERT_NEAR(times.dt_ns[i], (raw[i] - 0.001) * 1e9, 1.0);
    }
}

TEST(PointTimes, AbsentTimes) {
    const double* none = nullptr;
    EXPECT_EQ(resolve_point_times(none, kPoints, kHeader, {}).status, PointTimeStatus::kAbsent);
    PointTimeHint hint;
    hint.pseudo_allowed = true;
    const PointTimes times = resolve_point_times(none, kPoints, kHeader, hint);
    EXPECT_FALSE(times.ok());
    EXPECT_TRUE(times.use_pseudo);
    EXPECT_FALSE(resolve(ramp(0.0, 0.1), hint).use_pseudo);
}

TEST(PointTimes, AllEqualTimesAreAcceptedOnlyWhenDeclaredSynchronised) {
    const std::vector<double> raw(kPoints, 0.0);
    const PointTimes refused = resolve(raw);
    EXPECT_EQ(refused.status, PointTimeStatus::kAllEqual);
    EXPECT_NE(to_string(refused).find("synchronised"), std::string::npos);
    PointTimeHint hint;
    hint.synchronised = true;
    const PointTimes times = resolve(raw, hint);
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.scan_stamp, kHeader);
    EXPECT_EQ(times.dt_ns, std::vector<std::int32_t>(kPoints, 0));
}

TEST(PointTimes, NonFiniteTimesMarkTheirPointsOnly) {
    std::vector<double> raw = ramp(0.0, 0.1);
    raw[10] = kNaN;
    raw[20] = std::numeric_limits<double>::infinity();
    const PointTimes times = resolve(raw);
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.invalid, 2U);
    EXPECT_EQ(times.dt_ns[10], kNoPointTime);
    EXPECT_EQ(times.dt_ns[20], kNoPointTime);
    EXPECT_GT(times.dt_ns[11], 0);
    EXPECT_EQ(resolve(std::vector<double>(kPoints, kNaN)).status, PointTimeStatus::kNotFinite);
}

TEST(PointTimes, ZerosAmongAbsoluteTimesAreGaps) {
    std::vector<std::int64_t> raw(kPoints, 0);
    for (std::size_t i = 100; i < kPoints; ++i) {
        raw[i] = kHeader + 100'000 * static_cast<std::int64_t>(i);
    }
    const PointTimes times = resolve(raw);
    ASSERT_TRUE(times.ok()) << to_string(times);
    EXPECT_EQ(times.invalid, 100U);
    EXPECT_EQ(times.scan_stamp, kHeader + 10'000'000);
}

TEST(PointTimes, TinyScansNeedALockedConvention) {
    EXPECT_EQ(resolve(std::vector<double>{}).status, PointTimeStatus::kEmpty);
    const std::vector<double> tiny = ramp(-0.03, -0.0299, 3);
    EXPECT_EQ(resolve(tiny).status, PointTimeStatus::kTooFew);
    const PointTimeHint hint = locked({}, resolve(ramp(-0.1, 0.0)));
    EXPECT_EQ(hint.unit, TimeUnit::kSeconds);
    EXPECT_EQ(hint.reference, TimeReference::kEnd);
    const PointTimes times = resolve(tiny, hint);
    ASSERT_TRUE(times.ok()) << to_string(times);
    EXPECT_EQ(times.scan_stamp, kHeader - 30'000'000);
    EXPECT_TRUE(resolve(std::vector<double>{-0.02}, hint).ok());
}

TEST(PointTimes, AnUnusableScanLocksNothing) {
    const PointTimeHint hint = locked({}, resolve(std::vector<double>(kPoints, 1.0)));
    EXPECT_EQ(hint.unit, TimeUnit::kAuto);
}

TEST(PointTimes, ExtremeIntegersAreRefusedWithoutOverflow) {
    std::vector<std::int64_t> raw(kPoints, 5);
    raw[0] = std::numeric_limits<std::int64_t>::min();
    raw[1] = std::numeric_limits<std::int64_t>::max();
    EXPECT_EQ(resolve(raw).status, PointTimeStatus::kInconsistentSpan);
    std::vector<std::int64_t> far(kPoints);
    for (std::size_t i = 0; i < kPoints; ++i) {
        far[i] = std::numeric_limits<std::int64_t>::max() - 100 * static_cast<std::int64_t>(i);
    }
    PointTimeHint hint;
    hint.reference = TimeReference::kAbsolute;
    EXPECT_EQ(resolve(far, hint).status, PointTimeStatus::kInconsistentReference);
}

TEST(PointTimes, OffsetsThatDoNotFit32BitsAreRefused) {
    PointTimeHint hint;
    hint.period_s = 2.0;
    EXPECT_TRUE(resolve(ramp(0.0, 2.0), hint).ok());
    EXPECT_EQ(resolve(ramp(0.0, 2.2), hint).status, PointTimeStatus::kInconsistentSpan);
}

// Extremes of the column times of real OS1-64 and OS0-128 sweeps, sensor clock since power-up.
TEST(PointTimes, OusterSensorClock) {
    std::vector<std::int64_t> raw(kPoints);
    for (std::size_t i = 0; i < kPoints; ++i) {
        raw[i] = 278'211'490'950 + 99'863'760 * static_cast<std::int64_t>(i) / 999;
    }
    EXPECT_EQ(resolve(raw).status, PointTimeStatus::kClockMismatch);
    const PointTimes times = resolve(raw, {}, 278'211'000'000);
    ASSERT_TRUE(times.ok());
    EXPECT_EQ(times.unit, TimeUnit::kNanoseconds);
    EXPECT_EQ(times.scan_stamp, 278'211'490'950);
    EXPECT_EQ(times.dt_ns.back(), 99'863'760);
}

TEST(PointTimes, AnImpossiblePeriodIsRefusedAtStart) {
    for (const double period : {0.0, -0.1, 2.5, kNaN}) {
        PointTimeHint hint;
        hint.period_s = period;
        EXPECT_THROW(validate(hint), ConfigError);
    }
    EXPECT_NO_THROW(validate(PointTimeHint{}));
}

}  // namespace
}  // namespace d2lio
