// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "message_bytes.hpp"

namespace d2lio::ros1 {
namespace {

constexpr double kPi = 3.14159265358979323846;

RawMessage livox(std::uint32_t claimed, int points) {
    ByteWriter out;
    out.header(1'000'000'000).add(std::uint64_t{1}).add(claimed).add(std::uint32_t{0});
    out.add(claimed);
    for (int i = 0; i < points; ++i) {
        out.add(static_cast<std::uint32_t>(1000 * i)).add(1.F).add(2.F).add(static_cast<float>(i));
        out.add(std::uint8_t{200}).add(std::uint8_t{0}).add(static_cast<std::uint8_t>(i % 6));
    }
    return {"livox_ros_driver/CustomMsg", out.bytes()};
}

TEST(Livox, ReadsPointsTimesAndLines) {
    RawScan scan;
    std::string error;
    ASSERT_TRUE(decode_livox(livox(8, 8), scan, error)) << error;
    EXPECT_EQ(scan.stamp, 1'000'000'000);
    ASSERT_EQ(scan.points.size(), 8U);
    EXPECT_EQ(scan.points[7].xyz(), Eigen::Vector3f(1, 2, 7));
    EXPECT_EQ(scan.points[7].ring, 1);
    EXPECT_EQ(scan.points[7].intensity, 200.F);
    EXPECT_EQ(scan.integer_times[7], 7000);
}

TEST(Livox, RefusesFewerBytesThanPoints) {
    RawScan scan;
    std::string error;
    EXPECT_FALSE(decode_livox(livox(0xFFFFFFFF, 3), scan, error));
    EXPECT_NE(error.find("claims 4294967295 points"), std::string::npos) << error;
}

/// One packet, all distances equal, azimuth stepping by 0.2 deg from `azimuth`.
std::vector<std::uint8_t> packet(Stamp stamp, int azimuth, std::uint16_t distance,
                                 std::uint8_t mode, std::uint8_t product) {
    ByteWriter out;
    out.add(static_cast<std::uint32_t>(stamp / 1'000'000'000));
    out.add(static_cast<std::uint32_t>(stamp % 1'000'000'000));
    for (int block = 0; block < 12; ++block) {
        out.add(std::uint16_t{0xEEFF})
            .add(static_cast<std::uint16_t>((azimuth + 20 * block) % 36000));
        for (int c = 0; c < 32; ++c) out.add(distance).add(static_cast<std::uint8_t>(c));
    }
    out.add(std::uint32_t{0}).add(mode).add(product);
    return out.bytes();
}

RawMessage velodyne(const std::vector<std::vector<std::uint8_t>>& packets, Stamp stamp) {
    ByteWriter out;
    out.header(stamp).add(static_cast<std::uint32_t>(packets.size()));
    for (const auto& p : packets) out.append(p);
    return {"velodyne_msgs/VelodyneScan", out.bytes()};
}

TEST(Velodyne, PlacesTheReturnsOfAVlp16) {
    constexpr Stamp kStamp = 3'000'000'000;
    RawScan scan;
    std::string error;
    std::map<std::string, std::size_t> counts;
    const auto message = velodyne({packet(kStamp, 9000, 5000, 0x37, 0x22)}, kStamp);
    ASSERT_TRUE(decode_velodyne(message, "", scan, error, counts)) << error;
    ASSERT_EQ(scan.points.size(), 12U * 32U);
    // First firing: laser 0 looks 15 deg down, at 90 deg clockwise from x, 10 m away.
    const double down = -15.0 * kPi / 180.0;
    EXPECT_NEAR(scan.points[0].x, 0.0, 1e-5);
    EXPECT_NEAR(scan.points[0].y, -10.0 * std::cos(down), 1e-5);
    EXPECT_NEAR(scan.points[0].z, 10.0 * std::sin(down), 1e-5);
    EXPECT_EQ(scan.points[0].ring, 0);
    EXPECT_EQ(scan.points[1].ring, 8);  // 1 deg, above the eight that look down
    EXPECT_EQ(scan.integer_times[1], 2304);
    EXPECT_EQ(scan.integer_times[16], 55'296);
    EXPECT_EQ(scan.integer_times[32], 110'592);
    EXPECT_TRUE(scan.times_in_ns_from_stamp);
    // The second firing of a block stands half a step on.
    const double turned = std::atan2(-scan.points[16].y, scan.points[16].x) * 180.0 / kPi;
    EXPECT_NEAR(turned, 90.0 + 0.2 * 55'296.0 / 110'592.0, 1e-4);
}

TEST(Velodyne, KeepsTheStrongestOfTwoReturns) {
    RawScan scan;
    std::string error;
    std::map<std::string, std::size_t> counts;
    const auto message = velodyne({packet(1, 0, 5000, 0x39, 0x21)}, 1);
    ASSERT_TRUE(decode_velodyne(message, "", scan, error, counts)) << error;
    EXPECT_EQ(scan.points.size(), 6U * 32U);
    EXPECT_EQ(counts["packets_dual_return"], 1U);
}

TEST(Velodyne, DropsPacketsOfAnotherTime) {
    constexpr Stamp kStamp = 10'000'000'000;
    RawScan scan;
    std::string error;
    std::map<std::string, std::size_t> counts;
    const auto message = velodyne(
        {packet(kStamp, 0, 5000, 0x37, 0x22), packet(kStamp + 2'000'000'000, 0, 5000, 0x37, 0x22)},
        kStamp);
    ASSERT_TRUE(decode_velodyne(message, "", scan, error, counts)) << error;
    EXPECT_EQ(scan.points.size(), 12U * 32U);
    EXPECT_EQ(counts["packets_wrong_stamp"], 1U);
}

TEST(Velodyne, AsksForTheModelWhereThePacketsDoNotTell) {
    RawScan scan;
    std::string error;
    std::map<std::string, std::size_t> counts;
    const auto message = velodyne({packet(1, 0, 5000, 0x37, 0x99)}, 1);
    EXPECT_FALSE(decode_velodyne(message, "", scan, error, counts));
    EXPECT_NE(error.find("lidar/model"), std::string::npos) << error;
    EXPECT_TRUE(decode_velodyne(message, "hdl32e", scan, error, counts));
}

TEST(Velodyne, SurvivesEveryTruncation) {
    const auto whole = velodyne({packet(1, 0, 5000, 0x37, 0x22)}, 1);
    for (std::size_t size = 0; size < whole.bytes.size(); ++size) {
        RawMessage cut = whole;
        cut.bytes.resize(size);
        RawScan scan;
        std::string error;
        std::map<std::string, std::size_t> counts;
        EXPECT_FALSE(decode_velodyne(cut, "", scan, error, counts)) << size;
    }
}

RawMessage imu(const Eigen::Vector4d& q, double covariance_0) {
    ByteWriter out;
    out.header(2'000'000'001);
    for (int i = 0; i < 4; ++i) out.add(q[i]);
    for (int i = 0; i < 9; ++i) out.add(i == 0 ? covariance_0 : 0.0);
    for (const double w : {0.1, 0.2, 0.3}) out.add(w);
    for (int i = 0; i < 9; ++i) out.add(0.0);
    for (const double f : {0.0, 0.0, 1.0}) out.add(f);
    for (int i = 0; i < 9; ++i) out.add(0.0);
    return {kImuType, out.bytes()};
}

TEST(Imu, ReadsRatesAndScalesAccelerations) {
    ImuSample sample;
    ASSERT_TRUE(decode_imu(imu({0, 0, 0, 1}, 0.0), 9.80665, true, sample));
    EXPECT_EQ(sample.stamp, 2'000'000'001);
    EXPECT_EQ(sample.gyro, Vec3(0.1, 0.2, 0.3));
    EXPECT_EQ(sample.accel, Vec3(0, 0, 9.80665));
    EXPECT_FALSE(sample.has_orientation());  // the identity is an unfilled field
}

TEST(Imu, HandsOnAnAttitudeOnlyWhereThereIsOne) {
    const Eigen::Vector4d q = Eigen::Vector4d(0.1, 0.2, 0.3, 0.9).normalized();
    ImuSample sample;
    ASSERT_TRUE(decode_imu(imu(1.004 * q, 0.0), 1.0, true, sample));
    EXPECT_NEAR((sample.orientation - q).norm(), 0.0, 1e-12);
    ASSERT_TRUE(decode_imu(imu(q, -1.0), 1.0, true, sample));
    EXPECT_FALSE(sample.has_orientation());
    ASSERT_TRUE(decode_imu(imu(q, 0.0), 1.0, false, sample));
    EXPECT_FALSE(sample.has_orientation());
    ASSERT_TRUE(decode_imu(imu(0.5 * q, 0.0), 1.0, true, sample));
    EXPECT_FALSE(sample.has_orientation());
}

TEST(Imu, RefusesATruncatedMessage) {
    RawMessage message = imu({0, 0, 0, 1}, 0.0);
    message.bytes.pop_back();
    ImuSample sample;
    EXPECT_FALSE(decode_imu(message, 1.0, true, sample));
}

}  // namespace
}  // namespace d2lio::ros1
