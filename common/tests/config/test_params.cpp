// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>

#include "d2lio/config/params.hpp"

namespace d2lio {
namespace {

enum class Colour { kRed, kGreen };

struct Fields {
    double tau = 2.0;
    int count = 3;
    bool on = false;
    Colour colour = Colour::kRed;
    std::array<double, 3> t{1, 2, 3};
    ParamTable table() {
        ParamTable p;
        p.add("a.tau", tau, {0.0, 10.0}, "m", "threshold");
        p.add("a.count", count, {1, 8}, "", "count");
        p.add("a.on", on, "switch");
        p.add("a.colour", colour, {"red", "green"}, "colour");
        p.add("a.t", t.data(), t.size(), {}, "m", "translation");
        return p;
    }
};

/// The error must name the key, the value and what is allowed.
void expect_refused(const std::string& key, const std::string& value, const std::string& allowed) {
    Fields f;
    auto p = f.table();
    try {
        p.set(key, value);
        FAIL() << key << "=" << value << " was accepted";
    } catch (const ConfigError& e) {
        EXPECT_EQ(e.key(), key);
        EXPECT_EQ(e.value(), value);
        EXPECT_NE(e.allowed().find(allowed), std::string::npos) << e.allowed();
        EXPECT_NE(std::string(e.what()).find(key), std::string::npos);
    }
}

TEST(Params, SetsEveryType) {
    Fields f;
    auto p = f.table();
    p.set("a.tau", " 0.5 ");
    p.set("a.count", "8");
    p.set("a.on", "True");
    p.set("a.colour", "green");
    p.set("a.t", "[0.1, -2, 3e-1]");
    EXPECT_EQ(f.tau, 0.5);
    EXPECT_EQ(f.count, 8);
    EXPECT_TRUE(f.on);
    EXPECT_EQ(f.colour, Colour::kGreen);
    EXPECT_EQ(f.t, (std::array<double, 3>{0.1, -2.0, 0.3}));
    EXPECT_EQ(p.get("a.t"), "[0.1, -2, 0.3]");
}

TEST(Params, RefusesNaN) { expect_refused("a.tau", "nan", "[0, 10]"); }
TEST(Params, RefusesInfinityInClosedRange) { expect_refused("a.tau", "inf", "[0, 10]"); }
TEST(Params, RefusesNegative) { expect_refused("a.tau", "-1", "[0, 10]"); }
TEST(Params, RefusesTooLarge) { expect_refused("a.tau", "10.5", "[0, 10]"); }
TEST(Params, RefusesTrailingText) { expect_refused("a.tau", "2m", "[0, 10]"); }
TEST(Params, RefusesEmpty) { expect_refused("a.tau", "", "[0, 10]"); }
TEST(Params, RefusesFraction) { expect_refused("a.count", "2.5", "whole number"); }
TEST(Params, RefusesBadBool) { expect_refused("a.on", "yes please", "true or false"); }
TEST(Params, RefusesUnknownChoice) { expect_refused("a.colour", "blue", "red, green"); }
TEST(Params, RefusesShortList) { expect_refused("a.t", "[1, 2]", "3 numbers"); }
TEST(Params, RefusesUnknownKeyAndListsKnown) { expect_refused("a.taus", "1", "a.tau"); }

TEST(Params, ABadListChangesNothing) {
    Fields f;
    auto p = f.table();
    EXPECT_THROW(p.set("a.t", "[9, 9, x]"), ConfigError);
    EXPECT_EQ(f.t, (std::array<double, 3>{1, 2, 3}));
}

TEST(Params, DescribesDefaults) {
    Fields f;
    const auto info = f.table().describe();
    ASSERT_EQ(info.size(), 5U);
    EXPECT_EQ(info[0].key, "a.tau");
    EXPECT_EQ(info[0].default_value, "2");
    EXPECT_EQ(info[0].range, "[0, 10]");
    EXPECT_EQ(info[0].unit, "m");
    EXPECT_EQ(info[3].default_value, "red");
}

}  // namespace
}  // namespace d2lio
