// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "d2lio/config/params.hpp"
#include "keyframe_map.hpp"
#include "random_state.hpp"

namespace d2lio::liosam {
namespace {

using Points = std::vector<Eigen::Vector3f>;
using Indices = std::vector<std::size_t>;

constexpr Stamp kSecond = 1'000'000'000;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();

Pose at(double x, double y = 0.0, double z = 0.0) { return {Mat3::Identity(), Vec3(x, y, z)}; }
Pose turned(const Vec3& phi) { return {exp_so3(phi), Vec3::Zero()}; }

const Points kCorner{{0.1F, 0.1F, 0.1F}};
const Points kSurfaces{{5.1F, 0.1F, 0.1F}, {5.1F, 3.1F, 0.1F}};

/// Map with a keyframe of three points at every pose, a second apart.
void add_all(KeyframeMap& map, const std::vector<Pose>& poses) {
    for (const Pose& pose : poses) {
        map.add(pose, static_cast<Stamp>(map.size()) * kSecond, kCorner, kSurfaces);
    }
}

TEST(KeyframeMapDue, FirstAlways) {
    EXPECT_TRUE(KeyframeMap().due(at(0.0), 0));
    EXPECT_FALSE(KeyframeMap().due(at(kNan), 0));
}

TEST(KeyframeMapDue, AfterDistanceOrAngleAboutOneAxis) {
    KeyframeMap map;
    const Pose start{exp_so3(Vec3(0.3, -0.2, 2.0)), Vec3(7.0, 8.0, 9.0)};
    map.add(start, 0, {}, {});
    EXPECT_FALSE(map.due(start, 0));
    EXPECT_FALSE(map.due(start * at(0.7, 0.7), 0));
    EXPECT_FALSE(map.due(start * at(0.999), 0));
    EXPECT_TRUE(map.due(start * at(0.6, 0.6, 0.6), 0));
    EXPECT_TRUE(map.due(start * at(0.0, 0.0, -1.001), 0));
    for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) {
        EXPECT_FALSE(map.due(start * turned(0.199 * axis), 0));
        EXPECT_TRUE(map.due(start * turned(0.201 * axis), 0));
        EXPECT_TRUE(map.due(start * turned(-0.201 * axis), 0));
    }
    // LIO-SAM looks at each angle, not at the rotation as a whole (0.26 rad here).
    EXPECT_FALSE(map.due(start * turned(Vec3(0.15, 0.15, 0.15)), 0));
    EXPECT_TRUE(map.due(start * turned(Vec3(0, std::acos(0.0), 0)), 0));
}

TEST(KeyframeMapDue, AfterAPauseOnlyIfAsked) {
    KeyframeMap plain;
    plain.add(at(0.0), 0, {}, {});
    EXPECT_FALSE(plain.due(at(0.0), 3600 * kSecond));
    SubmapOptions options;
    options.keyframe_interval_s = 1.0;
    KeyframeMap map(options);
    map.add(at(0.0), 0, {}, {});
    EXPECT_FALSE(map.due(at(0.0), kSecond));
    EXPECT_TRUE(map.due(at(0.0), kSecond + 1));
}

TEST(KeyframeMapDue, MeasuresFromTheCorrectedPose) {
    KeyframeMap map;
    map.add(at(0.0), 0, {}, {});
    EXPECT_TRUE(map.due(at(1.5), 0));
    EXPECT_TRUE(map.set_pose(0, at(1.0)));
    EXPECT_FALSE(map.due(at(1.5), 0));
}

TEST(KeyframeMap, EmptyIsSafe) {
    KeyframeMap map;
    EXPECT_TRUE(map.empty());
    EXPECT_FALSE(map.refresh(0));
    EXPECT_FALSE(map.set_pose(0, at(0.0)));
    EXPECT_TRUE(map.corners().empty());
    EXPECT_TRUE(map.surfaces().empty());
    EXPECT_TRUE(map.submap().empty());
}

TEST(KeyframeMap, RefusesPosesThatAreNone) {
    KeyframeMap map;
    Pose mirrored, scaled, broken;
    mirrored.R(2, 2) = -1.0;
    scaled.R *= 1.01;
    broken.R(0, 0) = kNan;
    map.add(at(0.0), 0, {}, {});
    for (const Pose& pose : {mirrored, scaled, broken, at(0, kNan), at(1e9), at(-HUGE_VAL)}) {
        EXPECT_FALSE(map.due(pose, kSecond));
        EXPECT_FALSE(map.add(pose, kSecond, kCorner, kSurfaces));
        EXPECT_FALSE(map.set_pose(0, pose));
    }
    EXPECT_EQ(map.size(), 1U);
    EXPECT_EQ(map[0].pose.t, Vec3::Zero());
}

TEST(KeyframeMap, DropsPointsThatAreNone) {
    KeyframeMap map;
    const Points bad{{kNanF, 0, 0}, {0, kInfF, 0}, {0, 0, -kInfF}, {3e38F, 0, 0}, {6000.F, 0, 0}};
    Points some = bad;
    some.insert(some.begin() + 2, {1.1F, 2.1F, 3.1F});
    map.add(at(0.0), 0, bad, some);
    EXPECT_TRUE(map.refresh(0));
    EXPECT_TRUE(map[0].corners.empty());
    EXPECT_EQ(map[0].surfaces, (Points{{1.1F, 2.1F, 3.1F}}));
    EXPECT_TRUE(map.corners().empty());
    EXPECT_EQ(map.surfaces().size(), 1U);
}

TEST(KeyframeMap, SubmapIsInTheMapFrame) {
    KeyframeMap map;
    add_all(map, {{exp_so3(Vec3(0, 0, std::acos(0.0))), Vec3(100.0, 0.0, 0.0)}, at(102.0)});
    EXPECT_TRUE(map.surfaces().empty()) << "only refresh() touches the trees";
    EXPECT_TRUE(map.refresh(2 * kSecond));
    EXPECT_EQ(map.corners().size(), 2U);
    ASSERT_EQ(map.surfaces().size(), 4U);
    for (const Eigen::Vector3f& expected :
         {Eigen::Vector3f(99.9F, 5.1F, 0.1F), Eigen::Vector3f(107.1F, 3.1F, 0.1F)}) {
        Neighbours found;
        map.surfaces().knn(expected, 1, 1.F, found);
        ASSERT_EQ(found.count, 1);
        EXPECT_LT(found[0].sq_dist, 1e-9F);
    }
}

TEST(KeyframeMap, RefreshDoesNothingWhereNothingChanged) {
    KeyframeMap map;
    add_all(map, {at(0.5), at(3.5)});
    EXPECT_TRUE(map.refresh(2 * kSecond));
    EXPECT_FALSE(map.refresh(3 * kSecond));
    EXPECT_TRUE(map.set_pose(0, map[0].pose));
    EXPECT_FALSE(map.refresh(3 * kSecond));
    EXPECT_TRUE(map.set_pose(0, at(0.6)));
    EXPECT_TRUE(map.refresh(3 * kSecond));
    EXPECT_FALSE(map.refresh(kSecond * 3600)) << "each keyframe stands for its cell";
}

TEST(KeyframeMap, SelectsAroundTheNewest) {
    KeyframeMap map;
    add_all(map, {at(0.5), at(30.5), at(60.5), at(60.6)});
    map.refresh(4 * kSecond);
    EXPECT_EQ(map.submap(), (Indices{1, 2, 3}));
    map.refresh(3600 * kSecond);
    EXPECT_EQ(map.submap(), (Indices{1, 2}));
    map.set_pose(0, at(20.0));
    map.set_pose(3, at(10.0));
    map.refresh(3600 * kSecond);
    EXPECT_EQ(map.submap(), (Indices{0, 1, 3})) << "2 is 50.5 m away now";
}

TEST(KeyframeMap, TurningOnTheSpotStaysBounded) {
    KeyframeMap map;
    std::size_t most = 0;
    for (int i = 0; i < 500; ++i) {
        const Stamp now = i * kSecond / 2;
        map.add({exp_so3(Vec3(0, 0, 0.25 * i)), Vec3(0.5, 0.5, 0.5)}, now, kCorner, kSurfaces);
        map.refresh(now);
        most = std::max(most, map.submap().size());
    }
    EXPECT_EQ(most, 21U) << "20 of the last 10 s, and the oldest";
    map.refresh(3600 * kSecond);
    EXPECT_EQ(map.submap(), (Indices{0}));
}

TEST(KeyframeMap, ClearStartsAnew) {
    KeyframeMap map, fresh;
    add_all(map, {at(0.0), at(10.0), at(20.0)});
    map.refresh(0);
    map.clear();
    EXPECT_TRUE(map.empty());
    EXPECT_TRUE(map.surfaces().empty());
    EXPECT_FALSE(map.refresh(0));
    EXPECT_TRUE(map.due(at(20.0), 0));
    add_all(map, {at(20.0)});
    add_all(fresh, {at(20.0)});
    map.refresh(0);
    fresh.refresh(0);
    EXPECT_EQ(map.surfaces().points(), fresh.surfaces().points());
    EXPECT_EQ(map.corners().points(), fresh.corners().points());
}

TEST(KeyframeMap, JumpOfTheWholeTrajectoryIsFollowed) {
    KeyframeMap map, fresh;
    std::vector<Pose> near, far;
    // By the 2^21 surface voxels after which keys repeat, and by a huge distance.
    for (const double jump : {0.4 * 2097152.0, 1e6}) {
        map.clear();
        fresh.clear();
        near = {at(0.5), at(5.5), at(10.5)};
        far = {at(jump + 0.5), at(jump + 5.5), at(jump + 10.5)};
        add_all(map, near);
        map.refresh(0);
        for (std::size_t i = 0; i < far.size(); ++i) map.set_pose(i, far[i]);
        EXPECT_TRUE(map.refresh(0));
        add_all(fresh, far);
        fresh.refresh(0);
        EXPECT_EQ(map.surfaces().points(), fresh.surfaces().points());
        EXPECT_GT(map.surfaces().bounds().min.x(), static_cast<float>(jump));
    }
}

TEST(KeyframeMap, RefusesOptionsOutsideTheirRange) {
    const auto refuses = [](auto&& change, const std::string& key) {
        SubmapOptions options;
        change(options);
        try {
            const KeyframeMap map(options);
        } catch (const ConfigError& error) {
            return error.key() == key;
        }
        return false;
    };
    EXPECT_TRUE(refuses([](auto& o) { o.search_radius = 0.0; }, "submap.search_radius"));
    EXPECT_TRUE(refuses([](auto& o) { o.search_radius = 3001.0; }, "submap.search_radius"));
    EXPECT_TRUE(refuses([](auto& o) { o.density = 0.0; }, "submap.density"));
    EXPECT_TRUE(refuses([](auto& o) { o.recent_s = -1.0; }, "submap.recent_s"));
    EXPECT_TRUE(refuses([](auto& o) { o.corner_leaf = kNanF; }, "submap.corner_leaf"));
    EXPECT_TRUE(refuses([](auto& o) { o.surface_leaf = 0.F; }, "submap.surface_leaf"));
    EXPECT_TRUE(refuses([](auto& o) { o.keyframe_distance = kNan; }, "submap.keyframe_distance"));
    EXPECT_TRUE(refuses([](auto& o) { o.keyframe_angle = -0.1; }, "submap.keyframe_angle"));
    EXPECT_TRUE(
        refuses([](auto& o) { o.keyframe_interval_s = -1.0; }, "submap.keyframe_interval_s"));
    EXPECT_TRUE(refuses([](auto& o) { o.max_clouds = 0; }, "submap.max_clouds"));
    SubmapOptions edge;
    edge.corner_leaf = 0.01F;
    EXPECT_NO_THROW(KeyframeMap{edge});
}

}  // namespace
}  // namespace d2lio::liosam
