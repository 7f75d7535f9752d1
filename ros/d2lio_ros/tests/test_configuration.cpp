// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <fstream>

#include "d2lio/ros1/configuration.hpp"
#include "fake_host.hpp"

namespace d2lio::ros1 {
namespace {

Settings needed() {
    return {{"lidar_topic", Setting::of(std::string("/points"))},
            {"imu_topic", Setting::of(std::string("/imu"))}};
}

std::string written(const std::string& name, const std::string& text) {
    const std::string path = testing::TempDir() + name;
    std::ofstream(path) << text;
    return path;
}

bool tells(const Problems& problems, const std::string& needle) {
    return problems.text().find(needle) != std::string::npos;
}

TEST(Configuration, TakesDefaultsAndBoundsTheHostsQueues) {
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(needed(), kinds);
    EXPECT_TRUE(c.problems.empty()) << c.problems.text();
    EXPECT_NE(c.estimator, nullptr);
    EXPECT_EQ(c.kind->name, "fastlio");
    EXPECT_EQ(c.params.at("live"), "true");
    EXPECT_EQ(c.params.at("preprocess.blind"), "0.5");
    EXPECT_EQ(c.params.at("mapping.det_range"), "100.0");
}

TEST(Configuration, TellsEveryProblemAtOnce) {
    Settings s = needed();
    s["rejection.mod"] = Setting::of(std::string("kiss"));
    s["rejection.mode"] = Setting::of(std::string("kis"));
    s["point_filter_num"] = Setting::of(std::string("0"));
    s["queue_scans"] = Setting::of(std::string("-1"));
    s["lidar.time_unit"] = Setting::of(std::string("min"));
    s["estimator"] = Setting::of(std::string("icp"));
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(s, kinds);
    EXPECT_EQ(c.problems.lines().size(), 6U) << c.problems.text();
    EXPECT_TRUE(
        tells(c.problems, "~rejection/mod = kiss: unknown key; did you mean ~rejection/mode?"));
    EXPECT_TRUE(tells(c.problems, "~rejection/mode = kis: allowed: one of off, none"));
    EXPECT_TRUE(tells(c.problems, "~point_filter_num = 0"));
    EXPECT_TRUE(tells(c.problems, "~queue_scans = -1"));
    EXPECT_TRUE(tells(c.problems, "~lidar/time_unit = min"));
    EXPECT_TRUE(tells(c.problems, "~estimator = icp: allowed: fastlio, d2lio"));
}

TEST(Configuration, UnderstandsABareOffAsAChoice) {
    Settings s = needed();
    s["rejection.mode"] = Setting::of(false);
    s["live"] = Setting::of(false);
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(s, kinds);
    EXPECT_TRUE(c.problems.empty()) << c.problems.text();
    EXPECT_EQ(c.params.at("rejection.mode"), "off");
    EXPECT_EQ(c.params.at("live"), "false");
}

TEST(Configuration, RefusesAnExtrinsicThatIsNoRotation) {
    Settings s = needed();
    s["T_imu_lidar"] = Setting::of(std::string("[1,0,0,0, 0,1,0,0, 0,0,-1,0, 0,0,0,1]"));
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(s, kinds);
    EXPECT_TRUE(tells(c.problems, "determinant -1")) << c.problems.text();
}

TEST(Configuration, ReadsASequenceFileAndLetsParametersWin) {
    const std::string path = written("sequence.yaml",
                                     "name: room\nbag: data.bag\nground_truth: gt.tum\n"
                                     "T_imu_lidar:\n- [1, 0, 0, 0.1]\n- [0, 1, 0, 0.2]\n"
                                     "- [0, 0, 1, 0.3]\n- [0, 0, 0, 1]\n"
                                     "lidar: {topic: /l, model: OS1_64, rings: 64, rate_hz: 10.0,\n"
                                     "  min_range_m: 0.7, max_range_m: 90.0, time_field: t,\n"
                                     "  time_unit: ns}\n"
                                     "imu: {topic: /i, rate_hz: 200.0, gyro_noise: 1.0e-3,\n"
                                     "  accel_noise: 1.0e-2, gyro_walk: 0, accel_walk: 0}\n");
    Settings s{{"sequence_config", Setting::of(path)},
               {"lidar.max_range_m", Setting::of(50.0)},
               {"imu_topic", Setting::of(std::string("/other"))}};
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(s, kinds);
    ASSERT_TRUE(c.problems.empty()) << c.problems.text();
    EXPECT_EQ(c.node.lidar_topic, "/l");
    EXPECT_EQ(c.node.imu_topic, "/other");
    EXPECT_EQ(c.params.at("point_filter_num"), "3");  // 64 rings
    EXPECT_EQ(c.params.at("preprocess.blind"), "0.7");
    EXPECT_EQ(c.params.at("preprocess.max_range"), "50.0");
    EXPECT_EQ(c.params.at("mapping.extrinsic_T"), "[0.1, 0.2, 0.3]");
    EXPECT_EQ(c.source.time_field, "t");
    EXPECT_EQ(c.source.time_unit, TimeUnit::kNanoseconds);
}

TEST(Configuration, ReadsHostSectionsAndNamesWrongKeysOfAFile) {
    const std::string path = written("config.yaml",
                                     "lidar: {topic: /l, rins: 4}\nimu: {topic: /i}\n"
                                     "host: {rejection.mode: off, point_filter_num: 5}\n"
                                     "hosts: {fastlio: {point_filter_num: 7}, d2lio: {x: 1}}\n");
    const Settings s{{"sequence_config", Setting::of(path)}};
    const std::vector<EstimatorKind> kinds = fake_kinds();
    const Configuration c = configure(s, kinds);
    EXPECT_EQ(c.problems.lines().size(), 1U) << c.problems.text();
    EXPECT_TRUE(tells(c.problems, "lidar.rins = 4: unknown key; did you mean lidar.rings?"));
    EXPECT_EQ(c.params.at("rejection.mode"), "off");
    EXPECT_EQ(c.params.at("point_filter_num"), "7");
}

TEST(Configuration, GivesLioSamRangesOnlyWhereTheyAreStated) {
    Source source;
    source.rings = 128;
    source.model = "os1_128";
    ParamMap p = source_params(source, "liosam", {});
    EXPECT_EQ(p.count("preprocess.blind"), 0U);
    EXPECT_EQ(p.at("N_SCAN"), "128");
    EXPECT_EQ(p.at("downsampleRate"), "4");
    EXPECT_EQ(p.at("Horizon_SCAN"), "1024");
    EXPECT_EQ(p.at("point_filter_num"), "1");  // features need whole rings
    source.stated = {"lidar.min_range_m"};
    p = source_params(source, "liosam", {{"front_end", "direct"}});
    EXPECT_EQ(p.at("preprocess.blind"), "0.5");
    EXPECT_EQ(p.at("point_filter_num"), "3");
}

}  // namespace
}  // namespace d2lio::ros1
