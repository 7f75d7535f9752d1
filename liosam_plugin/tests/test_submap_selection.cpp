// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>

#include "random_state.hpp"
#include "submap_selection.hpp"

namespace d2lio::liosam {
namespace {

using Indices = std::vector<std::uint32_t>;
using Keys = std::vector<KeyPosition>;

constexpr Stamp kSecond = 1'000'000'000;
constexpr Stamp kMuchLater = 3600 * kSecond;

Keys keys_at(const std::vector<Vec3>& positions) {
    Keys keys;
    for (const Vec3& p : positions) {
        const auto index = static_cast<std::uint32_t>(keys.size());
        keys.push_back({index, index * kSecond, p});
    }
    return keys;
}

Indices select(const Keys& keys, const Vec3& centre, Stamp now, const SubmapOptions& options = {}) {
    return SubmapSelector(options).select(keys, centre, now);
}

TEST(SubmapSelection, NothingOfNothing) { EXPECT_TRUE(select({}, Vec3::Zero(), 0).empty()); }

TEST(SubmapSelection, RadiusIsInclusive) {
    const Keys keys = keys_at({{50.0, 0, 0}, {-50.001, 0, 0}, {0, 30.0, 40.0}, {0, 31.0, 40.0}});
    EXPECT_EQ(select(keys, Vec3::Zero(), kMuchLater), (Indices{0, 2}));
}

TEST(SubmapSelection, OneKeyframePerCellTheNearestToTheirCentroid) {
    // Cell [0, 2) has its centroid at 1.1; the last one is alone in cell [2, 4).
    const Keys keys = keys_at({{0.1, 0, 0}, {1.3, 0, 0}, {1.9, 0, 0}, {2.1, 0, 0}});
    EXPECT_EQ(select(keys, Vec3::Zero(), kMuchLater), (Indices{1, 3}));
}

TEST(SubmapSelection, CentroidOfAnotherCellDoesNotDecide) {
    // Of cell [0, 2) the centroid is 1.0 along y; keyframe 2 of the next cell is nearer to it.
    const Keys keys = keys_at({{1.9, 0.0, 0}, {1.9, 1.99, 0}, {2.1, 1.0, 0}});
    EXPECT_EQ(select(keys, Vec3::Zero(), kMuchLater), (Indices{0, 2}));
}

TEST(SubmapSelection, OlderOfTwoEquallyFarWins) {
    for (const double x : {0.1, 0.3, 1e5 + 0.7}) {  // whatever the rounding of their centroid
        const Keys keys = keys_at({{x, 0.2, 0.4}, {x + 1.0, 1.1, 1.2}});
        EXPECT_EQ(select(keys, keys[1].position, kMuchLater), (Indices{0})) << x;
    }
}

TEST(SubmapSelection, DensityIsTheCellSide) {
    const Keys keys = keys_at({{0.1, 0, 0}, {1.3, 0, 0}, {1.9, 0, 0}, {2.1, 0, 0}});
    SubmapOptions options;
    options.density = 0.5;
    EXPECT_EQ(select(keys, Vec3::Zero(), kMuchLater, options), (Indices{0, 1, 2, 3}));
    options.density = 10.0;
    EXPECT_EQ(select(keys, Vec3::Zero(), kMuchLater, options), (Indices{1}));
}

TEST(SubmapSelection, RecentOnesAllCountOnce) {
    // One cell, stamps 0, 1, ... 5 s: at 12 s those younger than 10 s are 3, 4 and 5.
    const Keys keys = keys_at({6, Vec3(0.5, 0.5, 0.5)});
    EXPECT_EQ(select(keys, keys[0].position, 12 * kSecond), (Indices{0, 3, 4, 5}));
    EXPECT_EQ(select(keys, keys[0].position, 12 * kSecond + 1), (Indices{0, 3, 4, 5}));
    EXPECT_EQ(select(keys, keys[0].position, 5 * kSecond), (Indices{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(select(keys, keys[0].position, 15 * kSecond), (Indices{0}));
}

TEST(SubmapSelection, RecentOnesBeyondTheRadiusAreLeftOut) {
    const Keys keys = keys_at({{0, 0, 0}, {40, 0, 0}, {80, 0, 0}});
    EXPECT_EQ(select(keys, keys[2].position, 3 * kSecond), (Indices{1, 2}));
}

TEST(SubmapSelection, RecentOnesEndAtTheFirstThatIsNot) {
    Keys keys = keys_at({4, Vec3(0.5, 0.5, 0.5)});
    keys[2].stamp = -100 * kSecond;
    EXPECT_EQ(select(keys, keys[0].position, 4 * kSecond), (Indices{0, 3}));
}

TEST(SubmapSelection, StampsOfTheFutureAreNotRecent) {
    Keys keys = keys_at({5, Vec3(0.5, 0.5, 0.5)});
    for (KeyPosition& key : keys) key.stamp += kMuchLater;
    EXPECT_EQ(select(keys, keys[0].position, 0), (Indices{0}));
}

TEST(SubmapSelection, CellsStayWhereTheyAreAsTheCentreMoves) {
    test::Random random(3);
    std::vector<Vec3> positions;
    for (int i = 0; i < 200; ++i) positions.push_back(random.vec3(10.0));
    const Keys keys = keys_at(positions);
    const Indices still = select(keys, Vec3::Zero(), kMuchLater);
    for (int i = 0; i < 20; ++i) {
        EXPECT_EQ(select(keys, random.vec3(15.0), kMuchLater), still);
    }
}

TEST(SubmapSelection, HugeCoordinatesSelectAlike) {
    test::Random random(4);
    std::vector<Vec3> near, far;
    const Vec3 offset(1e8, -1e6, 1e7);  // multiples of the density
    for (int i = 0; i < 300; ++i) {
        near.push_back((random.vec3(60.0).array() * 1024.0).round() / 1024.0);  // exact when moved
        far.push_back(near.back() + offset);
    }
    EXPECT_EQ(select(keys_at(far), offset, 305 * kSecond),
              select(keys_at(near), Vec3::Zero(), 305 * kSecond));
}

/// By cells in an ordered map, from the rules alone.
Indices reference(const Keys& keys, const Vec3& centre, Stamp now, const SubmapOptions& o) {
    std::map<std::array<double, 3>, Keys> cells;
    std::set<std::uint32_t> chosen;
    bool recent = true;
    for (std::size_t i = keys.size(); i-- > 0;) {
        const KeyPosition& k = keys[i];
        recent = recent && now - k.stamp < static_cast<Stamp>(o.recent_s) * kSecond;
        if ((k.position - centre).norm() > o.search_radius) continue;
        if (recent) chosen.insert(k.index);
        const Vec3 cell = (k.position / o.density).array().floor();
        Keys& members = cells[{cell.x(), cell.y(), cell.z()}];
        members.insert(members.begin(), k);
    }
    for (const auto& [cell, members] : cells) {
        Vec3 sum = Vec3::Zero();
        for (const KeyPosition& k : members) sum += k.position;
        std::map<double, std::uint32_t> by_distance;  // emplace keeps the older of two equals
        for (const KeyPosition& k : members) {
            const double d = (k.position - sum / static_cast<double>(members.size())).norm();
            by_distance.emplace(std::round(d * 1000.0), k.index);
        }
        chosen.insert(by_distance.begin()->second);
    }
    return {chosen.begin(), chosen.end()};
}

TEST(SubmapSelection, EqualsTheReferenceOnRandomWalks) {
    for (unsigned seed = 0; seed < 5; ++seed) {
        test::Random random(seed);
        SubmapOptions options;
        options.search_radius = 20.0;
        SubmapSelector selector(options);
        std::vector<Vec3> positions{Vec3::Zero()};
        for (int i = 0; i < 400; ++i) {
            positions.emplace_back((positions.back() + random.vec3(2.0)) * 0.99);
            const Keys keys = keys_at(positions);
            const Stamp now = keys.back().stamp + kSecond / 3;
            ASSERT_EQ(selector.select(keys, positions.back(), now),
                      reference(keys, positions.back(), now, options));
        }
    }
}

}  // namespace
}  // namespace d2lio::liosam
