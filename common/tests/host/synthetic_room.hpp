// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "random_state.hpp"

namespace d2lio::test {

/// An empty box-shaped room seen by a spinning LiDAR that sways along a smooth path. The sensor
/// stands still for the first second; stamps begin at one day so that zero is not special.
class SyntheticRoom {
  public:
    explicit SyntheticRoom(unsigned seed = 1, double noise = 0.01) : random_(seed), noise_(noise) {}

    static constexpr Stamp kStart = 86'400'000'000'000;
    static constexpr Stamp kImuPeriod = 5'000'000, kScanPeriod = 100'000'000;
    Vec3 half{5.65, 4.6, 1.35};  ///< half extents, m
    double pipe = 0.0;           ///< radius of a round tunnel along x instead of the walls, m
    int columns = 180, rings = 16;

    static Pose T_imu_lidar() { return {exp_so3(Vec3(0.01, -0.02, 0.03)), Vec3(0.03, 0.05, 0.08)}; }

    /// T_world_imu at `t` seconds after the start.
    static Pose pose(double t) {
        const double s = ramp(t);
        const Vec3 position(1.2 * std::sin(0.5 * s), 0.8 * (1.0 - std::cos(0.5 * s)),
                            0.1 * std::sin(s));
        return {exp_so3(Vec3(0.05 * std::sin(0.9 * s), 0.04 * std::sin(0.7 * s),
                             0.4 * std::sin(0.4 * s))),
                position};
    }

    /// Exact specific force and rate by central differences, plus white noise.
    ImuSample imu(Stamp stamp) {
        const double t = seconds_between(stamp, kStart), h = 1e-3;
        const Pose a = pose(t - h), b = pose(t), c = pose(t + h);
        ImuSample s;
        s.stamp = stamp;
        s.gyro = log_so3(a.R.transpose() * c.R) / (2.0 * h) + 1e-3 * normal3();
        const Vec3 accel = (a.t - 2.0 * b.t + c.t) / (h * h);
        s.accel = b.R.transpose() * (accel + Vec3(0, 0, 9.81)) + 1e-2 * normal3();
        return s;
    }

    /// One sweep; every return is measured from the pose at its own time.
    Scan scan(Stamp stamp) {
        Scan out;
        out.stamp = stamp;
        for (int c = 0; c < columns; ++c) {
            const auto dt = static_cast<std::int32_t>(kScanPeriod * c / columns);
            const Pose T = pose(seconds_between(stamp + dt, kStart)) * T_imu_lidar();
            for (int r = 0; r < rings; ++r) out.points.push_back(cast(T, dt, c, r));
        }
        return out;
    }

  private:
    static double ramp(double t) {
        const double u = std::max(0.0, t - 1.0);
        return u * u / (u + 1.0);  // starts with zero speed, settles at one
    }
    Vec3 normal3() { return {random_.normal(), random_.normal(), random_.normal()}; }

    /// Of a ray from t along w to what surrounds it, m.
    double range(const Vec3& t, const Vec3& w) const {
        double nearest = 1e9;
        for (int a = 0; a < (pipe > 0.0 ? 1 : 3); ++a) {
            const double wall = w[a] > 0 ? half[a] : -half[a];
            if (std::abs(w[a]) > 1e-9) nearest = std::min(nearest, (wall - t[a]) / w[a]);
        }
        if (!(pipe > 0.0)) return nearest;
        const double ww = w.tail<2>().squaredNorm(), tw = t.tail<2>().dot(w.tail<2>());
        const double rest = pipe * pipe - t.tail<2>().squaredNorm();
        return std::min(nearest, (std::sqrt(tw * tw + ww * rest) - tw) / ww);
    }

    LidarPoint cast(const Pose& T, std::int32_t dt, int column, int ring) {
        const double azimuth = 2.0 * 3.14159265358979 * column / columns;
        const double elevation = (ring - 0.5 * (rings - 1)) * 4.0 * 3.14159265358979 / 180.0;
        const Vec3 d(std::cos(elevation) * std::cos(azimuth),
                     std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        const double r = range(T.t, T.R * d) + noise_ * random_.normal();
        LidarPoint p;
        p.x = static_cast<float>(r * d.x());
        p.y = static_cast<float>(r * d.y());
        p.z = static_cast<float>(r * d.z());
        p.dt_ns = dt;
        p.ring = static_cast<std::uint16_t>(ring);
        return p;
    }

    Random random_;
    double noise_;
};

}  // namespace d2lio::test
