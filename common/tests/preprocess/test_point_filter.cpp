// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>

#include "d2lio/config/params.hpp"
#include "d2lio/preprocess/point_filter.hpp"

namespace d2lio {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

LidarPoint at(float x, float y = 0.F, float z = 0.F, std::int32_t dt_ns = 0) {
    LidarPoint p;
    p.x = x;
    p.y = y;
    p.z = z;
    p.dt_ns = dt_ns;
    return p;
}

std::vector<LidarPoint> one_of_each() {
    return {at(5.F),       at(kNaN),       at(0.F, kInfinity),    at(0.F),
            at(0.F, -.3F), at(0.F, 200.F), at(4.F, 0.F, 0.F, -1), at(0.F, 0.F, -6.F)};
}

TEST(PointFilter, DropsAndCountsEveryReason) {
    PointFilterOptions options;
    options.max_range = 100.0;
    std::vector<LidarPoint> points = one_of_each();
    const FilterCounts counts = PointFilter(options).apply(points);
    ASSERT_EQ(points.size(), 2U);
    EXPECT_EQ(points[0].x, 5.F);
    EXPECT_EQ(points[1].z, -6.F);
    EXPECT_EQ(counts.offered, 8U);
    EXPECT_EQ(counts.not_finite, 2U);
    EXPECT_EQ(counts.zero, 1U);
    EXPECT_EQ(counts.too_near, 1U);
    EXPECT_EQ(counts.too_far, 1U);
    EXPECT_EQ(counts.bad_time, 1U);
    EXPECT_EQ(counts.stride, 0U);
    EXPECT_EQ(counts.kept, 2U);
}

TEST(PointFilter, ZeroReturnsGoEvenWithoutABlindZone) {
    PointFilterOptions options;
    options.blind = 0.0;
    std::vector<LidarPoint> points{at(0.F), at(1e-3F)};
    EXPECT_EQ(PointFilter(options).apply(points).zero, 1U);
    EXPECT_EQ(points.size(), 1U);
}

TEST(PointFilter, RangeIsHalfOpenAtTheBlindEnd) {
    PointFilterOptions options;
    options.blind = 2.0;
    options.max_range = 8.0;
    std::vector<LidarPoint> points{at(2.F), at(2.0001F), at(8.F), at(8.0001F)};
    PointFilter(options).apply(points);
    ASSERT_EQ(points.size(), 2U);
    EXPECT_EQ(points[1].x, 8.F);
}

TEST(PointFilter, StrideCountsOverTheMessage) {
    PointFilterOptions options;
    options.stride = 3;
    std::vector<LidarPoint> points;
    for (int i = 0; i < 10; ++i) points.push_back(at(static_cast<float>(i + 1)));
    points[3].x = kNaN;  // a lost point does not shift the pattern
    const FilterCounts counts = PointFilter(options).apply(points);
    ASSERT_EQ(points.size(), 3U);
    EXPECT_EQ(points[0].x, 1.F);
    EXPECT_EQ(points[1].x, 7.F);
    EXPECT_EQ(points[2].x, 10.F);
    EXPECT_EQ(counts.stride, 6U);
    EXPECT_EQ(counts.not_finite, 1U);
}

TEST(PointFilter, BothFormsAgreeAndCountsAddUp) {
    const std::vector<LidarPoint> in = one_of_each();
    for (const int stride : {1, 2, 3, 7, 8, 9}) {
        PointFilterOptions options;
        options.stride = stride;
        options.max_range = 50.0;
        const PointFilter filter(options);
        std::vector<LidarPoint> out, in_place = in;
        const FilterCounts c = filter.apply(in, out);
        filter.apply(in_place);
        EXPECT_EQ(out.size(), in_place.size());
        EXPECT_EQ(c.kept, out.size());
        EXPECT_EQ(c.stride + c.not_finite + c.zero + c.bad_time + c.too_near + c.too_far + c.kept,
                  c.offered);
    }
}

TEST(PointFilter, SteadyStateKeepsItsMemory) {
    const std::vector<LidarPoint> in(1000, at(3.F));
    std::vector<LidarPoint> out;
    const PointFilter filter;
    filter.apply(in, out);
    const LidarPoint* storage = out.data();
    filter.apply(in, out);
    EXPECT_EQ(out.data(), storage);
}

TEST(PointFilter, EmptyAndAllRejectedScans) {
    std::vector<LidarPoint> none, bad(5, at(kNaN));
    EXPECT_EQ(PointFilter().apply(none).offered, 0U);
    EXPECT_EQ(PointFilter().apply(bad).not_finite, 5U);
    EXPECT_TRUE(bad.empty());
}

TEST(PointFilter, CountsAccumulate) {
    FilterCounts sum;
    std::vector<LidarPoint> first = one_of_each(), second = one_of_each();
    sum += PointFilter().apply(first);
    sum += PointFilter().apply(second);
    EXPECT_EQ(sum.offered, 16U);
    EXPECT_EQ(sum.not_finite, 4U);
    EXPECT_EQ(sum.kept, 6U);
}

TEST(PointFilter, ImpossibleOptionsAreRefusedByName) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const auto refused_key = [](double blind, double max_range, int stride) {
        try {
            PointFilter({blind, max_range, stride});
        } catch (const ConfigError& error) {
            return error.key();
        }
        return std::string("accepted");
    };
    EXPECT_EQ(refused_key(-1.0, 10.0, 1), "lidar.blind");
    EXPECT_EQ(refused_key(nan, 10.0, 1), "lidar.blind");
    EXPECT_EQ(refused_key(1.0, nan, 1), "lidar.max_range");
    EXPECT_EQ(refused_key(5.0, 4.0, 1), "lidar.max_range");
    EXPECT_EQ(refused_key(1.0, 4.0, 0), "lidar.stride");
    EXPECT_EQ(refused_key(1.0, 4.0, 1), "accepted");
}

TEST(RingsLost, AStrideThatDividesTheRingsOfAColumn) {
    std::vector<LidarPoint> points;
    for (int i = 0; i < 16 * 100; ++i) {
        points.push_back(at(3.F));
        points.back().ring = static_cast<std::uint16_t>(i % 16);
    }
    EXPECT_EQ(rings_lost(points, 4).present, 16);
    EXPECT_EQ(rings_lost(points, 4).lost, 12);
    EXPECT_EQ(rings_lost(points, 3).lost, 0);
    EXPECT_EQ(rings_lost(points, 1).lost, 0);
    EXPECT_EQ(rings_lost({}, 4).present, 0);
}

}  // namespace
}  // namespace d2lio
