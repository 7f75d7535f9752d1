// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "d2lio/config/params.hpp"
#include "projection.hpp"
#include "scan_patterns.hpp"

namespace d2lio::liosam {
namespace {

using Points = std::vector<LidarPoint>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();

LidarPoint point(float x, float y, float z, int ring = 0) {
    LidarPoint p;
    p.x = x;
    p.y = y;
    p.z = z;
    p.ring = static_cast<std::uint16_t>(ring);
    return p;
}

/// A point of ring `ring` in the middle of column `column`, 10 m away and level.
LidarPoint in_cell(int ring, int column, int columns = 1800, double range = 10.0) {
    const SpinningSensor sensor{1, columns, 0.0, 0.0};
    const Eigen::Vector3f p = (range * sensor.direction(0, column)).cast<float>();
    return point(p.x(), p.y(), p.z(), ring);
}

ProjectionCounts project(const ProjectionOptions& options, const Points& points, OrderedScan& out) {
    return Projection(options).project(points, points, out);
}

std::size_t total(const ProjectionCounts& c) {
    return c.unpaired + c.not_finite + c.too_near + c.too_far + c.no_ring + c.ring_step +
           c.no_column + c.duplicate + c.kept;
}

/// LIO-SAM's rule: the angle from +y towards +x in degrees, less 90, in steps, subtracted from the
/// middle column and wrapped once.
double column_before_rounding(double x, double y, int columns) {
    const double from_y = std::atan2(x, y) * 180.0 / kPi;
    return -(from_y - 90.0) * columns / 360.0 + columns / 2;
}

TEST(AzimuthColumn, EqualsTheUpstreamFormula) {
    constexpr double kTie = 1e-3;  // columns: nearer to a half, float and double may differ
    std::mt19937 random(1);
    std::uniform_real_distribution<float> u(-50.F, 50.F);
    for (const int columns : {360, 512, 1024, 1800, 2048, 4000}) {
        for (int i = 0; i < 20000; ++i) {
            const float x = u(random), y = u(random);
            const double exact = column_before_rounding(x, y, columns);
            if (std::abs(exact - std::floor(exact) - 0.5) < kTie) continue;
            const int expected = static_cast<int>(std::lround(exact)) % columns;
            ASSERT_EQ(azimuth_column(x, y, columns), expected) << x << " " << y << " " << columns;
        }
    }
}

TEST(AzimuthColumn, StartsBehindAndRisesCounterClockwise) {
    EXPECT_EQ(azimuth_column(1.F, 0.F, 1800), 900);
    EXPECT_EQ(azimuth_column(0.F, 1.F, 1800), 1350);
    EXPECT_EQ(azimuth_column(0.F, -1.F, 1800), 450);
    EXPECT_EQ(azimuth_column(-1.F, -0.01F, 1800), 3);
    EXPECT_EQ(azimuth_column(-1.F, 0.01F, 1800), 1797);
}

TEST(AzimuthColumn, StaysInsideAtTheSeamForAnyNumberOfColumns) {
    for (int columns = 1; columns <= 40; ++columns) {
        for (const float y : {0.F, -0.F, 1e-30F, -1e-30F, 1e-3F, -1e-3F}) {
            const int column = azimuth_column(-1.F, y, columns);
            EXPECT_GE(column, 0) << columns;
            EXPECT_LT(column, columns);
        }
    }
    EXPECT_EQ(azimuth_column(-1.F, 0.F, 1800), 0);
    EXPECT_EQ(azimuth_column(-1.F, -0.F, 1800), 0);
    EXPECT_EQ(azimuth_column(0.F, 0.F, 1800), 900);
}

TEST(Projection, SortsAColumnOrderedScanIntoRows) {
    const SpinningSensor sensor{4, 360};
    const Points points = scan_of(sensor, room({9, 7, 5}));
    OrderedScan out;
    const ProjectionCounts counts = project({4, 360}, points, out);
    ASSERT_EQ(counts.kept, 4U * 360U);
    for (int ring = 0; ring < 4; ++ring) {
        for (int column = 0; column < 360; ++column) {
            const auto at = static_cast<std::size_t>(ring * 360 + column);
            const LidarPoint& source = points[static_cast<std::size_t>(column * 4 + ring)];
            ASSERT_EQ(out.points[at], source.xyz());
            ASSERT_FLOAT_EQ(out.ranges[at], source.xyz().norm());
            ASSERT_EQ(out.columns[at], column);
        }
    }
    EXPECT_EQ(out.ring_begin, (std::vector<std::int32_t>{5, 365, 725, 1085}));
    EXPECT_EQ(out.ring_end, (std::vector<std::int32_t>{354, 714, 1074, 1434}));
}

TEST(Projection, MarginsLeaveFiveNeighboursOfTheSameRing) {
    Points points;
    const std::vector<int> lengths{0, 1, 10, 11, 12};
    for (int ring = 0; ring < 5; ++ring) {
        for (int c = 0; c < lengths[static_cast<std::size_t>(ring)]; ++c) {
            points.push_back(in_cell(ring, 100 + c));
        }
    }
    OrderedScan out;
    project({5, 1800}, points, out);
    ASSERT_EQ(out.points.size(), 34U);
    std::vector<int> usable;
    for (std::size_t r = 0; r < 5; ++r) usable.push_back(out.ring_end[r] - out.ring_begin[r] + 1);
    EXPECT_EQ(usable, (std::vector<int>{-10, -9, 0, 1, 2}));
    EXPECT_EQ(out.ring_begin[3], 11 + kRingMargin);  // after 0 + 1 + 10 points
}

TEST(Projection, CellAndRangeComeFromRawCoordinatesFromDeskewed) {
    const Points raw{in_cell(0, 7)}, deskewed{point(1.F, 2.F, 3.F)};
    OrderedScan out;
    Projection({1, 1800}).project(raw, deskewed, out);
    ASSERT_EQ(out.points.size(), 1U);
    EXPECT_EQ(out.points[0], Eigen::Vector3f(1.F, 2.F, 3.F));
    EXPECT_FLOAT_EQ(out.ranges[0], 10.F);
    EXPECT_EQ(out.columns[0], 7);
}

TEST(Projection, FirstPointOfACellWins) {
    OrderedScan out;
    const auto counts = project({1, 1800}, {in_cell(0, 7, 1800, 20.0), in_cell(0, 7)}, out);
    EXPECT_EQ(counts.duplicate, 1U);
    ASSERT_EQ(counts.kept, 1U);
    EXPECT_FLOAT_EQ(out.ranges[0], 20.F);
}

TEST(Projection, CountsEveryReasonOnce) {
    ProjectionOptions options;
    options.rings = 4;
    options.ring_step = 2;
    options.max_range = 100.0;
    const Points raw{in_cell(0, 1),
                     in_cell(0, 1),
                     point(kNan, 1, 1),
                     point(5, kInfF, 1),
                     point(0, 0, 0),
                     point(0.5F, 0, 0),
                     in_cell(0, 2, 1800, 101),
                     in_cell(4, 3),
                     in_cell(65535, 3),
                     in_cell(1, 3),
                     in_cell(2, 3),
                     in_cell(0, 4)};
    Points deskewed = raw;
    deskewed[10].z = kNan;
    deskewed.pop_back();
    OrderedScan out;
    const ProjectionCounts counts = Projection(options).project(raw, deskewed, out);
    EXPECT_EQ(counts.offered, 12U);
    EXPECT_EQ(counts.unpaired, 1U);
    EXPECT_EQ(counts.not_finite, 3U);
    EXPECT_EQ(counts.too_near, 2U);
    EXPECT_EQ(counts.too_far, 1U);
    EXPECT_EQ(counts.no_ring, 2U);
    EXPECT_EQ(counts.ring_step, 1U);
    EXPECT_EQ(counts.duplicate, 1U);
    EXPECT_EQ(counts.kept, 1U);
    EXPECT_EQ(total(counts), counts.offered);
}

TEST(Projection, RangeLimitsThemselvesAreKept) {
    ProjectionOptions options{1, 1800, 1, 1.0, 100.0};
    OrderedScan out;
    EXPECT_EQ(project(options, {point(1, 0, 0), point(0, 100, 0)}, out).kept, 2U);
    options.min_range = 0.0;
    EXPECT_EQ(project(options, {point(0, 0, 0)}, out).too_near, 1U);
}

TEST(Projection, RingStepLeavesRowsEmpty) {
    const Points points = scan_of({6, 360}, room({9, 7, 5}));
    OrderedScan out;
    EXPECT_EQ(project({6, 360, 2}, points, out).kept, 3U * 360U);
    ASSERT_EQ(out.ring_begin.size(), 6U);
    for (std::size_t r = 0; r < 6; ++r) {
        EXPECT_EQ(out.ring_begin[r] <= out.ring_end[r], r % 2 == 0) << r;
    }
}

TEST(Projection, ColumnsByOrderCountUpPerRingUntilFull) {
    ProjectionOptions options{2, 3};
    options.column_by_order = true;
    const Points points{in_cell(1, 9), in_cell(0, 9), in_cell(1, 5), point(0, 0, 0, 1),
                        in_cell(1, 9), in_cell(0, 1), in_cell(1, 2), in_cell(1, 3)};
    OrderedScan out;
    const ProjectionCounts counts = project(options, points, out);
    EXPECT_EQ(counts.kept, 5U);
    EXPECT_EQ(counts.no_column, 2U);
    EXPECT_EQ(counts.duplicate, 0U);
    EXPECT_EQ(out.columns, (std::vector<std::int32_t>{0, 1, 0, 1, 2}));
    EXPECT_EQ(out.points[3], points[2].xyz());
    Projection reused(options);
    for (int scan = 0; scan < 2; ++scan) {
        EXPECT_EQ(reused.project(points, points, out).kept, 5U) << "scan " << scan;
    }
}

TEST(Projection, EmptyScanHasEmptyRings) {
    OrderedScan out;
    out.points.resize(3);
    EXPECT_EQ(project({3, 1800}, {}, out).offered, 0U);
    EXPECT_TRUE(out.points.empty());
    ASSERT_EQ(out.ring_begin.size(), 3U);
    for (std::size_t r = 0; r < 3; ++r) EXPECT_GT(out.ring_begin[r], out.ring_end[r]);
}

TEST(Projection, HoldsALargeSensor) {
    const SpinningSensor sensor{128, 2048};
    OrderedScan out;
    EXPECT_EQ(project({128, 2048}, scan_of(sensor, room({9, 7, 5})), out).kept, 128U * 2048U);
}

TEST(Projection, ReusedObjectForgetsTheLastScanAndKeepsItsBuffers) {
    const SpinningSensor sensor{8, 360};
    const Points large = scan_of(sensor, room({9, 7, 5}));
    const Points small(large.begin(), large.begin() + 100);
    Projection projection({8, 360});
    OrderedScan reused, fresh;
    projection.project(large, large, reused);
    const void* buffer = reused.points.data();
    projection.project(small, small, reused);
    project({8, 360}, small, fresh);
    EXPECT_EQ(reused.points, fresh.points);
    EXPECT_EQ(reused.ring_end, fresh.ring_end);
    projection.project(large, large, reused);
    EXPECT_EQ(reused.points.data(), buffer);
}

TEST(Projection, AnyInputGivesRisingColumnsInsideTheImage) {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> u(-30.F, 30.F);
    const std::vector<float> odd{0.F, -0.F, kNan, kInfF, -kInfF, 1e30F, 1e-40F, 3.4e38F};
    const auto value = [&] { return random() % 8 == 0 ? odd[random() % odd.size()] : u(random); };
    for (int round = 0; round < 200; ++round) {
        ProjectionOptions options;
        options.rings = 1 + static_cast<int>(random() % 20);
        options.columns = 1 + static_cast<int>(random() % 100);
        options.column_by_order = random() % 2 == 0;
        Points points;
        for (std::size_t n = random() % 500; n > 0; --n) {
            const int ring = static_cast<int>(random() % 24);
            points.push_back(point(value(), value(), value(), ring));
        }
        OrderedScan out;
        const ProjectionCounts counts = project(options, points, out);
        ASSERT_EQ(total(counts), points.size());
        ASSERT_EQ(out.points.size(), counts.kept);
        ASSERT_EQ(out.ring_end.back(), static_cast<int>(counts.kept) - 1 - kRingMargin);
        for (std::size_t r = 0; r < out.ring_begin.size(); ++r) {
            const auto first = static_cast<std::size_t>(out.ring_begin[r] - kRingMargin);
            const auto past = static_cast<std::size_t>(out.ring_end[r] + kRingMargin + 1);
            for (std::size_t i = first; i < past; ++i) {
                ASSERT_GE(out.columns[i], i > first ? out.columns[i - 1] + 1 : 0);
                ASSERT_LT(out.columns[i], options.columns);
                ASSERT_GE(out.ranges[i], options.min_range);
            }
        }
    }
}

TEST(Projection, RefusesWhatIsNoRangeImage) {
    const auto refused = [](auto change, const std::string& key) {
        ProjectionOptions options;
        change(options);
        try {
            Projection projection(options, "lidar.");
        } catch (const ConfigError& error) {
            return error.key() == key;
        }
        return false;
    };
    using Options = ProjectionOptions;
    EXPECT_TRUE(refused([](Options& o) { o.rings = 0; }, "lidar.rings"));
    EXPECT_TRUE(refused([](Options& o) { o.rings = 1025; }, "lidar.rings"));
    EXPECT_TRUE(refused([](Options& o) { o.columns = 0; }, "lidar.columns"));
    EXPECT_TRUE(refused([](Options& o) { o.columns = 32769; }, "lidar.columns"));
    EXPECT_TRUE(refused([](Options& o) { o.ring_step = 0; }, "lidar.ring_step"));
    EXPECT_TRUE(refused([](Options& o) { o.ring_step = 17; }, "lidar.ring_step"));
    EXPECT_TRUE(refused([](Options& o) { o.min_range = -1.0; }, "lidar.min_range"));
    EXPECT_TRUE(refused([](Options& o) { o.min_range = kNan; }, "lidar.min_range"));
    EXPECT_TRUE(refused([](Options& o) { o.max_range = 1.0; }, "lidar.max_range"));
    EXPECT_TRUE(refused([](Options& o) { o.max_range = kInfF; }, "lidar.max_range"));
}

}  // namespace
}  // namespace d2lio::liosam
