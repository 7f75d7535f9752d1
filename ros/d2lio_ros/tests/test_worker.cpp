// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "d2lio/ros1/input_watch.hpp"
#include "d2lio/ros1/worker.hpp"
#include "fake_host.hpp"
#include "message_bytes.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::chrono::seconds kPatience{10};

/// Sixteen points over 0.1 s, the times in seconds.
RawMessage cloud(double seconds, bool with_times = true) {
    TestCloud c;
    c.fields = {{"x", 0, 7}, {"y", 4, 7}, {"z", 8, 7}, {with_times ? "time" : "what", 12, 7}};
    c.point_step = 16;
    c.width = 32;
    ByteWriter data;
    for (int i = 0; i < 32; ++i) {
        data.add(5.F).add(static_cast<float>(i)).add(1.F).add(0.003F * static_cast<float>(i));
    }
    c.data = data.bytes();
    return c.message(std::llround(seconds * 1e9));
}

class WorkerTest : public testing::Test {
  protected:
    WorkerTest() : kinds_(fake_kinds()), complaints_([this](const auto& s) { log_ += s + "\n"; }) {
        config_ = configure({{"lidar_topic", Setting::of(std::string("/l"))},
                             {"imu_topic", Setting::of(std::string("/i"))}},
                            kinds_);
        config_.node.queue_scans = 0;
        worker_ = std::make_unique<Worker>(config_, recorder_, complaints_);
    }
    void start() {
        worker_->start(
            [this](const ScanResult& r, const ResultContext& c) {
                results_.push_back(r);
                latest_ = c;
            },
            [] { return false; });
    }
    void feed(double from, double to, bool with_times = true) {
        for (int i = 0; from + 0.01 * i < to; ++i) {
            ImuSample s;
            s.stamp = std::llround((from + 0.01 * i) * 1e9);
            s.accel = Vec3(0, 0, 9.81);
            worker_->queue().push(s);
            if (i % 10 == 0) {
                const double at = from + 0.01 * i;
                worker_->queue().push(
                    {cloud(at, with_times), std::llround(at * 1e9), Clock::now()});
            }
        }
    }

    std::string log_;
    std::vector<EstimatorKind> kinds_;
    Configuration config_;
    Recorder recorder_{""};
    Complaints complaints_;
    std::unique_ptr<Worker> worker_;
    std::vector<ScanResult> results_;
    ResultContext latest_;
};

TEST_F(WorkerTest, AnswersEveryScanBeforeItEnds) {
    feed(100.0, 103.0);
    start();
    worker_->stop(kPatience);
    EXPECT_EQ(results_.size(), 30U);
    EXPECT_EQ(recorder_.poses().size(), 30U);
    EXPECT_GT(latest_.latency_ms, 0.0);
    EXPECT_EQ(worker_->counts().at("scans_received"), 30U);
    EXPECT_TRUE(log_.empty()) << log_;
}

TEST_F(WorkerTest, RefusesCloudsWithoutTimesAndSaysSoOnce) {
    feed(100.0, 101.0, false);
    start();
    worker_->stop(kPatience);
    EXPECT_TRUE(results_.empty());
    EXPECT_EQ(worker_->counts().at("scans_bad_times"), 10U);
    EXPECT_EQ(log_.find("no per-point times"), log_.rfind("no per-point times"));
    EXPECT_EQ(complaints_.counts().at("scan_times"), 10U);
}

TEST_F(WorkerTest, GivesUpDamagedMessagesAndGoesOn) {
    feed(100.0, 101.0);
    RawMessage damaged = cloud(101.0);
    damaged.bytes.resize(40);
    worker_->queue().push({damaged, 101'000'000'000, Clock::now()});
    feed(101.1, 102.0);
    start();
    worker_->stop(kPatience);
    EXPECT_EQ(results_.size(), 19U);
    EXPECT_EQ(worker_->counts().at("scans_bad_message"), 1U);
}

TEST_F(WorkerTest, BeginsANewEpochWhenTheBagLoops) {
    for (int round = 0; round < 2; ++round) feed(100.0, 101.0);
    start();
    worker_->stop(kPatience);
    EXPECT_EQ(worker_->counts().at("epochs"), 1U);
    EXPECT_EQ(std::count_if(results_.begin(), results_.end(),
                            [](const ScanResult& r) { return r.new_epoch; }),
              1);
    EXPECT_GE(results_.size(), 19U);  // the last of the first round may lack its samples
}

TEST_F(WorkerTest, RunsCommandsBetweenScansAndRefusesThemAfterItsEnd) {
    start();
    bool ran = false;
    EXPECT_TRUE(worker_->call([&] { ran = true; }));
    EXPECT_TRUE(ran);
    EXPECT_THROW(worker_->call([&] {
        worker_->set_params({{"rejection.mode", "kis"}});
    }),
                 ConfigError);
    bool goes_on = true;
    EXPECT_TRUE(worker_->call([&] {
        goes_on = worker_->set_params({{"rejection.mode", "kiss"}});
    }));
    EXPECT_FALSE(goes_on);  // this host starts anew
    EXPECT_EQ(worker_->params().at("rejection.mode"), "kiss");
    worker_->stop(kPatience);
    EXPECT_FALSE(worker_->call([] {}));
}

TEST(InputWatch, NamesTheSilentTopicAndClocksThatDiffer) {
    const auto now = InputWatch::Clock::now();
    InputWatch watch("/lidar", "/imu");
    EXPECT_EQ(watch.complaint(now), "");
    EXPECT_NE(watch.complaint(now + std::chrono::seconds(9)).find("/lidar"), std::string::npos);
    watch.scan(1'000'000'000, now);
    watch.imu(1'000'000'000, now);
    EXPECT_EQ(watch.complaint(now), "");
    watch.scan(4'000'000'000, now + std::chrono::seconds(3));
    EXPECT_EQ(watch.complaint(now + std::chrono::seconds(3)), "no message on /imu for 3.0 s");
    InputWatch apart("/lidar", "/imu");
    apart.scan(1'000'000'000, now);
    apart.imu(900'000'000'000, now);
    EXPECT_NE(apart.complaint(now).find("different clocks"), std::string::npos);
}

}  // namespace
}  // namespace d2lio::ros1
