// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "../geometry/random_state.hpp"
#include "d2lio/host/pose_uncertainty.hpp"
#include "d2lio/imu/hold.hpp"

namespace d2lio {
namespace {

using I = StateIndex;

constexpr double kRow = 1e-3;                                         // m^2, variance of a row
constexpr double kPeriod = 0.1;                                       // s, of the scans
constexpr int kSamples = 20;                                          // of the IMU in a scan
constexpr double kExact = 1e-12;                                      // relative
const Mat12 kNoise = ProcessNoise{1e-6, 1e-3, 1e-10, 1e-8}.matrix();  // per sample

/// Information of rows with unit normals that are spread evenly, at 5 m around the body.
Mat6 even(int rows) {
    Mat6 out = Mat6::Zero();
    out.diagonal() << Vec3::Constant(rows / 3.0), Vec3::Constant(25.0 * rows / 3.0);
    return out / kRow;
}

/// What an update of P by rows of this information does; of the pose alone.
PoseUncertainty::Match match_of(const Mat23x23& P, const Mat6& information) {
    Mat23x23 inverse = P.inverse();
    inverse.topLeftCorner<6, 6>() += information;
    const Mat23x23 posterior = inverse.inverse();
    PoseUncertainty::Match m;
    m.gain.leftCols<6>() = posterior.leftCols<6>() * information;
    m.noise = m.gain * posterior.topRows<12>();
    m.information = information;
    return m;
}

std::vector<ImuStep> steps_of(const ImuInput& u) {
    std::vector<ImuStep> out(kSamples);
    for (ImuStep& s : out) {
        static_cast<ImuInput&>(s) = u;
        s.dt = kPeriod / kSamples;
    }
    return out;
}

Mat12 integrated() { return kSamples * std::pow(kPeriod / kSamples, 2) * kNoise; }

/// A filter and its honest covariance, scan by scan.
struct Drive {
    NavState x;
    Mat23x23 P = start_covariance();
    PoseUncertainty honest;
    Vec3 force = Vec3(0.0, 0.0, 9.809);  ///< m/s^2, body

    Drive() {
        P.topLeftCorner<6, 6>() = 1e-6 * Mat6::Identity();
        P.block<3, 3>(I::kVel, I::kVel) = 1e-6 * Mat3::Identity();
        honest.begin(P);
    }
    void predict() {
        const NavState before = x;
        const std::vector<ImuStep> steps = steps_of({Vec3::Zero(), force});
        for (const ImuStep& s : steps) propagate(x, P, s, s.dt, kNoise, true);
        honest.predict(before, x, steps, integrated());
    }
    void scan(const Mat6& information, double share, double misfit = 1.0) {
        predict();
        PoseUncertainty::Match m = match_of(P, information);
        m.misfit = misfit;
        P -= m.gain * P.topRows<12>();
        P = 0.5 * (P + P.transpose()).eval();
        honest.update(x, m);
        honest.grow(x, share);
    }
    double sigma(int i) const { return std::sqrt(honest.covariance(x)(i, i)); }
};

TEST(PoseUncertainty, BeginsWithAKnownPoseAndTheFiltersVelocity) {
    test::Random random(1);
    const Mat23x23 P = random.covariance();
    const NavState x = random.state();
    PoseUncertainty u;
    EXPECT_FALSE(u.begun());
    u.begin(P);
    EXPECT_TRUE(u.begun());
    Mat6 known = Mat6::Zero();
    known.diagonal() << Vec3::Constant(1e-6), Vec3::Constant(1e-8);
    EXPECT_TRUE(u.covariance(x).isApprox(known, kExact));
    u.take(P);
    Mat6 J = Mat6::Identity();
    J.bottomRightCorner<3, 3>() = x.rot;
    EXPECT_TRUE(u.covariance(x).isApprox(J * P.topLeftCorner<6, 6>() * J.transpose(), kExact));
    u.clear();
    EXPECT_FALSE(u.begun());
}

TEST(PoseUncertainty, PredictsWhatTheStepsOfTheFilterPredict) {
    test::Random random(2);
    for (int i = 0; i < 20; ++i) {
        const NavState x = random.state();
        const ImuInput u{random.vec3(0.5), random.vec3(12.0)};
        const Mat23x23 P = random.covariance();
        PoseUncertainty honest;
        honest.take(P);
        NavState y = x;
        Mat23x23 stepped = P;
        const std::vector<ImuStep> steps = steps_of(u);
        for (const ImuStep& s : steps) propagate(y, stepped, s, s.dt, kNoise, true);
        honest.predict(x, y, steps, integrated());
        Mat6 J = Mat6::Identity();
        J.bottomRightCorner<3, 3>() = y.rot;
        const Mat6 expected = J * stepped.topLeftCorner<6, 6>() * J.transpose();
        // Over 0.1 s at 0.5 rad/s the body turns by 0.05 rad within the one step.
        EXPECT_LT((honest.covariance(y) - expected).norm(), 0.02 * expected.norm());
    }
}

/// Draws of the filter's error and the map's, moved by the equations of the class's description,
/// scatter as it says.
TEST(PoseUncertainty, IsTheCovarianceOfErrorsThatAreDrawn) {
    test::Random random(3);
    constexpr int kDraws = 4000, kScans = 12;
    constexpr double kScatter = 0.1;  // of a covariance of 4000 draws, worst of 36 elements
    constexpr double kShare = 0.2, kMapNoise = 3.0;
    Drive drive;
    drive.x.rot = random.rotation();
    drive.force = drive.x.rot.transpose() * Vec3(0.3, -0.2, 9.809);
    const Mat6 information = even(300);
    Eigen::MatrixXd e(23, kDraws), m = Eigen::MatrixXd::Zero(6, kDraws);
    const auto draw = [&](const Eigen::MatrixXd& C, Eigen::Index n) {
        const Eigen::MatrixXd L =
            Eigen::LLT<Eigen::MatrixXd>(C + 1e-15 * Eigen::MatrixXd::Identity(C.rows(), C.cols()))
                .matrixL();
        const Eigen::MatrixXd z =
            Eigen::MatrixXd::NullaryExpr(n, kDraws, [&] { return random.normal(); });
        return Eigen::MatrixXd(L * z);
    };
    Mat23x23 start = drive.P;
    start.topRows<6>().setZero();
    start.leftCols<6>().setZero();
    start.diagonal().head<6>() << Vec3::Constant(1e-6), Vec3::Constant(1e-8);
    e = draw(start, 23);
    for (int k = 0; k < kScans; ++k) {
        const NavState before = drive.x;
        drive.predict();
        for (const ImuStep& s : steps_of({Vec3::Zero(), drive.force})) {
            // the state moved already: its rotation is constant here
            e = propagation_jacobian(before, s, s.dt, true) * e;
        }
        e += propagation_noise_jacobian(before, {Vec3::Zero(), drive.force}, kPeriod) *
             draw(integrated(), 12);
        m.topRows<3>() -= hat(drive.x.pos - before.pos) * m.bottomRows<3>();

        const PoseUncertainty::Match match = match_of(drive.P, information);
        drive.P -= match.gain * drive.P.topRows<12>();
        Mat6 J = Mat6::Identity();
        J.bottomRightCorner<3, 3>() = drive.x.rot;
        Mat6 scan = information;  // see kSeenPosition and kSeenRotation
        scan.diagonal().head<3>().array() += 2500.0;
        scan.diagonal().tail<3>().array() += 40000.0;
        scan = kMapNoise * J * (scan.inverse() * information * scan.inverse()) * J.transpose();
        scan.diagonal().tail<3>().array() += 0.25e-6;
        if (k == 0) m += draw(scan, 6);
        e -= match.gain.leftCols<6>() * (e.topRows<6>() - J.transpose() * m);
        e += draw(match.noise, 23);
        m = (1.0 - kShare) * m + kShare * J * e.topRows<6>() + draw(kShare * scan, 6);
        drive.honest.update(drive.x, match);
        drive.honest.grow(drive.x, kShare);

        const Eigen::MatrixXd pose = J * e.topRows<6>();
        const Mat6 drawn = pose * pose.transpose() / kDraws,
                   said = drive.honest.covariance(drive.x);
        for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) {
                EXPECT_NEAR(drawn(i, j), said(i, j), kScatter * std::sqrt(said(i, i) * said(j, j)));
            }
        }
    }
}

TEST(PoseUncertainty, ErrorsOfNewMapsAddUpAndThoseOfOneMapDoNot) {
    constexpr int kYaw = 5;  // gravity turns a tilt into more
    Drive stays, goes;
    double early = 0.0;
    for (int i = 0; i < 400; ++i) {
        stays.scan(even(900), 0.0);
        goes.scan(even(900), 0.1);
        if (i == 99) early = goes.sigma(kYaw);
    }
    const double growth = goes.sigma(kYaw) / early;  // in four times as long
    EXPECT_GT(growth, 1.8);                          // a random walk: 2; nothing new: 1
    EXPECT_LT(growth, 2.6);                          // a drift: 4
    EXPECT_LT(stays.sigma(kYaw), 0.2 * goes.sigma(kYaw));
    EXPECT_GT(stays.sigma(kYaw), 2.0 * std::sqrt(stays.P(kYaw, kYaw)));  // the first scan's noise
    EXPECT_LT(stays.sigma(0), 0.2 * goes.sigma(0));
}

TEST(PoseUncertainty, GrowsAlongABlindAxisAsTheImuDoes) {
    Mat6 blind = even(900);
    blind(0, 0) = 0.0;
    Drive drive;
    for (int i = 0; i < 100; ++i) drive.scan(blind, 0.1);
    // The tilt is the map's here, and uncertain: gravity makes more of it than the filter thinks.
    EXPECT_GT(drive.sigma(0), std::sqrt(drive.P(0, 0)));
    EXPECT_GT(drive.sigma(0), 20.0 * drive.sigma(1));
    const double blind_for_ten_seconds = drive.sigma(0);
    for (int i = 0; i < 10; ++i) drive.scan(even(900), 0.1);
    EXPECT_GT(drive.sigma(0), 0.3 * blind_for_ten_seconds);  // seen again, in a map that is off
}

TEST(PoseUncertainty, ATurnedMapIsFartherOffFartherAway) {
    Drive drive;
    drive.scan(even(900), 0.0);
    const double near = drive.sigma(1), turned = drive.sigma(5);
    drive.x.vel = Vec3(100.0, 0.0, 0.0);
    for (int i = 0; i < 10; ++i) drive.scan(even(900), 0.0);
    EXPECT_GT(drive.sigma(1), near + 50.0 * turned);  // 100 m along x
}

TEST(PoseUncertainty, RowsThatDoNotFitCountLess) {
    Drive fits, tight, loose;
    for (int i = 0; i < 50; ++i) {
        fits.scan(even(900), 0.1, 1.0);
        tight.scan(even(900), 0.1, 0.2);
        loose.scan(even(900), 0.1, 25.0);
    }
    EXPECT_EQ(tight.sigma(0), fits.sigma(0));
    EXPECT_GT(loose.sigma(0), 2.0 * fits.sigma(0));
}

TEST(PoseUncertainty, StaysPositiveDefiniteAndEndsWhereItIsNotFinite) {
    Drive drive;
    for (int i = 0; i < 2000; ++i) drive.scan(even(i % 7 == 0 ? 3 : 900), 0.05, 1.0);
    EXPECT_EQ(Eigen::LLT<Mat6>(drive.honest.covariance(drive.x)).info(), Eigen::Success);
    drive.honest.predict(drive.x, drive.x, steps_of({Vec3::Zero(), Vec3::Constant(1e300)}),
                         integrated());
    EXPECT_FALSE(drive.honest.begun());
    drive.honest.take(drive.P);
    drive.honest.grow(drive.x, 1.0);  // before any match
    EXPECT_TRUE(drive.honest.covariance(drive.x).allFinite());
}

}  // namespace
}  // namespace d2lio
