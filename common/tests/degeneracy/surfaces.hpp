// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "../geometry/random_state.hpp"
#include "d2lio/degeneracy/patch.hpp"
#include "d2lio/geometry/plane.hpp"

namespace d2lio::test {

constexpr double kMapNoise = 0.02;  ///< m, of a map point along the normal, as patch.hpp assumes

/// Five neighbours, one after the other.
struct Points {
    std::array<float, 15> xyz{};
    void set(int i, const Vec3& p) {
        for (int k = 0; k < 3; ++k) {
            xyz[static_cast<std::size_t>(3 * i + k)] = static_cast<float>(p[k]);
        }
    }
    Vec3 at(int i) const {
        return Eigen::Map<const Eigen::Vector3f>(xyz.data() + 3 * i).cast<double>();
    }
    Plane plane(PlaneMoments* moments = nullptr) const {
        Plane out;
        PlaneFitOptions options;
        options.max_distance = 10.F;
        options.min_spread_ratio = 0.0;
        fit_plane(xyz.data(), 3, 5, options, out, moments);
        return out;
    }
    PlaneMoments moments() const {
        PlaneMoments out;
        plane(&out);
        return out;
    }
    Patch patch(const Eigen::Vector3f& normal, const Vec3& sensor = Vec3::Zero()) const {
        Patch out;
        const SurfaceSide side = side_of(normal, (sensor - at(0)).cast<float>());
        make_patch(xyz.data(), 3, 5, moments(), normal, side, out);
        return out;
    }
    Patch patch() const { return patch(plane().normal); }
};

/// In-plane places of five neighbours, m.
using Places = std::array<Eigen::Vector2d, 5>;

/// The corners of a square and its centre: its scatter is a multiple of the identity.
inline Places square(double half) {
    return {Eigen::Vector2d(-half, -half), Eigen::Vector2d(half, -half),
            Eigen::Vector2d(half, half), Eigen::Vector2d(-half, half), Eigen::Vector2d(0.0, 0.0)};
}

inline Places random_places(Random& random, double half) {
    Places out;
    for (auto& y : out) y = {random.uniform(-half, half), random.uniform(-half, half)};
    return out;
}

/// A surface through `origin`: tangents u, v, and n = u x v, along which it rises by
/// (bend_u a^2 + bend_v b^2) / 2 at the place (a, b).
struct Surface {
    Vec3 origin, u, v;
    double bend_u = 0.0, bend_v = 0.0;  ///< 1/m
    Vec3 normal() const { return u.cross(v); }
    Vec3 at(const Eigen::Vector2d& y) const {
        const double rise = 0.5 * (bend_u * y.x() * y.x() + bend_v * y.y() * y.y());
        return origin + y.x() * u + y.y() * v + rise * normal();
    }
    Points sample(const Places& places, Random& random, double noise) const {
        Points out;
        for (std::size_t i = 0; i < 5; ++i) {
            out.set(static_cast<int>(i), at(places[i]) + noise * random.normal() * normal());
        }
        return out;
    }
};

/// A flat patch 5 m away, turned at random.
inline Surface random_plane(Random& random) {
    const Mat3 R = random.rotation();
    return {5.0 * R.col(2) + R * random.vec3(0.5), R.col(0), R.col(1)};
}

}  // namespace d2lio::test
