// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "predictor.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/imu/hold.hpp"

namespace d2lio::liosam {
namespace {

using I = StateIndex;
using G = GraphIndex;
using Mat9 = Eigen::Matrix<double, 9, 9>;

/// A sensor at rest: spreads of its readings below these (vibration of an idling vehicle passes).
constexpr double kStillGyro = 0.02;  ///< rad/s
constexpr double kStillAccel = 0.3;  ///< m/s^2
/// Gyroscope bias of a sensor at rest is no more than this, rad/s; a larger mean is a turn.
constexpr double kMostBias = 0.05;
constexpr double kShortestStep = 1e-6;  ///< s
constexpr double kBeforeScan = -1e-9;   ///< s: points at the scan's begin are moved as well

constexpr double kStandardGravity = 9.80665;  ///< m/s^2 per g
/// Of the start, relative to the map that begins there.
constexpr double kStartSpeed = 1.0;     ///< m/s
constexpr double kStartGravity = 1e-3;  ///< rad, of the direction between two scans
constexpr double kNoWeight = 1e-12;     ///< keeps a covariance definite, rad^2 and m^2

/// R_map_imu with the given up direction (IMU frame) and no yaw.
Mat3 levelled(const Vec3& up) {
    const Mat3 R = Eigen::Quaterniond::FromTwoVectors(up, Vec3::UnitZ()).toRotationMatrix();
    const double yaw = std::atan2(R(1, 0), R(0, 0));
    return Eigen::AngleAxisd(-yaw, Vec3::UnitZ()) * R;
}

/// A covariance below neither of the two: `a` plus the positive part of b - a.
Mat9 upper_bound(const Mat9& a, const Mat9& b) {
    const Eigen::SelfAdjointEigenSolver<Mat9> more(b - a);
    const Mat9& V = more.eigenvectors();
    const Mat9 bound = a + V * more.eigenvalues().cwiseMax(0.0).asDiagonal() * V.transpose();
    return 0.5 * (bound + bound.transpose());
}

Mat3 rotation_of(const ImuSample& s) {
    return Eigen::Quaterniond(s.orientation).normalized().toRotationMatrix();
}

}  // namespace

Predictor::Predictor(const HostConfig& config)
    : config_(config), extrinsic_(config.intake.extrinsic()), start_(config.intake.init_samples) {}

void Predictor::reset() {
    initialised_ = false;
    start_.reset();
    stepper_.reset();
    steps_.clear();
    rest_.reset();
    uncertainty_.clear();
}

void Predictor::start_filter(bool rests) {
    P_ = d2lio::start_covariance();
    anchor_attitude(P_);
    uncertainty_.begin(P_);
    if (rests) rest_.begin(x_, P_);
}

bool Predictor::hold(const Pose& estimate, bool matched, const ScanDiagnostics& scan) {
    switch (matched ? rest_.judge(estimate, scan) : RestStart::Event::kNothing) {
        case RestStart::Event::kConfirmed:
            rest_.replay(accel_scale_, true, x_, P_);
            break;
        case RestStart::Event::kContradicted:
            reopen(P_);
            uncertainty_.take(P_);
            return false;
        case RestStart::Event::kNothing:
            if (!rest_.held()) return false;
            hold_still(rest_.pose(), x_, P_);
    }
    uncertainty_.begin(P_);
    steps_.clear();
    return true;
}

/// With the pose's error a and the others' b, jointly normal: b follows by P_ba P_aa^-1 a, and its
/// covariance shrinks as far as that of the pose does.
void Predictor::fuse(const Pose& T, const Mat6& covariance, const ScanSays& scan) {
    using Mat23x6 = Eigen::Matrix<double, 23, 6>;
    const Mat6 prior = this->covariance();
    const Eigen::LLT<Mat6> llt(prior);
    if (llt.info() != Eigen::Success || !covariance.allFinite()) return;
    Mat23x6 cross;
    cross << P_.middleCols<3>(I::kRot), P_.middleCols<3>(I::kPos);
    const Mat23x6 gain = llt.solve(cross.transpose()).transpose();
    Vec6 moved;
    moved << log_so3(x_.rot.transpose() * T.R), T.t - x_.pos;
    Vec23 d = gain * moved;
    d.segment<3>(I::kRot) = moved.head<3>();
    d.segment<3>(I::kPos) = moved.tail<3>();
    const NavState next = state_plus(x_, d);
    const Mat23x23 reduced = P_ - gain * (prior - covariance) * gain.transpose();
    if (!next.is_finite() || !reduced.allFinite()) return;
    x_ = next;
    P_ = 0.5 * (reduced + reduced.transpose());
    steps_.clear();
    Mat6 order;  // position before rotation
    order << Mat3::Zero(), Mat3::Identity(), Mat3::Identity(), Mat3::Zero();
    PoseUncertainty::Match match;
    match.gain.leftCols<6>() =
        gain * (Mat6::Identity() - llt.solve(covariance).transpose()) * order;
    const Mat23x6 spread = gain * covariance;
    match.noise = spread * scan.limited * spread.transpose();
    match.information = order * scan.information * order;
    match.misfit = scan.misfit;
    uncertainty_.update(x_, match);
}

void Predictor::move(const Pose& correction) {
    const Pose moved = correction * x_.T_map_imu();
    x_.rot = moved.R;
    x_.pos = moved.t;
    x_.vel = correction.R * x_.vel;
    x_.gravity = correction.R * x_.gravity;
}

bool Predictor::initialise(const std::vector<ImuSample>& samples) {
    const ImuStart::Progress progress = start_.add(samples);
    if (progress != ImuStart::Progress::kReady) return progress != ImuStart::Progress::kFault;
    const ImuSample& newest = samples.back();
    accel_scale_ = start_.in_g() ? kStandardGravity : 1.0;
    stepper_.start(newest, accel_scale_);
    x_ = NavState{};
    x_.extrinsic_rot = extrinsic_.R;
    x_.extrinsic_pos = extrinsic_.t;
    const std::optional<Mat3> given = orientation();
    x_.rot = levelled(given ? Vec3(given->row(2)) : start_.mean_accel().normalized());
    x_.gravity = Vec3(0.0, 0.0, -config_.imu.gravity);
    const bool still = start_.gyro_spread() < kStillGyro && start_.accel_spread() < kStillAccel &&
                       start_.mean_gyro().norm() < kMostBias;
    if (still) x_.gyro_bias = start_.mean_gyro();
    P_.setZero();
    P_.block<3, 3>(I::kVel, I::kVel).diagonal().setConstant(kStartSpeed * kStartSpeed);
    steps_.clear();
    initialised_ = true;
    return true;
}

std::optional<Mat3> Predictor::orientation() const {
    const ImuSample& s = stepper_.newest();
    if (!config_.use_orientation || !s.has_orientation()) return std::nullopt;
    return rotation_of(s);
}

/// Densities as covariances per step, which enter propagate() as dt^2 Q.
Mat12 Predictor::noise_over(double dt, double scale) const {
    if (const auto measured = rest_.noise(accel_scale_)) return scale * measured->matrix();
    const ImuGraphOptions& n = config_.imu;
    const double per_step = scale / std::max(dt, kShortestStep);
    const auto variance = [per_step](double density) { return density * density * per_step; };
    ProcessNoise q;
    q.gyro = variance(n.gyro_noise);
    q.accel = variance(n.accel_noise);
    q.gyro_bias = variance(n.gyro_bias_walk);
    q.accel_bias = variance(n.accel_bias_walk);
    return q.matrix();
}

void Predictor::advance(const MeasureGroup& group, double noise_scale) {
    const std::vector<ImuStep>& steps = stepper_.cut(group);
    rest_.record(steps);
    const NavState before = x_;
    Mat12 noise = Mat12::Zero();
    const double first = steps.front().offset - steps.front().dt;
    knots_.clear();
    knots_.push_back(motion_knot(std::min(first, kBeforeScan), x_, ImuInput{}));
    for (const ImuStep& s : steps) {
        if (!(s.dt > 0.0)) continue;
        const Mat12 Q = noise_over(s.dt, noise_scale);
        propagate(x_, P_, s, s.dt, Q, true);
        noise += s.dt * s.dt * Q;
        knots_.push_back(motion_knot(s.offset, x_, s));
        steps_.push_back(s);
    }
    if (uncertainty_.begun()) uncertainty_.predict(before, x_, steps, noise);
}

/// The graph's attitude follows gravity and the matched one the map; they may differ by a small
/// tilt. Its velocity comes from the matched positions, so it is in the map's axes as it stands
/// (turning it by the tilt would feed the tilt); gravity is known relative to its own attitude,
/// g_body = R^T g.
void Predictor::correct(const Pose& T_map_imu, const Mat3& R_map_odometry, const GraphState& graph,
                        bool matched) {
    const Mat3 to_body = graph.T_map_imu.R.transpose();
    x_.pos = T_map_imu.t;
    x_.rot = T_map_imu.R;
    x_.vel = R_map_odometry * graph.vel;
    x_.gravity = T_map_imu.R * to_body * Vec3(0.0, 0.0, -config_.imu.gravity);
    x_.gyro_bias = graph.gyro_bias;
    x_.accel_bias = graph.accel_bias;
    correct_covariance(R_map_odometry, graph, matched);
    steps_.clear();
}

/// A match makes the pose the new reference. A pose that was only predicted keeps its error and
/// what that shares with velocity, biases and gravity: the same wrong velocity moves it on. What
/// the graph doubts more than the prediction does is independent of all that, so that the whole
/// stays positive definite.
void Predictor::correct_covariance(const Mat3& R_map_odometry, const GraphState& graph,
                                   bool matched) {
    // Velocity and both biases lie side by side in the graph's error as in ours.
    Mat9 J = Mat9::Identity();
    J.topLeftCorner<3, 3>() = R_map_odometry;
    const Mat9 motion = J * graph.covariance.block<9, 9>(G::kVel, G::kVel) * J.transpose();
    if (!matched) {
        P_.block<9, 9>(I::kVel, I::kVel) = upper_bound(P_.block<9, 9>(I::kVel, I::kVel), motion);
        return;
    }
    P_.setZero();
    P_.block<9, 9>(I::kVel, I::kVel) = motion;
    P_.block<2, 2>(I::kGravity, I::kGravity).diagonal().setConstant(kStartGravity * kStartGravity);
}

Mat6 Predictor::covariance() const {
    Mat6 C;
    C << P_.block<3, 3>(I::kRot, I::kRot), P_.block<3, 3>(I::kRot, I::kPos),
        P_.block<3, 3>(I::kPos, I::kRot), P_.block<3, 3>(I::kPos, I::kPos);
    C.diagonal().array() += kNoWeight;
    return C;
}

}  // namespace d2lio::liosam
