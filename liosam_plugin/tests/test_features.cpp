// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "d2lio/config/params.hpp"
#include "features.hpp"
#include "scan_patterns.hpp"

namespace d2lio::liosam {
namespace {

using Ranges = std::vector<float>;
using Indices = std::set<std::size_t>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();
constexpr float kTinyLeaf = 1e-3F;  // m: every point keeps its own voxel
// A single point this much farther than its ring: curvature 1.5625 m^2, 1.25 % of 10 m; exact in
// float, so that equal neighbourhoods have equal curvature.
constexpr float kSpike = 0.125F;  // m

/// Sector borders suppress; most rings here shall have none.
FeatureOptions one_sector() {
    FeatureOptions options;
    options.sectors = 1;
    return options;
}

Features extract(const OrderedScan& scan, const FeatureOptions& options = one_sector()) {
    Features out;
    FeatureExtractor(options).extract(scan, out);
    return out;
}

Features extract(const SpinningSensor& sensor, const Scene& scene, double sigma = 0.0) {
    const std::vector<LidarPoint> raw = scan_of(sensor, scene, sigma);
    OrderedScan scan;
    Projection({sensor.rings, sensor.columns}).project(raw, raw, scan);
    return extract(scan, FeatureOptions());
}

/// Which points of the scan became corners.
Indices corners(const OrderedScan& scan, const FeatureOptions& options = one_sector()) {
    Indices found;
    for (const Eigen::Vector3f& corner : extract(scan, options).corners) {
        const auto at = std::find(scan.points.begin(), scan.points.end(), corner);
        found.insert(static_cast<std::size_t>(at - scan.points.begin()));
    }
    return found;
}

/// `count` points at 10 m, some of them farther by their height (m).
Ranges level_with(std::size_t count, const std::vector<std::pair<std::size_t, float>>& spikes) {
    Ranges ranges(count, 10.F);
    for (const auto& [i, height] : spikes) ranges[i] += height;
    return ranges;
}

TEST(Features, TwoWallsMeetInCornersOnTheEdgeOnly) {
    constexpr float kOnEdge = 1e-3F;  // m: the edges lie at 45 degrees, which is a column
    const Features features = extract(SpinningSensor{}, room({10, 10, 8}));
    EXPECT_EQ(features.corners.size(), 4U * 16U);
    for (const Eigen::Vector3f& p : features.corners) {
        EXPECT_NEAR(std::abs(p.x()), 10.F, kOnEdge);
        EXPECT_NEAR(std::abs(p.y()), 10.F, kOnEdge);
    }
}

TEST(Features, PlanesGiveSurfacesAndNoCorners) {
    constexpr float kOnPlane = 1e-4F;  // m: float coordinates and their means
    const Features features =
        extract(SpinningSensor{16, 1800, -0.26, -0.03}, plane(-Eigen::Vector3d::UnitZ(), 1.5));
    EXPECT_TRUE(features.corners.empty());
    EXPECT_GT(features.surfaces.size(), 1000U);
    for (const Eigen::Vector3f& p : features.surfaces) EXPECT_NEAR(p.z(), -1.5F, kOnPlane);
}

TEST(Features, RangeNoiseOnAWallMakesNoCorners) {
    const Features features = extract(SpinningSensor{}, plane(Eigen::Vector3d::UnitX(), 8.0), 0.02);
    EXPECT_EQ(features.corners.size(), 0U);
    EXPECT_GT(features.surfaces.size(), 100U);
}

TEST(Features, OnlyTheNearSideOfAnOcclusionIsAnEdge) {
    Ranges ranges(200, 8.F);
    std::fill(ranges.begin() + 90, ranges.begin() + 111, 5.F);  // an object before a wall
    EXPECT_EQ(corners(one_ring(ranges)), (Indices{90, 110}));
    std::fill(ranges.begin() + 90, ranges.begin() + 111, 11.F);  // a door in the wall
    EXPECT_EQ(corners(one_ring(ranges)), (Indices{89, 111}));
}

TEST(Features, StepBelowTheOcclusionStepHidesNothing) {
    Ranges ranges(200, 8.F);
    std::fill(ranges.begin() + 100, ranges.end(), 8.25F);
    const Indices found = corners(one_ring(ranges));  // both sides are as sharp; one takes all
    EXPECT_EQ(found, (Indices{100}));
}

TEST(Features, WideGapsHideAndSuppressNothing) {
    const auto with_gap = [](std::int32_t gap) {
        std::vector<std::int32_t> columns(200);
        for (std::int32_t i = 0; i < 200; ++i) {
            columns[static_cast<std::size_t>(i)] = i < 100 ? i : i - 1 + gap;
        }
        Ranges ranges(200, 5.F);
        std::fill(ranges.begin() + 100, ranges.end(), 8.F);
        return corners(one_ring(ranges, columns));
    };
    EXPECT_EQ(with_gap(9), (Indices{99}));        // far side hidden
    EXPECT_EQ(with_gap(10), (Indices{100}));      // not hidden, but the later of two suppresses
    EXPECT_EQ(with_gap(11), (Indices{99, 100}));  // two objects
}

TEST(Features, GrazingBeamIsNoEdge) {
    const auto spike = [](float height) { return one_ring(level_with(100, {{50, height}})); };
    EXPECT_EQ(corners(spike(0.19F)), (Indices{50}));  // 1.9 % of 10 m
    EXPECT_EQ(corners(spike(0.21F)), Indices{});
    EXPECT_EQ(corners(spike(-0.21F)), Indices{});
    FeatureOptions options = one_sector();
    options.parallel_ratio = 0.03F;
    EXPECT_EQ(corners(spike(0.21F), options), (Indices{50}));
}

TEST(Features, StepToOneSideIsNoGrazingBeam) {
    Ranges ranges(200, 10.F);
    std::fill(ranges.begin() + 100, ranges.end(), 10.25F);
    EXPECT_EQ(corners(one_ring(ranges)).size(), 1U);
}

TEST(Features, CornersNeedMoreThanTheThreshold) {
    const OrderedScan scan = one_ring(level_with(100, {{50, kSpike}}));
    FeatureOptions options = one_sector();
    options.edge_threshold = 1.5625F;  // its curvature exactly
    EXPECT_EQ(corners(scan, options), Indices{});
    options.edge_threshold = 1.5624F;
    EXPECT_EQ(corners(scan, options), (Indices{50}));
}

TEST(Features, SectorsKeepTheirSharpestCornersUpToTheLimit) {
    // 6 sectors of 300 usable points with 25 spikes each, rising in height within a sector.
    Ranges ranges(1810, 10.F);
    for (std::size_t s = 0; s < 150; ++s) {
        ranges[5 + 12 * s + 6] += 0.125F + 0.002F * static_cast<float>(s % 25);
    }
    const OrderedScan scan = one_ring(ranges, 0);
    FeatureOptions options;
    EXPECT_EQ(corners(scan, options).size(), 6U * 20U);
    options.corners_per_sector = 2;
    Indices sharpest;
    for (std::size_t s = 0; s < 150; ++s) {
        if (s % 25 >= 23) sharpest.insert(5 + 12 * s + 6);
    }
    EXPECT_EQ(corners(scan, options), sharpest);
    options.corners_per_sector = 0;
    EXPECT_EQ(corners(scan, options), Indices{});
    options.corners_per_sector = 20;
    options.sectors = 1;
    EXPECT_EQ(corners(scan, options).size(), 20U);
}

TEST(Features, CornerSuppressesFiveNeighboursToEachSide) {
    FeatureOptions options = one_sector();
    const auto found = [&](std::size_t a, std::size_t b) {
        const auto sharper = one_ring(level_with(100, {{a, 0.19F}, {b, 0.15F}}));
        return corners(sharper, options);
    };
    EXPECT_EQ(found(50, 55), (Indices{50}));
    EXPECT_EQ(found(55, 50), (Indices{55}));
    EXPECT_EQ(found(50, 56), (Indices{50, 56}));
    EXPECT_EQ(found(56, 50), (Indices{50, 56}));
}

TEST(Features, EqualCurvatureIsDecidedByIndex) {
    FeatureOptions options = one_sector();
    options.corners_per_sector = 2;
    const auto scan = one_ring(level_with(100, {{20, kSpike}, {40, kSpike}, {60, kSpike}}));
    EXPECT_EQ(corners(scan, options), (Indices{40, 60}));
}

TEST(Features, SmoothPointsSuppressAcrossTheSectorBorder) {
    // Usable points 5..64, sectors of ten. In the first one the smooth picks are 5 and 11, which
    // reach up to 16.
    const auto found = [](std::size_t i) {
        return corners(one_ring(level_with(70, {{i, kSpike}})), FeatureOptions());
    };
    EXPECT_EQ(found(15), Indices{});
    EXPECT_EQ(found(16), Indices{});
    EXPECT_EQ(found(17), (Indices{17}));
}

TEST(Features, SmoothPointsNeedLessThanTheThreshold) {
    FeatureOptions options;
    options.surface_threshold = kSpike * kSpike;  // curvature of the spike's neighbours exactly
    const OrderedScan scan = one_ring(level_with(70, {{16, kSpike}}));
    EXPECT_EQ(corners(scan, options), (Indices{16}));
    options.surface_threshold = 1.01F * kSpike * kSpike;
    EXPECT_EQ(corners(scan, options), Indices{});
}

TEST(Features, FirstAndLastFivePointsOfARingAreNoFeatures) {
    FeatureOptions options = one_sector();
    options.surface_leaf = kTinyLeaf;
    for (const std::size_t i : {0U, 4U, 95U, 99U}) {
        EXPECT_EQ(corners(one_ring(level_with(100, {{i, kSpike}})), options), Indices{}) << i;
    }
    EXPECT_EQ(corners(one_ring(level_with(100, {{5, kSpike}})), options), (Indices{5}));
    EXPECT_EQ(extract(one_ring(level_with(100, {})), options).surfaces.size(), 90U);
}

TEST(Features, SurfacesAreAllUsablePointsButTheCorners) {
    FeatureOptions options = one_sector();
    options.surface_leaf = kTinyLeaf;
    Ranges ranges(200, 8.F);
    std::fill(ranges.begin() + 90, ranges.begin() + 111, 5.F);
    const OrderedScan scan = one_ring(ranges);
    const Features features = extract(scan, options);
    ASSERT_EQ(features.surfaces.size(), 190U - 2U);
    for (const Eigen::Vector3f& p : features.surfaces) {
        EXPECT_NE(std::find(scan.points.begin(), scan.points.end(), p), scan.points.end());
        EXPECT_TRUE(p != features.corners[0] && p != features.corners[1]);
    }
}

TEST(Features, SurfacesAreDownSampledRingByRing) {
    OrderedScan one = one_ring(Ranges(50, 1.F)), two = one;
    two.points.insert(two.points.end(), one.points.begin(), one.points.end());
    two.ranges.resize(100, 1.F);
    two.columns.insert(two.columns.end(), one.columns.begin(), one.columns.end());
    two.ring_begin = {5, 55};
    two.ring_end = {44, 94};
    const std::size_t of_one = extract(one).surfaces.size();
    EXPECT_LT(of_one, 5U);
    EXPECT_EQ(extract(two).surfaces.size(), 2 * of_one);
}

TEST(Features, NeighbouringRingsDoNotMix) {
    // 5 m and 30 m: across the border curvature would be huge on both sides.
    OrderedScan scan = one_ring(Ranges(40, 5.F));
    const OrderedScan far = one_ring(Ranges(40, 30.F));
    scan.points.insert(scan.points.end(), far.points.begin(), far.points.end());
    scan.ranges.resize(80, 30.F);
    scan.columns.insert(scan.columns.end(), far.columns.begin(), far.columns.end());
    scan.ring_begin = {5, 45};
    scan.ring_end = {34, 74};
    EXPECT_TRUE(extract(scan).corners.empty());
}

TEST(Features, TinyRingsAreNoFault) {
    for (std::size_t count = 1; count <= 40; ++count) {
        FeatureOptions options = one_sector();
        options.surface_leaf = kTinyLeaf;
        const Features features = extract(one_ring(Ranges(count, 10.F)), options);
        EXPECT_EQ(features.surfaces.size(), count > 10 ? count - 10 : 0U) << count;
    }
    EXPECT_TRUE(extract(OrderedScan{}).surfaces.empty());
}

TEST(Features, AllPointsEqualAreOneSurfacePoint) {
    OrderedScan scan = one_ring(Ranges(100, 10.F), std::vector<std::int32_t>(100, 700));
    const Features features = extract(scan);
    EXPECT_TRUE(features.corners.empty());
    EXPECT_EQ(features.surfaces.size(), 1U);
}

TEST(Features, NonFiniteValuesBecomeNoFeature) {
    OrderedScan scan = one_ring(level_with(200, {{50, kSpike}, {100, kSpike}, {150, kSpike}}));
    scan.points[50].x() = kNan;
    scan.ranges[100] = kInfF;
    scan.ranges[80] = kNan;
    scan.points[120].setConstant(-kInfF);
    const Features features = extract(scan);
    ASSERT_EQ(features.corners.size(), 1U);
    EXPECT_EQ(features.corners[0], scan.points[150]);
    for (const Eigen::Vector3f& p : features.surfaces) EXPECT_TRUE(p.allFinite());
}

TEST(Features, ContradictingScanHasNoFeatures) {
    const OrderedScan good = one_ring(level_with(100, {{50, kSpike}}));
    ASSERT_EQ(extract(good).corners.size(), 1U);
    const auto none = [&](auto spoil) {
        OrderedScan bad = good;
        spoil(bad);
        const Features features = extract(bad);
        return features.corners.empty() && features.surfaces.empty();
    };
    EXPECT_TRUE(none([](OrderedScan& s) { s.ranges.pop_back(); }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.columns.pop_back(); }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.ring_end.clear(); }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.ring_begin[0] = 4; }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.ring_begin[0] = -2000000000; }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.ring_end[0] = 95; }));
    EXPECT_TRUE(none([](OrderedScan& s) { s.ring_end[0] = 2147483647; }));
}

TEST(Features, ReusedObjectForgetsTheLastScanAndKeepsItsBuffers) {
    const std::vector<LidarPoint> raw = scan_of(SpinningSensor{}, room({10, 10, 8}), 0.01);
    OrderedScan large;
    Projection({16, 1800}).project(raw, raw, large);
    FeatureExtractor extractor(one_sector());
    Features first, again, small;
    extractor.extract(large, first);
    extractor.extract(one_ring(level_with(100, {{50, 5.F}})), small);  // grazing
    EXPECT_EQ(small.corners.size(), 0U);
    extractor.extract(one_ring(level_with(100, {{50, kSpike}})), small);
    EXPECT_EQ(small.corners.size(), 1U);
    again = first;
    const void* buffer = again.surfaces.data();
    extractor.extract(large, again);
    EXPECT_EQ(again.corners, first.corners);
    EXPECT_EQ(again.surfaces, first.surfaces);
    EXPECT_EQ(again.surfaces.data(), buffer);
}

TEST(Features, RefusesWhatIsNoThreshold) {
    const auto refused = [](auto change, const std::string& key) {
        FeatureOptions options;
        change(options);
        try {
            FeatureExtractor extractor(options, "features.");
        } catch (const ConfigError& error) {
            return error.key() == "features." + key;
        }
        return false;
    };
    using Options = FeatureOptions;
    EXPECT_TRUE(refused([](Options& o) { o.edge_threshold = 0.F; }, "edge_threshold"));
    EXPECT_TRUE(refused([](Options& o) { o.surface_threshold = kNan; }, "surface_threshold"));
    EXPECT_TRUE(refused([](Options& o) { o.surface_leaf = -1.F; }, "surface_leaf"));
    EXPECT_TRUE(refused([](Options& o) { o.occlusion_step = kInfF; }, "occlusion_step"));
    EXPECT_TRUE(refused([](Options& o) { o.parallel_ratio = 0.F; }, "parallel_ratio"));
    EXPECT_TRUE(refused([](Options& o) { o.sectors = 0; }, "sectors"));
    EXPECT_TRUE(refused([](Options& o) { o.corners_per_sector = -1; }, "corners_per_sector"));
    EXPECT_TRUE(refused([](Options& o) { o.occlusion_columns = 0; }, "occlusion_columns"));
    EXPECT_TRUE(refused([](Options& o) { o.gap_columns = 0; }, "gap_columns"));
}

}  // namespace
}  // namespace d2lio::liosam
