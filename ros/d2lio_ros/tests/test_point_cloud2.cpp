// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>

#include "message_bytes.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::uint8_t kUint8 = 2, kUint16 = 4, kUint32 = 6, kFloat32 = 7, kFloat64 = 8;

TestCloud velodyne_like() {
    TestCloud c;
    c.fields = {{"x", 0, kFloat32},          {"y", 4, kFloat32},    {"z", 8, kFloat32},
                {"intensity", 12, kFloat32}, {"ring", 16, kUint16}, {"time", 18, kFloat32}};
    c.point_step = 22;
    c.width = 3;
    c.row_step = 66;
    ByteWriter data;
    for (int i = 0; i < 3; ++i) {
        const auto v = static_cast<float>(i);
        data.add(v).add(v + 10.F).add(v + 20.F).add(v + 30.F);
        data.add(static_cast<std::uint16_t>(i + 5)).add(0.01F * v);
    }
    c.data = data.bytes();
    return c;
}

TEST(PointCloud2, ReadsVelodyneFields) {
    RawScan scan;
    std::string error;
    ASSERT_TRUE(decode_point_cloud2(velodyne_like().message(), "", scan, error)) << error;
    EXPECT_EQ(scan.stamp, 5'000'000'006);
    ASSERT_EQ(scan.points.size(), 3U);
    EXPECT_EQ(scan.points[2].xyz(), Eigen::Vector3f(2, 12, 22));
    EXPECT_EQ(scan.points[2].intensity, 32.F);
    EXPECT_EQ(scan.points[2].ring, 7);
    ASSERT_EQ(scan.real_times.size(), 3U);
    EXPECT_EQ(scan.real_times[2], static_cast<double>(0.01F * 2.F));
    EXPECT_TRUE(scan.integer_times.empty());
}

TEST(PointCloud2, ReadsOusterFieldsInPaddedRows) {
    TestCloud c;
    c.fields = {{"x", 0, kFloat32},
                {"y", 4, kFloat32},
                {"z", 8, kFloat32},
                {"t", 16, kUint32},
                {"reflectivity", 20, kUint16},
                {"ring", 22, kUint8}};
    c.point_step = 24;
    c.height = 2;
    c.width = 2;
    c.row_step = 2 * 24 + 8;
    ByteWriter data;
    for (std::uint32_t row = 0; row < 2; ++row) {
        for (std::uint32_t column = 0; column < 2; ++column) {
            const auto n = static_cast<float>(2 * row + column);
            data.add(n).add(n).add(n).add(0.F).add(4'000'000'000U + 2 * row + column);
            data.add(static_cast<std::uint16_t>(9)).add(static_cast<std::uint8_t>(row)).add('\0');
        }
        data.add(std::uint64_t{0});
    }
    c.data = data.bytes();
    RawScan scan;
    std::string error;
    ASSERT_TRUE(decode_point_cloud2(c.message(), "", scan, error)) << error;
    ASSERT_EQ(scan.integer_times.size(), 4U);
    EXPECT_EQ(scan.integer_times[3], 4'000'000'003);  // beyond int32: exact
    EXPECT_EQ(scan.points[3].x, 3.F);
    EXPECT_EQ(scan.points[3].ring, 1);
    EXPECT_EQ(scan.points[3].intensity, 9.F);
}

TEST(PointCloud2, ReadsBigEndianDoubles) {
    TestCloud c;
    c.fields = {{"x", 0, kFloat64}, {"y", 8, kFloat64}, {"z", 16, kFloat64}};
    c.point_step = 24;
    c.width = 1;
    c.big_endian = 1;
    for (const double v : {1.5, -2.5, 3.25}) {
        const std::vector<std::uint8_t> little = ByteWriter().add(v).bytes();
        c.data.insert(c.data.end(), little.rbegin(), little.rend());
    }
    RawScan scan;
    std::string error;
    ASSERT_TRUE(decode_point_cloud2(c.message(), "", scan, error)) << error;  // row_step 0
    EXPECT_EQ(scan.points[0].xyz(), Eigen::Vector3f(1.5F, -2.5F, 3.25F));
    EXPECT_TRUE(scan.real_times.empty());
}

TEST(PointCloud2, NamesTheFieldThatIsMissing) {
    RawScan scan;
    std::string error;
    TestCloud c = velodyne_like();
    EXPECT_FALSE(decode_point_cloud2(c.message(), "stamp", scan, error));
    EXPECT_NE(error.find("no time field 'stamp'; it holds x, y, z"), std::string::npos) << error;
    c.fields[1].name = "why";
    EXPECT_FALSE(decode_point_cloud2(c.message(), "", scan, error));
    EXPECT_NE(error.find("no field y"), std::string::npos) << error;
}

TEST(PointCloud2, RefusesSizesThatContradictEachOther) {
    RawScan scan;
    std::string error;
    TestCloud c = velodyne_like();
    c.width = 4;
    c.row_step = 88;
    EXPECT_FALSE(decode_point_cloud2(c.message(), "", scan, error));
    EXPECT_NE(error.find("claims 1 x 4 points"), std::string::npos) << error;
    c = velodyne_like();
    c.fields[5].offset = 20;
    EXPECT_FALSE(decode_point_cloud2(c.message(), "", scan, error));
    EXPECT_NE(error.find("'time' reaches beyond"), std::string::npos) << error;
    c = velodyne_like();
    c.height = c.width = 0xFFFFFFFF;
    c.row_step = 0;
    EXPECT_FALSE(decode_point_cloud2(c.message(), "", scan, error));
}

TEST(PointCloud2, SurvivesEveryTruncationAndRandomBytes) {
    const RawMessage whole = velodyne_like().message();
    std::mt19937 random(1);
    std::string error;
    for (std::size_t size = 0; size < whole.bytes.size(); ++size) {
        RawMessage cut = whole;
        cut.bytes.resize(size);
        RawScan scan;
        EXPECT_FALSE(decode_point_cloud2(cut, "", scan, error)) << size;
    }
    for (int round = 0; round < 2000; ++round) {
        RawMessage damaged = whole;
        for (int i = 0; i < 4; ++i) {
            damaged.bytes[random() % damaged.bytes.size()] = static_cast<std::uint8_t>(random());
        }
        RawScan scan;
        decode_point_cloud2(damaged, "", scan, error);
        EXPECT_LE(scan.points.size(), whole.bytes.size());
    }
}

}  // namespace
}  // namespace d2lio::ros1
