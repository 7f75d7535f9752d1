// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "d2lio/diagnostics/scan_diagnostics.hpp"

namespace d2lio {
namespace {

TEST(ScanDiagnostics, ColumnsAreUniqueAndInAFixedOrder) {
    const auto a = ScanDiagnostics{}.columns();
    ScanDiagnostics other;
    other.counts.accepted = 7;
    const auto b = other.columns();
    ASSERT_EQ(a.size(), b.size());
    std::set<std::string> names;
    for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].first, b[i].first);
        names.insert(a[i].first);
    }
    EXPECT_EQ(names.size(), a.size());
}

TEST(ScanDiagnostics, CarriesTheValues) {
    ScanDiagnostics d;
    d.counts.accepted = 7;
    d.lambda_t = Vec3(10, 390, 450);
    d.v_t = Mat3::Identity();
    d.converged = true;
    d.noise_share = Vec3(0.9, 0.1, 0.01);
    d.blind = 1;
    d.cleaned = 42;
    std::map<std::string, double> m;
    for (const auto& [k, v] : d.columns()) m[k] = v;
    EXPECT_EQ(m.at("accepted"), 7.0);
    EXPECT_EQ(m.at("lambda_t_1"), 10.0);
    EXPECT_EQ(m.at("lambda_t_3"), 450.0);
    EXPECT_EQ(m.at("v_t_1_x"), 1.0);
    EXPECT_EQ(m.at("converged"), 1.0);
    EXPECT_EQ(m.at("noise_share_1"), 0.9);
    EXPECT_EQ(m.at("noise_share_3"), 0.01);
    EXPECT_EQ(m.at("blind"), 1.0);
    EXPECT_EQ(m.at("cleaned"), 42.0);
    EXPECT_TRUE(std::isnan(m.at("sigma")));
    EXPECT_TRUE(std::isnan(ScanDiagnostics{}.noise_share[0]));
}

TEST(ScanDiagnostics, HealthNames) {
    EXPECT_STREQ(to_string(Health::kInit), "INIT");
    EXPECT_STREQ(to_string(Health::kOk), "OK");
    EXPECT_STREQ(to_string(Health::kDegenerate), "DEGENERATE");
    EXPECT_STREQ(to_string(Health::kLost), "LOST");
}

}  // namespace
}  // namespace d2lio
