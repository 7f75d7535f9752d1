// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/imu/rest.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

constexpr std::size_t kRecentBlocks = 5;  ///< scans whose motion may go unseen for the moment
constexpr double kSigmas = 5.5;
constexpr double kMinSamples = 20.0;
constexpr double kMaxSamples = 4000.0;  ///< older ones fade: a bias walks
constexpr double kMostGyro = 0.02;      ///< rad/s, standard deviation of a sample at rest
constexpr double kMostAccel = 0.015;    ///< of gravity

constexpr double kMotionFactor = 4.0;  ///< noise in motion by that at rest (variances)
/// (Bias walk by white noise)^2, 1/s^2: 0.001 to 0.04 for gyroscopes, 0.006 to 0.08 for
/// accelerometers from tactical to consumer grade.
constexpr double kWalkShare = 0.05;
/// What readings without noise (a simulator's, a quantised sensor's) are taken to have.
constexpr double kLeastGyro = 3e-4;   ///< rad/s
constexpr double kLeastAccel = 5e-4;  ///< of gravity

double freedom(double count, double blocks) { return std::max(count - blocks, 1.0); }

}  // namespace

RestDetector::Block RestDetector::block_of(const std::vector<ImuSample>& samples) {
    Block block;
    const auto reading = [](const ImuSample& s) {
        Vec6d v;
        v << s.gyro, s.accel;
        return v;
    };
    for (const ImuSample& s : samples) block.sum += reading(s);
    block.count = static_cast<double>(samples.size());
    const Vec6d mean = block.sum / block.count;
    for (const ImuSample& s : samples) block.squares += (reading(s) - mean).cwiseAbs2();
    return block;
}

void RestDetector::merge(const Block& block) {
    past_.count += block.count;
    past_.sum += block.sum;
    past_.squares += block.squares;
    past_blocks_ += 1.0;
    if (past_.count <= kMaxSamples) return;
    const double keep = kMaxSamples / past_.count;
    past_.count *= keep;
    past_.sum *= keep;
    past_.squares *= keep;
    past_blocks_ *= keep;
}

bool RestDetector::moves() const {
    const Vec6d mean = past_.sum / past_.count;
    Vec6d least;
    least << Vec3::Constant(kLeastGyro * kLeastGyro), Vec3::Constant(least_accel());
    const Vec6d variance = (past_.squares / freedom(past_.count, past_blocks_)).cwiseMax(least);
    double count = 0.0;
    Vec6d sum = Vec6d::Zero();
    for (auto it = recent_.rbegin(); it != recent_.rend(); ++it) {
        count += it->count;
        sum += it->sum;
        const Vec6d off = (sum / count - mean).cwiseAbs2();
        const double spread = kSigmas * kSigmas * (1.0 / count + 1.0 / past_.count);
        for (int i = 0; i < 6; ++i) {
            if (!(off[i] <= spread * variance[i])) return true;
        }
    }
    return false;
}

void RestDetector::add(const std::vector<ImuSample>& samples) {
    if (!resting_ || samples.empty()) return;
    recent_.push_back(block_of(samples));
    if (recent_.size() > kRecentBlocks) {
        merge(recent_.front());
        recent_.pop_front();
    }
    if (past_.count >= kMinSamples && (moves() || shakes())) resting_ = false;
}

/// Squared mean reading of the accelerometer, readings' unit.
double RestDetector::gravity_squared() const {
    return past_.sum.tail<3>().squaredNorm() / (past_.count * past_.count);
}

double RestDetector::least_accel() const { return kLeastAccel * kLeastAccel * gravity_squared(); }

bool RestDetector::shakes() const {
    return gyro_variance() > kMostGyro * kMostGyro ||
           accel_variance() > kMostAccel * kMostAccel * gravity_squared();
}

bool RestDetector::knows_noise() const {
    return past_.count >= kMinSamples && past_.count >= 2.0 * past_blocks_;
}

double RestDetector::gyro_variance() const {
    return past_.squares.head<3>().mean() / freedom(past_.count, past_blocks_);
}

double RestDetector::accel_variance() const {
    return past_.squares.tail<3>().mean() / freedom(past_.count, past_blocks_);
}

ProcessNoise RestDetector::noise(double accel_scale) const {
    const double gyro = std::max(gyro_variance(), kLeastGyro * kLeastGyro);
    const double accel = std::max(accel_variance(), least_accel()) * accel_scale * accel_scale;
    ProcessNoise out;
    out.gyro = kMotionFactor * gyro;
    out.accel = kMotionFactor * accel;
    out.gyro_bias = kWalkShare * gyro;
    out.accel_bias = kWalkShare * accel;
    return out;
}

}  // namespace d2lio
