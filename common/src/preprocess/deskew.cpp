// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/deskew.hpp"

#include <algorithm>
#include <cmath>

#include "d2lio/geometry/so3.hpp"

namespace d2lio {
namespace {

/// T_endlidar_lidar(t) for a time within one interval, with everything constant taken out.
class Interval {
  public:
    Interval(const MotionKnot& head, const MotionKnot& tail, const Pose& end, const Pose& extrinsic)
        : offset_(head.offset), gyro_(tail.gyro), rate_(tail.gyro.norm()) {
        const Mat3 to_end = end.R.transpose();
        const Mat3 E = extrinsic.R.transpose();
        left_ = E * to_end * head.rot;
        right_ = extrinsic.R;
        lever_ = extrinsic.t;
        shift_ = E * (to_end * (head.pos - end.t) - extrinsic.t);
        velocity_ = E * to_end * head.vel;
        half_accel_ = 0.5 * (E * to_end * tail.accel);
        if (rate_ > 0.0) {
            K_ = hat(gyro_ / rate_);
            K2_ = K_ * K_;
        }
    }

    Vec3 operator()(const Vec3& p, double t) const {
        const double dt = t - offset_;
        const Vec3 in_imu = right_ * p + lever_;
        const double angle = rate_ * dt;
        const Vec3 turned =
            in_imu + std::sin(angle) * (K_ * in_imu) + (1.0 - std::cos(angle)) * (K2_ * in_imu);
        return left_ * turned + shift_ + velocity_ * dt + half_accel_ * (dt * dt);
    }

  private:
    double offset_;
    Vec3 gyro_;
    double rate_;
    Mat3 left_, right_, K_ = Mat3::Zero(), K2_ = Mat3::Zero();
    Vec3 lever_, shift_, velocity_, half_accel_;
};

}  // namespace

void deskew(std::vector<LidarPoint>& points, const std::vector<MotionKnot>& knots, const Pose& end,
            const Pose& extrinsic) {
    if (knots.size() < 2) return;
    std::vector<Interval> intervals;
    std::vector<double> ends;  // upper bound of each interval but the last
    for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
        intervals.emplace_back(knots[i], knots[i + 1], end, extrinsic);
        ends.push_back(knots[i + 1].offset);
    }
    std::size_t k = 0;  // points mostly come in order of time: begin where the last one was
    for (LidarPoint& p : points) {
        const double t = p.dt_ns * kNanosecond;
        if (!(t > knots.front().offset)) continue;
        while (k > 0 && t <= ends[k - 1]) --k;
        while (k + 1 < intervals.size() && t > ends[k]) ++k;
        const Vec3 q = intervals[k](p.xyz().cast<double>(), t);
        p.x = static_cast<float>(q.x());
        p.y = static_cast<float>(q.y());
        p.z = static_cast<float>(q.z());
    }
}

}  // namespace d2lio
