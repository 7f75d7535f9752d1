// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "random_state.hpp"

namespace d2lio::bench {

/// Something that stands upright on the ground: a building, a car, a pole.
struct Prism {
    double x, y;            ///< centre, m
    double half_x, half_y;  ///< half extents, m; half_y 0: a round one of radius half_x
    double height;          ///< m

    /// Where a horizontal ray from (ox, oy) along the unit vector (dx, dy) passes over the
    /// footprint, m. False if it does not.
    bool crossed(double ox, double oy, double dx, double dy, double& in, double& out) const {
        const double rx = ox - x, ry = oy - y;
        if (half_y <= 0.0) {
            const double b = rx * dx + ry * dy, c = rx * rx + ry * ry - half_x * half_x;
            const double root = std::sqrt(std::max(0.0, b * b - c));
            in = -b - root;
            out = -b + root;
            return b * b > c && in > 0.0;
        }
        const double x1 = (-half_x - rx) / dx, x2 = (half_x - rx) / dx;
        const double y1 = (-half_y - ry) / dy, y2 = (half_y - ry) / dy;
        in = std::max(std::min(x1, x2), std::min(y1, y2));
        out = std::min(std::max(x1, x2), std::max(y1, y2));
        return in < out && in > 0.0;
    }
};

/// A street along x, seen by a VLP-16 on a vehicle that starts from rest, reaches `speed` and
/// weaves a little: level ground, facades set back by differing amounts, bays, side streets, parked
/// cars, poles. The vehicle stays level, so that all rings of a column lie in one upright plane.
class Street {
  public:
    static constexpr int kRings = 16, kColumns = 1800;
    static constexpr Stamp kStart = 86'400'000'000'000;
    static constexpr Stamp kImuPeriod = 5'000'000, kScanPeriod = 100'000'000;

    explicit Street(double speed, unsigned seed = 1) : random_(seed), speed_(speed) { build(); }

    static Pose T_imu_lidar() { return {Mat3::Identity(), Vec3(0.0, 0.0, 0.1)}; }

    /// T_world_imu after `way` metres along the street.
    static Pose pose_at(double way) {
        const double yaw = 0.06 * std::cos(0.12 * way);
        return {exp_so3(Vec3(0.0, 0.0, yaw)),
                Vec3(way, 0.5 * std::sin(0.12 * way), 1.7 + 0.02 * std::sin(0.5 * way))};
    }
    /// Metres along the street `t` seconds after the start.
    double way(double t) const {
        constexpr double kStill = 0.5, kAccel = 4.0;  // s, m/s^2
        const double u = std::max(0.0, t - kStill), ramp = speed_ / kAccel;
        return u < ramp ? 0.5 * kAccel * u * u : speed_ * (u - 0.5 * ramp);
    }
    Pose pose(double t) const { return pose_at(way(t)); }

    /// Specific force and rate by central differences, plus white noise.
    ImuSample imu(Stamp stamp) {
        const double t = seconds_between(stamp, kStart), h = 1e-3;
        const Pose a = pose(t - h), b = pose(t), c = pose(t + h);
        ImuSample s;
        s.stamp = stamp;
        s.gyro = log_so3(a.R.transpose() * c.R) / (2.0 * h) + 2e-3 * normal3();
        const Vec3 accel = (a.t - 2.0 * b.t + c.t) / (h * h);
        s.accel = b.R.transpose() * (accel + Vec3(0.0, 0.0, 9.80511)) + 2e-2 * normal3();
        return s;
    }

    /// One sweep; every return is measured from the pose at its own time.
    Scan scan(Stamp stamp) {
        return sweep(stamp, [&](Stamp dt) { return pose(seconds_between(stamp + dt, kStart)); });
    }
    /// One sweep of a sensor that stands still after `way` metres: needs no de-skewing.
    Scan snapshot(double way) {
        return sweep(kStart, [&](Stamp) { return pose_at(way); });
    }

  private:
    static constexpr double kPi = 3.14159265358979;
    static constexpr double kRange = 100.0, kNoise = 0.015;  ///< m

    struct Crossing {
        double in, out, height;  ///< m
    };

    void build() {
        constexpr double kBlock = 15.0, kBegin = -150.0, kEnd = 450.0;  // m
        for (double x = kBegin; x < kEnd; x += kBlock) {
            for (const double side : {-1.0, 1.0}) add_block(x, side);
        }
    }

    void add_block(double x, double side) {
        const double facade = random_.uniform(7.5, 11.0), width = random_.uniform(11.0, 14.9);
        const double height = random_.uniform(8.0, 25.0), depth = 6.0;
        things_.push_back({x + 0.5 * width, side * (facade + depth), 0.5 * width, depth, height});
        for (const double share : {0.25, 0.7}) {  // bays
            things_.push_back({x + share * width, side * facade, 1.2, 0.4, height});
        }
        if (random_.uniform(0.0, 1.0) < 0.5) {  // a parked car
            things_.push_back({x + random_.uniform(3.0, 12.0), side * 4.5, 2.2, 0.9, 1.5});
        }
        for (const double along : {1.0, 8.5}) {  // poles and trunks
            things_.push_back({x + along, side * 6.2, random_.uniform(0.08, 0.25), 0.0, 6.0});
        }
    }

    template <typename PoseAt>
    Scan sweep(Stamp stamp, const PoseAt& pose_of) {
        Scan out;
        out.stamp = stamp;
        for (int c = 0; c < kColumns; ++c) {
            const auto dt = static_cast<std::int32_t>(kScanPeriod * c / kColumns);
            const Pose T = pose_of(dt) * T_imu_lidar();
            const double azimuth = 2.0 * kPi * c / kColumns;
            const Vec3 ahead = T.R * Vec3(std::cos(azimuth), std::sin(azimuth), 0.0);
            cross(T.t, ahead);
            for (int r = 0; r < kRings; ++r) add_return(T.t.z(), azimuth, r, dt, out.points);
        }
        return out;
    }

    /// Collects what stands along a horizontal direction.
    void cross(const Vec3& eye, const Vec3& d) {
        crossings_.clear();
        for (const Prism& p : things_) {
            double in = 0.0, out = 0.0;
            if (std::abs(p.x - eye.x()) > kRange + p.half_x) continue;
            if (!p.crossed(eye.x(), eye.y(), d.x(), d.y(), in, out)) continue;
            crossings_.push_back({in, out, p.height});
        }
    }

    void add_return(double eye, double azimuth, int ring, std::int32_t dt,
                    std::vector<LidarPoint>& out) {
        const double elevation = (2.0 * ring - (kRings - 1)) * kPi / 180.0;
        const double slope = std::tan(elevation);
        double level = slope < 0.0 ? -eye / slope : 1e9;  // horizontal distance to the ground
        for (const Crossing& c : crossings_) {
            // The front, or the top where the beam comes down behind the front's upper edge.
            const double top = slope < 0.0 ? (c.height - eye) / slope : 1e9;
            const double hit = eye + slope * c.in <= c.height ? c.in : top;
            if (hit <= c.out) level = std::min(level, hit);
        }
        const double range = level / std::cos(elevation) + kNoise * random_.normal();
        if (!(range < kRange)) return;
        const double flat = range * std::cos(elevation);
        LidarPoint p;
        p.x = static_cast<float>(flat * std::cos(azimuth));
        p.y = static_cast<float>(flat * std::sin(azimuth));
        p.z = static_cast<float>(range * std::sin(elevation));
        p.dt_ns = dt;
        p.ring = static_cast<std::uint16_t>(ring);
        out.push_back(p);
    }

    Vec3 normal3() { return {random_.normal(), random_.normal(), random_.normal()}; }

    test::Random random_;
    double speed_;
    std::vector<Prism> things_;
    std::vector<Crossing> crossings_;
};

}  // namespace d2lio::bench
