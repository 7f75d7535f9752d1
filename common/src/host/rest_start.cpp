// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/rest_start.hpp"

#include <cmath>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/imu/hold.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"

namespace d2lio {
namespace {

constexpr double kProbation = 1.0;  ///< s, rest that is watched before it is believed
constexpr double kSeenShare = 0.3;  ///< of noise: directions that tell motion from rest
constexpr double kDistance = 0.05;  ///< m
constexpr double kAngle = 0.01;     ///< rad
constexpr double kSpeed = 0.5;      ///< m/s, of a body that left unnoticed
constexpr int kMostScans = 50;

}  // namespace

void RestStart::watch(const std::vector<ImuSample>& samples) {
    if (phase_ == Phase::kOver) return;
    detector_.add(samples);
    if (!detector_.resting()) end();
}

void RestStart::begin(const NavState& x, const Mat23x23& P) {
    if (phase_ != Phase::kAwaited) return;
    phase_ = Phase::kWatched;
    pose_ = x.T_map_imu();
    x_ = x;
    P_ = P;
}

void RestStart::record(const std::vector<ImuStep>& steps) {
    if (!watched()) return;
    steps_.push_back(steps);
    for (const ImuStep& s : steps) watched_ += s.dt;
}

bool RestStart::left(const Pose& estimate, const ScanDiagnostics& scan) const {
    const Vec3 moved = estimate.t - pose_.t;
    for (int i = 0; i < 3; ++i) {
        const bool sees = scan.noise_share[i] < kSeenShare;
        if (sees && std::abs(scan.noise_axes.col(i).dot(moved)) > kDistance) return true;
    }
    return log_so3(pose_.R.transpose() * estimate.R).norm() > kAngle;
}

RestStart::Event RestStart::judge(const Pose& estimate, const ScanDiagnostics& scan) {
    if (!watched() && !held()) return Event::kNothing;
    if (left(estimate, scan)) {
        const bool was_held = held();
        end();
        return was_held ? Event::kContradicted : Event::kNothing;
    }
    if (held() || watched_ < kProbation || !detector_.knows_noise()) return Event::kNothing;
    phase_ = Phase::kHeld;
    confirmed_ = true;
    return Event::kConfirmed;
}

void RestStart::replay(double accel_scale, bool exact, NavState& x, Mat23x23& P) {
    x = x_;
    P = P_;
    const Mat12 Q = detector_.noise(accel_scale).matrix();
    for (const std::vector<ImuStep>& scan : steps_) {
        for (const ImuStep& s : scan) {
            if (s.dt > 0.0) propagate(x, P, s, s.dt, Q, exact);
        }
        hold_still(pose_, x, P);
    }
    steps_ = {};
}

std::optional<ProcessNoise> RestStart::noise(double accel_scale) const {
    if (!confirmed_) return std::nullopt;
    return detector_.noise(accel_scale);
}

void reopen(Mat23x23& P) {
    P.diagonal().segment<3>(StateIndex::kPos).array() += kDistance * kDistance;
    P.diagonal().segment<3>(StateIndex::kRot).array() += kAngle * kAngle;
    P.diagonal().segment<3>(StateIndex::kVel).array() += kSpeed * kSpeed;
}

void RestCloud::add(const std::vector<Eigen::Vector3f>& points) {
    if (scans_ >= kMostScans) return;
    ++scans_;
    points_.insert(points_.end(), points.begin(), points.end());
}

std::vector<Eigen::Vector3f> RestCloud::mean(double leaf) {
    taken_ = scans_;
    std::vector<Eigen::Vector3f> out;
    voxel_grid(points_, static_cast<float>(leaf), out);
    return out;
}

}  // namespace d2lio
