// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>
#include <vector>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/liosam/guess_covariance.hpp"

namespace d2lio::liosam {
namespace {

constexpr double kRate = 100.0;  ///< Hz
const Vec3 kGravity(0.0, 0.0, 9.80511);

struct Imu {
    Vec3 accel, gyro;
};
/// Body rates and specific force of a walk through a room.
Imu motion(double t) {
    return {Vec3(0.8 * std::sin(t), 0.5 * std::cos(1.3 * t), 9.80511),
            Vec3(0.1 * std::sin(2.0 * t), 0.2 * std::cos(t), 0.3)};
}

PoseView view(const Pose& p) { return {p.R.data(), p.t.data()}; }

void feed(GuessCovariance& g, double from, double to) {
    const int last = static_cast<int>(std::lround(to * kRate));
    for (int i = static_cast<int>(std::lround(from * kRate)) + 1; i <= last; ++i) {
        const Imu imu = motion(i / kRate);
        g.add_imu(i / kRate, imu.accel.data(), imu.gyro.data());
    }
}

/// Matched scans at 5 Hz for `seconds`.
void settle(GuessCovariance& g, double seconds) {
    for (double t = 0.0; t < seconds - 1e-9; t += 0.2) {
        g.correct(t, view(Pose{}), false);
        feed(g, t, t + 0.2);
    }
    g.correct(seconds, view(Pose{}), false);
}

TEST(GuessCovariance, KnowsNothingBeforeTheFirstEstimate) {
    GuessCovariance g;
    Mat6 P = Mat6::Constant(7.0);
    EXPECT_FALSE(g.predict(1.0, P.data()));
    g.correct(1.0, view(Pose{}), false);
    EXPECT_FALSE(g.predict(1.0, P.data()));
    EXPECT_FALSE(g.predict(0.5, P.data()));
    EXPECT_FALSE(g.predict(NAN, P.data()));
    EXPECT_EQ(P, Mat6(Mat6::Constant(7.0)));
    EXPECT_TRUE(g.predict(1.1, P.data()));
    EXPECT_TRUE(P.allFinite());
}

TEST(GuessCovariance, TheSecondEstimateTellsTheSpeed) {
    GuessCovariance g;
    Mat6 first, later;
    g.correct(0.0, view(Pose{}), false);
    feed(g, 0.0, 0.2);
    ASSERT_TRUE(g.predict(0.2, first.data()));
    EXPECT_GT(std::sqrt(first(3, 3)), 1.0);  // any speed of a vehicle
    settle(g, 4.0);
    feed(g, 4.0, 4.4);
    ASSERT_TRUE(g.predict(4.4, later.data()));
    EXPECT_LT(std::sqrt(later(3, 3)), 0.1);
    EXPECT_GT(std::sqrt(later(3, 3)), 1e-3);
}

/// The filter against a simulation of what it claims to know: many runs of the full estimator
/// (state and covariance), each with its own noise, matched poses and start.
TEST(GuessCovariance, AgreesWithTheSpreadOfSimulatedGuesses) {
    GuessNoise n;
    n.accel = 0.05;
    n.gyro = 0.01;
    n.accel_bias = n.gyro_bias = 1e-4;
    GuessCovariance g;
    g.configure(n);
    // A standstill: the mean motion is known, so errors are all there is to simulate.
    const double dt = 1.0 / kRate;
    const int per_scan = 20, scans = 15, runs = 4000;
    const Vec3 up = kGravity, zero = Vec3::Zero();
    double t = 0.0;
    g.correct(0.0, view(Pose{}), false);
    for (int s = 0; s < scans; ++s) {
        for (int i = 0; i < per_scan; ++i) {
            t += dt;
            g.add_imu(t, up.data(), zero.data());
        }
        if (s + 1 < scans) g.correct(0.2 * (s + 1), view(Pose{}), false);
    }
    Mat6 claimed;
    ASSERT_TRUE(g.predict(0.2 * scans, claimed.data()));

    // Speed and tilt errors of a least-squares velocity have no closed form here; a scalar filter
    // along x with the same model is simulated instead: tilt, position, speed, both biases.
    using Vec5 = Eigen::Matrix<double, 5, 1>;
    using Mat5 = Eigen::Matrix<double, 5, 5>;
    Mat5 F = Mat5::Identity();
    const double gz = kGravity.z();
    F(0, 4) = -dt;                      // tilt about y from the gyro bias
    F(2, 0) = -gz * dt, F(2, 3) = -dt;  // speed
    F(1, 2) = dt, F(1, 0) = -0.5 * gz * dt * dt, F(1, 3) = -0.5 * dt * dt;  // position
    std::mt19937 random(5);
    std::normal_distribution<double> unit;
    Mat5 P0 = Mat5::Zero();
    P0(2, 2) = 900.0, P0(3, 3) = P0(4, 4) = 1e-6;
    double sum = 0.0;
    for (int r = 0; r < runs; ++r) {
        Vec5 x(0.0, 0.0, 30.0 * unit(random), 1e-3 * unit(random), 1e-3 * unit(random)), e = x;
        Mat5 P = P0;  // e: error of the estimate, updated with the optimal gain
        Vec5 at_last = e;
        for (int s = 0; s < scans; ++s) {
            at_last = e;
            for (int i = 0; i < per_scan; ++i) {
                e = F * e;
                P = F * P * F.transpose();
                const double root = std::sqrt(dt);
                const Vec5 sigma(n.gyro * root, 0.0, n.accel * root, n.accel_bias * root,
                                 n.gyro_bias * root);
                for (int k = 0; k < 5; ++k) e[k] += sigma[k] * unit(random);
                P.diagonal() += sigma.cwiseProduct(sigma);
            }
            if (s + 1 == scans) break;
            const double sr = n.correction_rotation, st = n.correction_translation;
            Eigen::Matrix2d S = P.topLeftCorner<2, 2>();
            S(0, 0) += sr * sr;
            S(1, 1) += st * st;
            const Eigen::Matrix<double, 5, 2> K = P.leftCols<2>() * S.inverse();
            const Eigen::Vector2d z(sr * unit(random), st * unit(random));
            e += K * (z - e.head<2>());
            P -= K * P.topRows<2>();
        }
        // Error of the increment over the last horizon: what pose errors at its start carry over
        // (a tilt that was there) is not counted by the relative covariance.
        Vec5 relative = e;
        Vec5 carried = Vec5::Zero();
        carried.head<2>() = at_last.head<2>();
        for (int i = 0; i < per_scan; ++i) carried = F * carried;
        relative -= carried;
        sum += relative[1] * relative[1];
    }
    const double measured = std::sqrt(sum / runs);
    EXPECT_NEAR(std::sqrt(claimed(3, 3)) / measured, 1.0, 0.05);  // 1.1 % is one sigma of 4000 runs
}

TEST(GuessCovariance, TheHorizonsLengthAndTheNoiseWidenIt) {
    GuessCovariance quiet, noisy;
    GuessNoise n;
    n.accel *= 10.0;
    n.gyro *= 10.0;
    noisy.configure(n);
    settle(quiet, 2.0);
    settle(noisy, 2.0);
    Mat6 near, far, loud;
    feed(quiet, 2.0, 3.0);
    feed(noisy, 2.0, 3.0);
    ASSERT_TRUE(quiet.predict(2.2, near.data()));
    ASSERT_TRUE(quiet.predict(3.0, far.data()));
    ASSERT_TRUE(noisy.predict(2.2, loud.data()));
    for (int i = 0; i < 6; ++i) {
        EXPECT_GT(far(i, i), 2.0 * near(i, i)) << i;
        EXPECT_GT(loud(i, i), near(i, i)) << i;
    }
    Eigen::SelfAdjointEigenSolver<Mat6> eigen(far);
    EXPECT_GT(eigen.eigenvalues()[0], 0.0);
    EXPECT_LT((far - far.transpose()).norm(), 1e-12);
}

TEST(GuessCovariance, ADegenerateScanTeachesLess) {
    GuessCovariance good, weak;
    settle(good, 2.0);
    settle(weak, 2.0);
    for (double t = 2.2; t < 4.01; t += 0.2) {
        feed(good, t - 0.2, t);
        feed(weak, t - 0.2, t);
        good.correct(t, view(Pose{}), false);
        weak.correct(t, view(Pose{}), true);
    }
    Mat6 a, b;
    ASSERT_TRUE(good.predict(4.2, a.data()));
    ASSERT_TRUE(weak.predict(4.2, b.data()));
    EXPECT_GT(b(3, 3), 2.0 * a(3, 3));
}

/// Position errors come in map axes: they turn with the attitude.
TEST(GuessCovariance, PositionIsInMapAxes) {
    GuessCovariance level, turned;
    Pose yaw;
    yaw.R = exp_so3(Vec3(0.0, 0.0, 0.5 * M_PI));
    for (GuessCovariance* g : {&level, &turned}) {
        for (int i = 0; i <= 50; ++i) {
            const double t = 0.02 * i;
            const Vec3 a(3.0, 0.0, 9.8), w(0.0, 0.0, 0.0);
            g->add_imu(t, a.data(), w.data());
            if (i % 10 == 0) g->correct(t, view(g == &level ? Pose{} : yaw), false);
        }
    }
    Mat6 a, b;
    ASSERT_TRUE(level.predict(1.4, a.data()));
    ASSERT_TRUE(turned.predict(1.4, b.data()));
    EXPECT_NEAR(a(3, 3), b(4, 4), 1e-9 * a(3, 3));
    EXPECT_NEAR(a(4, 4), b(3, 3), 1e-9 * a(4, 4));
    EXPECT_GT(std::abs(a(3, 3) - a(4, 4)), 1e-6 * a(3, 3));
}

TEST(GuessCovariance, BadSamplesAndJumpsOfTimeDoNoHarm) {
    GuessCovariance g;
    settle(g, 2.0);
    const Vec3 nan(NAN, 0.0, 0.0), zero = Vec3::Zero(), up = kGravity;
    g.add_imu(2.1, nan.data(), zero.data());
    g.add_imu(NAN, up.data(), zero.data());
    g.add_imu(1.5, up.data(), zero.data());  // late
    Mat6 P;
    ASSERT_TRUE(g.predict(2.2, P.data()));  // without any sample in the horizon
    EXPECT_TRUE(P.allFinite());
    Pose broken;
    broken.R(0, 0) = NAN;
    g.correct(2.2, view(broken), false);  // ignored
    ASSERT_TRUE(g.predict(2.2, P.data()));
    EXPECT_FALSE(g.predict(1e6, P.data()));
    // A bag that loops: everything begins anew.
    g.add_imu(0.01, up.data(), zero.data());
    g.correct(0.0, view(Pose{}), false);
    ASSERT_TRUE(g.predict(0.2, P.data()));
    EXPECT_GT(std::sqrt(P(3, 3)), 1.0);
}

}  // namespace
}  // namespace d2lio::liosam
