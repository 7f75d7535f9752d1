// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/host/rest_place.hpp"

namespace d2lio {
namespace {

constexpr float kMillimetre = 1e-3F;

/// A scan that sees nothing along x.
ScanDiagnostics blind_along_x() {
    ScanDiagnostics d;
    d.v_t = Mat3::Identity();
    d.noise_share = Vec3(0.9, 0.02, 0.01);
    return d;
}

RestPlace place() { return {{exp_so3(Vec3(0.1, 0.2, 0.3)), Vec3(1.0, 2.0, 3.0)}}; }

Pose moved(const Vec3& by, const Vec3& turn = Vec3::Zero()) {
    return {place().pose.R * exp_so3(turn), place().pose.t + by};
}

TEST(RestPlace, IsLeftOnlyWhereTheScanCanSee) {
    const ScanDiagnostics scan = blind_along_x();
    EXPECT_FALSE(place().left(moved(Vec3::Zero()), scan));
    EXPECT_FALSE(place().left(moved(Vec3(3.0, 0.0, 0.0)), scan));
    EXPECT_FALSE(place().left(moved(Vec3(0.0, -0.049, 0.0)), scan));
    EXPECT_TRUE(place().left(moved(Vec3(0.0, -0.051, 0.0)), scan));
    EXPECT_TRUE(place().left(moved(Vec3(3.0, 0.0, 0.051)), scan));
}

TEST(RestPlace, ATurnLeavesIt) {
    const ScanDiagnostics scan = blind_along_x();
    EXPECT_FALSE(place().left(moved(Vec3::Zero(), Vec3(0.0, 0.0, 0.009)), scan));
    EXPECT_TRUE(place().left(moved(Vec3::Zero(), Vec3(0.0, 0.0, -0.011)), scan));
}

TEST(RestPlace, AScanThatSaysNothingSeesNoMotion) {
    EXPECT_FALSE(place().left(moved(Vec3(1.0, 1.0, 1.0)), ScanDiagnostics{}));
}

TEST(RestCloud, IsTheMeanOfUpToFiftyScans) {
    RestCloud cloud;
    cloud.start({{0.2F, 0.2F, 0.1F}});
    for (int i = 0; i < 49; ++i) {
        EXPECT_TRUE(cloud.add({{0.2F, 0.2F, i % 2 == 0 ? 0.3F : 0.1F}})) << i;
    }
    EXPECT_FALSE(cloud.add({{0.2F, 0.2F, 0.9F}}));
    const auto mean = cloud.mean(0.5);
    ASSERT_EQ(mean.size(), 1U);
    EXPECT_NEAR(mean[0].z(), 0.2F, kMillimetre);
}

TEST(RestCloud, KeepsVoxelsApartAndBeginsAnew) {
    RestCloud cloud;
    cloud.start({{0.2F, 0.2F, 0.1F}, {5.2F, 0.2F, 0.1F}});
    EXPECT_EQ(cloud.mean(0.5).size(), 2U);
    cloud.finish();
    EXPECT_FALSE(cloud.add({{0.2F, 0.2F, 0.1F}}));
    EXPECT_TRUE(cloud.mean(0.5).empty());
    cloud.start({{1.2F, 0.2F, 0.1F}});
    EXPECT_TRUE(cloud.add({{1.2F, 0.2F, 0.1F}}));
    EXPECT_EQ(cloud.mean(0.5).size(), 1U);
}

}  // namespace
}  // namespace d2lio
