// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "../geometry/random_state.hpp"
#include "d2lio/imu/rest.hpp"

namespace d2lio {
namespace {

constexpr int kSamples = 20;          // of a scan: 200 Hz, 10 scans a second
constexpr double kPeriod = 0.005;     // s
constexpr double kGyroNoise = 2e-3;   // rad/s, standard deviation of a sample
constexpr double kAccelNoise = 3e-2;  // m/s^2
constexpr double kNoiseError = 0.15;  // of a variance after ten seconds
constexpr double kOnset = 0.6;        // s, from the first motion to its discovery
constexpr int kSeeds = 100;
constexpr int kFalseAlarms = 2;  // of so many rests of 30 s; none was seen

/// An IMU that rests with constant biases until told otherwise.
struct Imu {
    test::Random random;
    double gyro_noise = kGyroNoise, accel_noise = kAccelNoise;
    Vec3 gyro_bias{0.01, -0.02, 0.005}, accel_bias{0.1, -0.05, 0.2};
    double t = 0.0;

    explicit Imu(unsigned seed) : random(seed) {}
    Vec3 normal() { return {random.normal(), random.normal(), random.normal()}; }
    /// @param accel_at, gyro_at of the motion along and about x, at a time (s).
    template <typename A, typename G>
    std::vector<ImuSample> scan(const A& accel_at, const G& gyro_at, int samples = kSamples) {
        std::vector<ImuSample> out(static_cast<std::size_t>(samples));
        for (ImuSample& s : out) {
            t += kPeriod;
            s.gyro = gyro_bias + gyro_noise * normal() + gyro_at(t) * Vec3::UnitX();
            s.accel = Vec3(0.0, 0.0, 9.81) + accel_bias + accel_noise * normal() +
                      accel_at(t) * Vec3::UnitX();
        }
        return out;
    }
    static double still(double) { return 0.0; }
    std::vector<ImuSample> scan(int samples = kSamples) { return scan(still, still, samples); }
};

RestDetector rested(Imu& imu, int scans) {
    RestDetector rest;
    for (int i = 0; i < scans; ++i) rest.add(imu.scan());
    return rest;
}

TEST(RestDetector, WhiteNoiseRests) {
    int alarms = 0;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
        Imu imu(seed);
        if (!rested(imu, 300).resting()) ++alarms;
    }
    RecordProperty("alarms_in_100_rests_of_30_s", alarms);
    EXPECT_LE(alarms, kFalseAlarms);
}

TEST(RestDetector, LearnsTheNoiseOfBothSensors) {
    for (unsigned seed = 0; seed < 10; ++seed) {
        Imu imu(seed);
        imu.gyro_noise *= 1.0 + seed;
        const RestDetector rest = rested(imu, 100);
        ASSERT_TRUE(rest.knows_noise());
        const double gyro = imu.gyro_noise * imu.gyro_noise;
        const double accel = imu.accel_noise * imu.accel_noise;
        EXPECT_NEAR(rest.gyro_variance(), gyro, kNoiseError * gyro);
        EXPECT_NEAR(rest.accel_variance(), accel, kNoiseError * accel);
    }
}

TEST(RestDetector, FewSamplesAScanDoNotMakeTheNoiseLookSmaller) {
    Imu imu(3);
    RestDetector rest;
    for (int i = 0; i < 500; ++i) rest.add(imu.scan(4));
    const double gyro = kGyroNoise * kGyroNoise;
    EXPECT_NEAR(rest.gyro_variance(), gyro, kNoiseError * gyro);
}

TEST(RestDetector, KnowsNothingBeforeItHasSeenEnough) {
    Imu imu(1);
    RestDetector rest;
    EXPECT_TRUE(rest.resting());
    EXPECT_FALSE(rest.knows_noise());
    for (int i = 0; i < 5; ++i)
        rest.add(imu.scan());  // the newest five are not judged by themselves
    EXPECT_FALSE(rest.knows_noise());
    rest.add(imu.scan());
    EXPECT_TRUE(rest.knows_noise());
    RestDetector sparse;  // a single sample has no spread
    for (int i = 0; i < 60; ++i) sparse.add(imu.scan(1));
    EXPECT_FALSE(sparse.knows_noise());
}

/// Seconds from the first motion to its discovery; infinity if it is missed.
template <typename A, typename G>
double onset(unsigned seed, const A& accel_at, const G& gyro_at) {
    Imu imu(seed);
    RestDetector rest = rested(imu, 50);
    if (!rest.resting()) return 0.0;  // a false alarm, counted elsewhere
    const double start = imu.t;
    for (int i = 0; i < 50 && rest.resting(); ++i) {
        rest.add(imu.scan([&](double t) { return accel_at(t - start); },
                          [&](double t) { return gyro_at(t - start); }));
    }
    return rest.resting() ? std::numeric_limits<double>::infinity() : imu.t - start;
}

TEST(RestDetector, FindsTheOnsetOfASmoothStart) {
    const auto driving_off = [](double t) {  // to 1.5 m/s in 3 s, without a jerk at the start
        return 0.5 * (1.0 - std::cos(2.0 * 3.14159265 * t / 3.0));
    };
    const auto turning = [](double t) { return 0.1 * t * t; };  // rad/s
    double drive = 0.0, turn = 0.0;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
        drive = std::max(drive, onset(seed, driving_off, Imu::still));
        turn = std::max(turn, onset(seed, Imu::still, turning));
    }
    RecordProperty("slowest_drive_ms", static_cast<int>(1e3 * drive));
    RecordProperty("slowest_turn_ms", static_cast<int>(1e3 * turn));
    EXPECT_LE(drive, kOnset);
    EXPECT_LE(turn, kOnset);
}

TEST(RestDetector, FindsASlowDriftOnceHalfASecondShowsIt) {
    // 7.5 sigma of the mean of 100 samples: no single scan of 20 shows that.
    const double accel = 7.5 * kAccelNoise / std::sqrt(100.0);
    int missed = 0;
    for (unsigned seed = 0; seed < kSeeds; ++seed) {
        const double t = onset(
            seed, [accel](double) { return accel; }, Imu::still);
        if (!(t <= 0.8)) ++missed;
    }
    EXPECT_LT(missed, 10);
}

/// A walking bias must not be taken for motion.
TEST(RestDetector, ALongRestToleratesTheBiasWalk) {
    constexpr int kRests = 50, kTolerated = 3;
    int alarms = 0;
    for (unsigned seed = 0; seed < kRests; ++seed) {
        Imu imu(seed);
        RestDetector rest;
        for (int i = 0; i < 600 && rest.resting(); ++i) {
            imu.gyro_bias += 1e-5 * std::sqrt(0.1) * imu.normal();     // rad/s^1.5, consumer grade
            imu.accel_bias += 1.5e-4 * std::sqrt(0.1) * imu.normal();  // m/s^2.5
            rest.add(imu.scan());
        }
        if (!rest.resting()) ++alarms;
    }
    RecordProperty("alarms_in_50_rests_of_60_s", alarms);
    EXPECT_LE(alarms, kTolerated);
}

/// What is kept does not grow with the time: the past is one block that fades.
TEST(RestDetector, ALongPastFades) {
    Imu imu(4);
    RestDetector rest = rested(imu, 3000);
    ASSERT_TRUE(rest.resting());
    const double before = rest.gyro_variance();
    imu.gyro_noise *= 0.5;
    for (int i = 0; i < 600; ++i) rest.add(imu.scan());  // a minute: three times what is kept
    const double expected = (0.25 + 0.75 * std::exp(-3.0)) * before;
    EXPECT_NEAR(rest.gyro_variance(), expected, kNoiseError * expected);
}

TEST(RestDetector, ANotANumberEndsTheRest) {
    for (const int before : {0, 3, 50}) {  // even where it comes before anything is known
        Imu imu(5);
        RestDetector rest = rested(imu, before);
        ASSERT_TRUE(rest.resting());
        auto samples = imu.scan();
        samples[7].accel.y() = std::numeric_limits<double>::quiet_NaN();
        rest.add(samples);
        for (int i = 0; i < 8; ++i) rest.add(imu.scan());
        EXPECT_FALSE(rest.resting()) << before;
    }
}

TEST(RestDetector, ScansWithoutSamplesChangeNothing) {
    Imu a(6), b(6);
    RestDetector with, without;
    with.add({});
    EXPECT_TRUE(with.resting());
    EXPECT_FALSE(with.knows_noise());
    for (int i = 0; i < 40; ++i) {
        with.add(a.scan());
        without.add(b.scan());
        with.add({});
    }
    EXPECT_TRUE(with.resting());
    EXPECT_EQ(with.gyro_variance(), without.gyro_variance());
    EXPECT_EQ(with.accel_variance(), without.accel_variance());
}

TEST(RestDetector, ShakingIsNoRest) {
    for (const double times : {1.0, 10.0}) {
        Imu imu(7), hand(7);
        imu.accel_noise *= times;  // 0.3 m/s^2: a car on a road
        hand.gyro_noise *= 2.0 * times;
        EXPECT_EQ(rested(imu, 30).resting(), times == 1.0);
        EXPECT_EQ(rested(hand, 30).resting(), times == 1.0);
    }
}

TEST(RestDetector, ReadingsWithoutNoiseRestAndAreNotTakenAtTheirWord) {
    Imu imu(8);
    imu.gyro_noise = imu.accel_noise = 0.0;
    RestDetector rest = rested(imu, 30);
    ASSERT_TRUE(rest.resting());
    ASSERT_TRUE(rest.knows_noise());
    EXPECT_GT(rest.noise(1.0).gyro, 1e-7);
    EXPECT_GT(rest.noise(1.0).accel, 1e-5);
    const double start = imu.t;
    for (int i = 0; i < 10; ++i) {
        rest.add(imu.scan([start](double t) { return 0.5 * (t - start); }, Imu::still));
    }
    EXPECT_FALSE(rest.resting());
    rest.reset();
    EXPECT_TRUE(rest.resting());
    EXPECT_FALSE(rest.knows_noise());
}

TEST(RestDetector, ExpectsFourTimesTheVariancesInMotionAndAWalkInProportion) {
    Imu imu(9);
    const RestDetector rest = rested(imu, 100);
    const double scale = 9.81;  // readings in g
    const ProcessNoise q = rest.noise(scale);
    EXPECT_DOUBLE_EQ(q.gyro, 4.0 * rest.gyro_variance());
    EXPECT_DOUBLE_EQ(q.accel, 4.0 * rest.accel_variance() * scale * scale);
    EXPECT_DOUBLE_EQ(q.gyro_bias / q.gyro, 0.05 / 4.0);
    EXPECT_DOUBLE_EQ(q.accel_bias / q.accel, 0.05 / 4.0);
}

TEST(RestDetector, MotionDoesNotEnterTheNoise) {
    Imu imu(8);
    RestDetector rest = rested(imu, 100);
    const double known = rest.accel_variance();
    const double start = imu.t;
    for (int i = 0; i < 20; ++i) {
        rest.add(imu.scan([start](double t) { return 3.0 * (t - start); }, Imu::still));
    }
    EXPECT_FALSE(rest.resting());
    EXPECT_NEAR(rest.accel_variance(), known, kNoiseError * known);
}

}  // namespace
}  // namespace d2lio
