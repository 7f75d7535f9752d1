// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/liosam/guess_covariance.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <deque>
#include <mutex>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/plugin/core.hpp"

namespace d2lio::liosam {
namespace {

using Mat15 = Eigen::Matrix<double, 15, 15>;

constexpr int kRot = 0, kPos = 3, kVel = 6, kAccelBias = 9, kGyroBias = 12;

/// Before the second estimate: any speed of a vehicle, and the biases as upstream's graph starts.
constexpr double kStartSpeed = 30.0;       ///< m/s
constexpr double kStartBias = 1e-3;        ///< m/s^2, rad/s
constexpr std::size_t kMaxSamples = 8192;  ///< 20 s at 400 Hz; older ones go
constexpr double kLongestStep = 0.1;       ///< s, where samples are missing
constexpr double kLongestHorizon = 60.0;   ///< s, after that it starts anew
constexpr double kNoWeight = 1e-12;        ///< keeps a covariance definite, rad^2 and m^2

struct Sample {
    double stamp;
    Vec3 accel, gyro;
};

/// Error propagation over a stretch of time: P becomes Phi P Phi^T + Q.
struct Transition {
    Mat15 Phi = Mat15::Identity(), Q = Mat15::Zero();
    Mat15 apply(const Mat15& P) const { return Phi * P * Phi.transpose() + Q; }
};

Mat15 start_covariance() {
    Mat15 P = Mat15::Zero();
    P.diagonal().segment<3>(kVel).setConstant(kStartSpeed * kStartSpeed);
    P.diagonal().segment<6>(kAccelBias).setConstant(kStartBias * kStartBias);
    return P;
}

/// The transition matrix F of one step (Sola, section 5.4): the identity but for these blocks.
struct Step {
    double dt;
    Mat3 turn;   ///< attitude's own
    Mat3 force;  ///< of the velocity by the attitude
    Mat3 R;      ///< at the step's start

    /// M becomes F M. Full products of 15 x 15 would cost as much as the rest of the plug-in.
    void apply(Mat15& M) const {
        const Eigen::Matrix<double, 3, 15> gain =
            force * M.middleRows<3>(kRot) - (dt * R) * M.middleRows<3>(kAccelBias);
        M.middleRows<3>(kPos) += dt * M.middleRows<3>(kVel) + (0.5 * dt) * gain;
        M.middleRows<3>(kVel) += gain;
        M.middleRows<3>(kRot) =
            (turn.transpose() * M.middleRows<3>(kRot) - dt * M.middleRows<3>(kGyroBias)).eval();
    }
};

/// One step of the error state, attitude R at its start; then R moves on.
void advance(const Vec3& accel, const Vec3& gyro, double dt, const GuessNoise& n, Mat3& R,
             Transition& t) {
    const Step step{dt, exp_so3(gyro * dt), -dt * R * hat(accel), R};
    step.apply(t.Phi);
    step.apply(t.Q);
    t.Q.transposeInPlace();
    step.apply(t.Q);
    const auto add = [&t, dt](int at, double density) {
        t.Q.diagonal().segment<3>(at).array() += density * density * dt;
    };
    add(kRot, n.gyro);
    add(kVel, n.accel);
    add(kAccelBias, n.accel_bias);
    add(kGyroBias, n.gyro_bias);
    R = R * step.turn;
}

}  // namespace

struct GuessCovariance::Impl {
    mutable std::mutex mutex;
    GuessNoise noise;
    std::deque<Sample> samples;
    bool started = false;
    double stamp = 0.0;  ///< of the last estimate
    Mat3 R = Mat3::Identity();
    Mat15 P = start_covariance();  ///< at the last estimate

    Transition until(double end) const;
    void measure(double sigma_r, double sigma_t);
};

/// A sample stands for the time since the one before it; the newest also for what comes after.
Transition GuessCovariance::Impl::until(double end) const {
    Transition t;
    Mat3 attitude = R;
    Vec3 accel = R.transpose() * Vec3(0.0, 0.0, noise.gravity), gyro = Vec3::Zero();
    double now = stamp;
    const auto go = [&](double to) {
        while (now < to) {
            const double dt = std::min(to - now, kLongestStep);
            if (!(now + dt > now)) break;
            advance(accel, gyro, dt, noise, attitude, t);
            now += dt;
        }
    };
    for (const Sample& s : samples) {
        accel = s.accel;
        gyro = s.gyro;
        if (s.stamp <= now) continue;
        go(std::min(s.stamp, end));
        if (s.stamp >= end) break;
    }
    go(end);
    return t;
}

/// Kalman update of the covariance by a pose.
void GuessCovariance::Impl::measure(double sigma_r, double sigma_t) {
    Mat6 S = P.topLeftCorner<6, 6>();
    S.diagonal().head<3>().array() += sigma_r * sigma_r;
    S.diagonal().tail<3>().array() += sigma_t * sigma_t;
    const Eigen::Matrix<double, 15, 6> PHt = P.leftCols<6>();
    const Mat15 next = P - PHt * S.ldlt().solve(PHt.transpose());
    P = next.allFinite() ? Mat15(0.5 * (next + next.transpose())) : start_covariance();
}

GuessCovariance::GuessCovariance() : impl_(std::make_unique<Impl>()) {}
GuessCovariance::~GuessCovariance() = default;

void GuessCovariance::configure(const GuessNoise& noise) {
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    impl_->noise = noise;
    impl_->samples.clear();
    impl_->started = false;
    impl_->P = start_covariance();
}

void GuessCovariance::add_imu(double stamp, const double* accel, const double* gyro) {
    const Sample s{stamp, Eigen::Map<const Vec3>(accel), Eigen::Map<const Vec3>(gyro)};
    if (!std::isfinite(stamp) || !s.accel.allFinite() || !s.gyro.allFinite()) return;
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    auto& samples = impl_->samples;
    if (!samples.empty() && stamp <= samples.back().stamp) {
        if (stamp > samples.back().stamp - 1.0) return;  // out of order
        samples.clear();                                 // time has jumped back
    }
    samples.push_back(s);
    if (samples.size() > kMaxSamples) samples.pop_front();
}

void GuessCovariance::correct(double stamp, const PoseView& view, bool degenerate) {
    const Pose pose = to_pose(view);
    if (!std::isfinite(stamp) || !is_finite(pose)) return;
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    Impl& m = *impl_;
    const double horizon = stamp - m.stamp;
    if (m.started && horizon > 0.0 && horizon < kLongestHorizon) {
        m.P = m.until(stamp).apply(m.P);
    } else {
        m.P = start_covariance();
    }
    const GuessNoise& n = m.noise;
    m.measure(degenerate ? n.degenerate_rotation : n.correction_rotation,
              degenerate ? n.degenerate_translation : n.correction_translation);
    m.started = true;
    m.stamp = stamp;
    m.R = pose.R;
    // The newest sample before the horizon stays: it may be all there is.
    while (m.samples.size() > 1 && m.samples[1].stamp <= stamp) m.samples.pop_front();
}

bool GuessCovariance::predict(double stamp, double* covariance) const {
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    const Impl& m = *impl_;
    if (!m.started || !(stamp > m.stamp) || !(stamp - m.stamp < kLongestHorizon)) return false;
    Mat15 P = m.P;
    P.topRows<6>().setZero();
    P.leftCols<6>().setZero();
    Mat6 C = m.until(stamp).apply(P).topLeftCorner<6, 6>();
    C.diagonal().array() += kNoWeight;
    if (!C.allFinite()) return false;
    std::copy_n(C.data(), C.size(), covariance);
    return true;
}

}  // namespace d2lio::liosam
