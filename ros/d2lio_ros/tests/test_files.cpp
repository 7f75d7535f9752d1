// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "d2lio/ros1/recorder.hpp"
#include "d2lio/ros1/text.hpp"

namespace d2lio::ros1 {
namespace {

std::string read(const std::string& path) {
    std::ostringstream out;
    out << std::ifstream(path).rdbuf();
    return out.str();
}

TEST(Text, WritesNumbersAsPythonDoes) {
    const std::pair<double, const char*> known[] = {
        {0.0, "0.0"},
        {-0.0, "-0.0"},
        {1.0, "1.0"},
        {0.1, "0.1"},
        {1e-4, "0.0001"},
        {1e-5, "1e-05"},
        {1e15, "1000000000000000.0"},
        {1e16, "1e+16"},
        {1.5e-7, "1.5e-07"},
        {1e22, "1e+22"},
        {-2.5, "-2.5"},
        {1.0 / 3.0, "0.3333333333333333"},
        {123456.789, "123456.789"},
        {5e-324, "5e-324"},
        {1e100, "1e+100"},
        {0.30000000000000004, "0.30000000000000004"},
    };
    for (const auto& [value, text] : known) EXPECT_EQ(shortest(value), text);
    EXPECT_EQ(shortest(kNaN), "nan");
    EXPECT_EQ(shortest(-HUGE_VAL), "-inf");
}

TEST(Text, NumbersReadBackAsTheSame) {
    std::mt19937_64 random(2);
    for (int i = 0; i < 20000; ++i) {
        const std::uint64_t bits = random();
        double value = 0.0;
        static_assert(sizeof bits == sizeof value, "same size");
        std::memcpy(&value, &bits, sizeof value);
        if (!std::isfinite(value)) continue;
        EXPECT_EQ(std::strtod(shortest(value).c_str(), nullptr), value);
    }
}

TEST(Text, FiguresStampsAndCsv) {
    EXPECT_EQ(figure("offered", 12.0), "12");
    EXPECT_EQ(figure("time_total_ms", 12.0), "12.0");
    EXPECT_EQ(figure("sigma", kNaN), "nan");
    EXPECT_EQ(seconds_text(1'700'000'000'123'456'789), "1700000000.123456789");
    EXPECT_EQ(seconds_text(-5), "-0.000000005");
    EXPECT_EQ(csv_field("plain"), "plain");
    EXPECT_EQ(csv_field("a, \"b\""), "\"a, \"\"b\"\"\"");
    EXPECT_EQ(json_text("a\"\n\\"), "\"a\\\"\\u000a\\\\\"");
}

ScanResult result(Stamp stamp, double x) {
    ScanResult r;
    r.stamp = stamp;
    r.has_pose = true;
    r.status = ScanStatus::kOk;
    r.health = Health::kOk;
    r.state.pos.x() = x;
    return r;
}

TEST(Recorder, StreamsWhatAKilledNodeLeaves) {
    const std::string folder = testing::TempDir() + "recorder_stream";
    std::filesystem::remove_all(folder);
    Recorder recorder(folder);
    ASSERT_TRUE(recorder.error().empty()) << recorder.error();
    recorder.add(result(1'000'000'000, 1.5));
    EXPECT_EQ(read(folder + "/trajectory.tum"), "1.000000000 1.5 0.0 0.0 0.0 0.0 0.0 1.0\n");
    const std::string csv = read(folder + "/diagnostics.csv");
    EXPECT_EQ(csv.substr(0, 22), "stamp_ns,status,health");
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2);
}

TEST(Recorder, KeepsTrajectoriesOfEpochsApart) {
    const std::string folder = testing::TempDir() + "recorder_epochs";
    std::filesystem::remove_all(folder);
    Recorder recorder(folder);
    recorder.add(result(2'000'000'000, 1.0));
    recorder.add(result(3'000'000'000, 2.0));
    recorder.add(result(1'000'000'000, 7.0));
    EXPECT_EQ(recorder.poses().size(), 1U);
    recorder.finish({});
    EXPECT_EQ(read(folder + "/trajectory.1.tum").substr(0, 15), "2.000000000 1.0");
    EXPECT_EQ(read(folder + "/trajectory.tum").substr(0, 15), "1.000000000 7.0");
    const std::string json = read(folder + "/run.json");
    EXPECT_NE(json.find("\"status\": \"complete\""), std::string::npos) << json;
    EXPECT_NE(json.find("\"processed\": 3"), std::string::npos) << json;
}

TEST(Recorder, TellsAFolderThatCannotBeWritten) {
    const std::string file = testing::TempDir() + "not_a_folder";
    std::ofstream(file) << "x";
    EXPECT_NE(Recorder(file + "/below").error().find("cannot be written"), std::string::npos);
    EXPECT_TRUE(Recorder("").error().empty());
    EXPECT_NE(replace_file(file + "/below/map.pcd", "x"), "");
}

TEST(Recorder, WritesNanForAPoseThatIsNotFinite) {
    TimedPose pose;
    pose.pose.t.x() = kNaN;
    EXPECT_EQ(tum_line(pose), "0.000000000 nan 0.0 0.0 nan nan nan nan\n");
}

}  // namespace
}  // namespace d2lio::ros1
