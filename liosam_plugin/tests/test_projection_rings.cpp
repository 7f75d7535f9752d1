// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "projection_rings.hpp"
#include "scan_patterns.hpp"

namespace d2lio::liosam {
namespace {

using Points = std::vector<LidarPoint>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr double kDegree = kPi / 180.0;

/// A return 10 m away. @param azimuth,elevation degrees @param ring the true one
LidarPoint at(double azimuth, double elevation, int ring = 0) {
    const double a = azimuth * kDegree, e = elevation * kDegree;
    LidarPoint p;
    p.x = static_cast<float>(10.0 * std::cos(e) * std::cos(a));
    p.y = static_cast<float>(10.0 * std::cos(e) * std::sin(a));
    p.z = static_cast<float>(10.0 * std::sin(e));
    p.ring = static_cast<std::uint16_t>(ring);
    return p;
}

std::vector<std::uint16_t> rings_of(const Points& points) {
    std::vector<std::uint16_t> rings;
    for (const LidarPoint& p : points) rings.push_back(p.ring);
    return rings;
}

Points without_rings(Points points) {
    for (LidarPoint& p : points) p.ring = 0;
    return points;
}

/// Ring by ring from the top, each starting a little after and ending a little before straight
/// ahead, with gaps, as KITTI's clouds do.
Points ring_by_ring(int rings, double sense) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> start(0.0, 20.0), end(340.0, 360.0);
    Points points;
    for (int ring = 0; ring < rings; ++ring) {
        const double last = end(random);
        for (double azimuth = start(random); azimuth < last; azimuth += 0.5) {
            const double gap = ring % 3 == 0 ? 100.0 : 0.0;  // no returns from 90 to 190 degrees
            if (azimuth > 90.0 && azimuth < 90.0 + gap) continue;
            points.push_back(at(sense * azimuth, 2.0 - 0.4 * ring, ring));
        }
    }
    return points;
}

TEST(HasRings, IsFalseWhereAllIndicesAreZero) {
    EXPECT_FALSE(has_rings({}));
    EXPECT_FALSE(has_rings({at(0, 0, 0), at(1, 0, 0)}));
    EXPECT_TRUE(has_rings({at(0, 0, 0), at(1, 0, 3)}));
}

TEST(RingsByTurns, RecoversRingsThatFollowOneAnother) {
    for (const double sense : {1.0, -1.0}) {
        const Points truth = ring_by_ring(64, sense);
        Points points = without_rings(truth);
        EXPECT_EQ(assign_rings_by_turns(points), 64);
        EXPECT_EQ(rings_of(points), rings_of(truth)) << "sense " << sense;
    }
}

TEST(RingsByTurns, NewRingFallsBackByMoreThanHalfATurn) {
    const auto rings = [](double last, double next) {
        Points points;
        for (double azimuth = 1.0; azimuth <= last; azimuth += 1.0)
            points.push_back(at(azimuth, 0));
        for (double azimuth = next; azimuth < 360.0; azimuth += 1.0)
            points.push_back(at(azimuth, 0));
        return assign_rings_by_turns(points);
    };
    EXPECT_EQ(rings(200.0, 19.0), 2);
    EXPECT_EQ(rings(200.0, 21.0), 1);  // 179 degrees: a rotor that swung back, say
    EXPECT_EQ(rings(359.0, 178.0), 2);
    EXPECT_EQ(rings(359.0, 180.0), 1);
}

TEST(RingsByTurns, LeavesOutNonFinitePoints) {
    Points points = without_rings(ring_by_ring(3, 1.0));
    points.insert(points.begin(), at(0, 0));
    points.front().x = kNan;
    points[points.size() / 2].z = kNan;
    EXPECT_EQ(assign_rings_by_turns(points), 3);
    EXPECT_EQ(points.front().ring, kNoRing);
    EXPECT_EQ(points[points.size() / 2].ring, kNoRing);
    EXPECT_EQ(points.back().ring, 2);
}

TEST(RingsByTurns, ColumnOrderedMessageIsOneTurn) {
    Points points = without_rings(scan_of({16, 360}, room({9, 7, 5})));
    EXPECT_LE(assign_rings_by_turns(points), 2);
}

TEST(RingsByTurns, RandomOrderShowsInTooManyRings) {
    Points points = without_rings(ring_by_ring(16, 1.0));
    std::mt19937 random(6);
    std::shuffle(points.begin(), points.end(), random);
    EXPECT_GT(assign_rings_by_turns(points), 100);
}

TEST(RingsByTurns, SmallestScans) {
    Points points;
    EXPECT_EQ(assign_rings_by_turns(points), 0);
    points = {at(30, 0, 9)};
    EXPECT_EQ(assign_rings_by_turns(points), 1);
    EXPECT_EQ(points[0].ring, 0);
    points = Points(20, LidarPoint{});
    EXPECT_EQ(assign_rings_by_turns(points), 1);
}

}  // namespace
}  // namespace d2lio::liosam
