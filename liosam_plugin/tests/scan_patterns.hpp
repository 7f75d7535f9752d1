// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "d2lio/types.hpp"
#include "projection.hpp"

namespace d2lio::liosam {

constexpr double kPi = 3.14159265358979323846;

/// Directions of a spinning sensor: every ring at every column, both evenly spaced.
struct SpinningSensor {
    int rings = 16;
    int columns = 1800;
    double lowest = -15.0 * kPi / 180.0;  ///< elevation of ring 0, rad
    double highest = 15.0 * kPi / 180.0;  ///< of the last ring, rad

    double elevation(int ring) const {
        return rings > 1 ? lowest + (highest - lowest) * ring / (rings - 1) : lowest;
    }
    /// Counter-clockwise from +x; column 0 looks backwards.
    double azimuth(int column) const { return 2.0 * kPi * column / columns - kPi; }
    Eigen::Vector3d direction(int ring, int column) const {
        const double flat = std::cos(elevation(ring));
        return {flat * std::cos(azimuth(column)), flat * std::sin(azimuth(column)),
                std::sin(elevation(ring))};
    }
};

/// Range in m along a unit direction; infinite where there is nothing.
using Scene = std::function<double(const Eigen::Vector3d&)>;

/// The plane normal . p = offset, seen from the origin.
inline Scene plane(const Eigen::Vector3d& normal, double offset) {
    return [=](const Eigen::Vector3d& direction) {
        const double range = offset / normal.dot(direction);
        return range > 0.0 ? range : std::numeric_limits<double>::infinity();
    };
}

/// The nearest of several scenes.
inline Scene nearest(std::vector<Scene> scenes) {
    return [scenes = std::move(scenes)](const Eigen::Vector3d& direction) {
        double range = std::numeric_limits<double>::infinity();
        for (const Scene& scene : scenes) range = std::min(range, scene(direction));
        return range;
    };
}

/// A room of half extents `half` (m) around the sensor: four walls, floor and ceiling.
inline Scene room(const Eigen::Vector3d& half) {
    std::vector<Scene> walls;
    for (int a = 0; a < 3; ++a) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(a);
        walls.push_back(plane(axis, half[a]));
        walls.push_back(plane(-axis, half[a]));
    }
    return nearest(std::move(walls));
}

/// One point per direction that hits something, column by column as a spinning sensor sends them.
/// @param sigma standard deviation of the range, m
inline std::vector<LidarPoint> scan_of(const SpinningSensor& sensor, const Scene& scene,
                                       double sigma = 0.0, unsigned seed = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<LidarPoint> points;
    for (int column = 0; column < sensor.columns; ++column) {
        for (int ring = 0; ring < sensor.rings; ++ring) {
            const Eigen::Vector3d direction = sensor.direction(ring, column);
            const double range = scene(direction) + sigma * noise(random);
            if (!std::isfinite(range)) continue;
            const Eigen::Vector3f p = (range * direction).cast<float>();
            LidarPoint point;
            point.x = p.x();
            point.y = p.y();
            point.z = p.z();
            point.ring = static_cast<std::uint16_t>(ring);
            points.push_back(point);
        }
    }
    return points;
}

/// One ring of given ranges (m) at the given columns; points lie level, at azimuth column / 1800.
inline OrderedScan one_ring(const std::vector<float>& ranges,
                            const std::vector<std::int32_t>& columns) {
    const SpinningSensor sensor{1, 1800, 0.0, 0.0};
    OrderedScan scan;
    scan.ranges = ranges;
    scan.columns = columns;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
        scan.points.push_back(
            (static_cast<double>(ranges[i]) * sensor.direction(0, columns[i])).cast<float>());
    }
    scan.ring_begin = {kRingMargin};
    scan.ring_end = {static_cast<std::int32_t>(ranges.size()) - 1 - kRingMargin};
    return scan;
}

/// The same with columns rising one by one from `first_column`.
inline OrderedScan one_ring(const std::vector<float>& ranges, std::int32_t first_column = 600) {
    std::vector<std::int32_t> columns(ranges.size());
    for (std::size_t i = 0; i < columns.size(); ++i) {
        columns[i] = first_column + static_cast<std::int32_t>(i);
    }
    return one_ring(ranges, columns);
}

}  // namespace d2lio::liosam
