// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

/// A box-shaped room, a LiDAR that swings through it, and the odometry and IMU that go with it. All
/// seeded: two runs are the same to the last bit. C++11.
namespace standin {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kScans = 16;
constexpr double kPeriod = 0.1;           ///< s, from scan to scan
constexpr double kImuPeriod = 0.01;       ///< s
constexpr double kGravity = 9.80511;      ///< m/s^2
constexpr double kRangeNoise = 0.005;     ///< m, half width
constexpr double kOdometryNoise = 0.015;  ///< m, half width
constexpr double kTurnNoise = 0.004;      ///< rad, half width

struct Pose {
    Matrix3d R = Matrix3d::Identity();  ///< R_map_body
    Vector3d t = Vector3d::Zero();      ///< m
};

inline Matrix3d rotation(double roll, double pitch, double yaw) {
    using Eigen::AngleAxisd;
    return (AngleAxisd(yaw, Vector3d::UnitZ()) * AngleAxisd(pitch, Vector3d::UnitY()) *
            AngleAxisd(roll, Vector3d::UnitX()))
        .toRotationMatrix();
}

inline Pose truth(double t) {
    Pose pose;
    pose.R = rotation(0.04 * std::sin(1.3 * t), 0.05 * std::sin(t), 0.5 * std::sin(0.6 * t));
    pose.t << 1.5 * std::sin(0.8 * t), std::sin(1.1 * t), 0.2 * std::sin(0.5 * t);
    return pose;
}

class Noise {
  public:
    explicit Noise(unsigned seed) : random_(seed) {}
    /// Uniform in [-half_width, half_width]; no std distribution, whose numbers are not specified.
    double operator()(double half_width) { return half_width * (random_() / 2147483647.5 - 1.0); }
    Vector3d vector(double half_width) {
        const double x = (*this)(half_width), y = (*this)(half_width);
        return {x, y, (*this)(half_width)};
    }

  private:
    std::mt19937 random_;
};

/// Walls, floor and ceiling, m.
inline Vector3d room_max() { return {4.0, 3.0, 1.8}; }
inline Vector3d room_min() { return {-4.0, -3.0, -1.2}; }

/// Distance to the room's hull from inside, m.
inline double cast(const Vector3d& from, const Vector3d& direction) {
    const Vector3d high = room_max(), low = room_min();
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
        if (direction[i] == 0.0) continue;
        const double wall = direction[i] > 0.0 ? high[i] : low[i];
        nearest = std::min(nearest, (wall - from[i]) / direction[i]);
    }
    return nearest;
}

inline Vector3d in_body(const Pose& pose, const Vector3d& p_map) {
    return pose.R.transpose() * (p_map - pose.t);
}

/// Points of one scan, body frame, m.
inline std::vector<Vector3d> scan(const Pose& pose, Noise& noise) {
    constexpr int kRings = 7, kColumns = 36;
    std::vector<Vector3d> points;
    const double first = noise(M_PI / kColumns);
    for (int ring = 0; ring < kRings; ++ring) {
        const double up = (-27.0 + 9.0 * ring) * M_PI / 180.0;
        for (int column = 0; column < kColumns; ++column) {
            const double turn = first + 2.0 * M_PI * column / kColumns;
            const Vector3d ray(std::cos(up) * std::cos(turn), std::cos(up) * std::sin(turn),
                               std::sin(up));
            points.push_back((cast(pose.t, pose.R * ray) + noise(kRangeNoise)) * ray);
        }
    }
    return points;
}

/// Points on the room's upright edges, body frame, m.
inline std::vector<Vector3d> edges(const Pose& pose, Noise& noise) {
    constexpr int kHeights = 20;
    const std::array<double, 2> sides{{-1.0, 1.0}};
    std::vector<Vector3d> points;
    for (double x : sides) {
        for (double y : sides) {
            const double first = noise(0.05);
            for (int k = 0; k < kHeights; ++k) {
                const Vector3d corner(room_max().x() * x, room_max().y() * y,
                                      -1.1 + 0.14 * k + first);
                points.push_back(in_body(pose, corner) + noise.vector(kRangeNoise));
            }
        }
    }
    return points;
}

/// Motion from one scan to the next in the first one's body frame, as a poor odometry sees it.
inline Pose odometry(double from, double to, Noise& noise) {
    const Pose a = truth(from), b = truth(to);
    const Vector3d turn = noise.vector(kTurnNoise);
    Pose step;
    step.R = a.R.transpose() * b.R * rotation(turn.x(), turn.y(), turn.z());
    step.t = a.R.transpose() * (b.t - a.t) + noise.vector(kOdometryNoise);
    return step;
}

/// Specific force (m/s^2) and angular rate (rad/s) in the body frame, by differences of the truth.
inline void imu(double t, Vector3d& force, Vector3d& rate) {
    constexpr double h = 1e-3;
    const Pose before = truth(t - h), here = truth(t), after = truth(t + h);
    const Vector3d acceleration = (after.t - 2.0 * here.t + before.t) / (h * h);
    force = here.R.transpose() * (acceleration + Vector3d(0.0, 0.0, kGravity));
    const Eigen::AngleAxisd turn(Matrix3d(before.R.transpose() * after.R));
    rate = turn.axis() * turn.angle() / (2.0 * h);
}

}  // namespace standin
