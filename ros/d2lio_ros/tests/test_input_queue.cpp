// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>

#include "d2lio/ros1/input_queue.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::chrono::milliseconds kNow{0};

ImuSample imu(double seconds) {
    ImuSample s;
    s.stamp = static_cast<Stamp>(std::llround(seconds * 1e9));
    return s;
}

QueuedScan scan(double seconds, Clock::time_point arrival = Clock::now()) {
    return {{}, static_cast<Stamp>(std::llround(seconds * 1e9)), arrival};
}

/// Stamps handed out, in tenths of a second; scans as negative numbers.
using Tenths = std::vector<long>;
Tenths drain(InputQueue& queue, bool want_scan = true) {
    Tenths out;
    while (const auto next = queue.pop(want_scan, kNow)) {
        const Stamp stamp = next->imu ? next->imu->stamp : next->scan->stamp;
        out.push_back((next->imu ? 1 : -1) * std::lround(10.0 * seconds_between(stamp, 0)));
    }
    return out;
}

TEST(InputQueue, HandsAScanOutBeforeSamplesAndInOrder) {
    InputQueue queue(0);
    queue.push(imu(1.0));
    queue.push(scan(1.1));
    queue.push(imu(1.2));
    EXPECT_EQ(drain(queue), (Tenths{-11, 10, 12}));
}

TEST(InputQueue, HandsOutSamplesOnlyWhileNoScanIsWanted) {
    InputQueue queue(0);
    queue.push(scan(1.0));
    queue.push(imu(1.0));
    EXPECT_EQ(drain(queue, false), Tenths{10});
    EXPECT_EQ(queue.waiting_scans(), 1U);
}

TEST(InputQueue, DropsTheOldestScanBeyondItsBound) {
    InputQueue queue(2);
    for (const double t : {1.0, 1.1, 1.2}) queue.push(scan(t));
    EXPECT_EQ(queue.counts().scans_dropped, 1U);
    EXPECT_EQ(queue.counts().scans_received, 3U);
    EXPECT_EQ(drain(queue), (Tenths{-11, -12}));
}

TEST(InputQueue, WaitsForBothStreamsToJumpBack) {
    InputQueue queue(0);
    queue.push(imu(10.0));
    queue.push(imu(1.0));  // the bag loops; a scan of the old round is still on its way
    EXPECT_EQ(drain(queue), Tenths{100});
    queue.push(scan(9.9));
    EXPECT_EQ(drain(queue), Tenths{-99});
    queue.push(scan(1.0));
    EXPECT_EQ(drain(queue), (Tenths{-10, 10}));
}

TEST(InputQueue, CutsOffScansWhoseSamplesWillNotCome) {
    InputQueue queue(0);
    queue.push(scan(10.0));
    queue.push(scan(10.1));
    queue.push(imu(9.9));
    EXPECT_EQ(drain(queue, false), Tenths{99});
    queue.push(imu(1.0));
    queue.push(scan(1.0));
    EXPECT_EQ(drain(queue, false), Tenths{10});
    EXPECT_EQ(queue.counts().scans_cut_off, 2U);
    EXPECT_EQ(drain(queue), Tenths{-10});
}

TEST(InputQueue, LeavesAStreamBehindThatDoesNotJump) {
    InputQueue queue(0);
    const Clock::time_point long_ago = Clock::now() - std::chrono::seconds(5);
    queue.push(imu(10.0), long_ago);
    queue.push(imu(1.0), long_ago);
    queue.push(scan(10.0));
    EXPECT_EQ(drain(queue).size(), 3U);
    queue.push(imu(1.1));
    queue.push(scan(10.1));
    EXPECT_EQ(drain(queue).size(), 2U);
}

TEST(InputQueue, LateMessagesAreNoJump) {
    InputQueue queue(0);
    for (const double t : {1.0, 1.4, 1.1, 1.5}) queue.push(imu(t));
    EXPECT_EQ(drain(queue), (Tenths{10, 14, 11, 15}));
}

/// Feeds three rounds of two streams, interleaved at random, and checks that rounds come one after
/// the other.
void check_rounds(unsigned seed) {
    std::mt19937 random(seed);
    InputQueue queue(0);
    int samples = 0, scans = 0, round = 0;
    std::size_t handed_out = 0;
    const auto look = [&](bool want_scan) {
        while (const auto next = queue.pop(want_scan, kNow)) {
            const int of = next->imu ? static_cast<int>(next->imu->gyro.x())
                                     : std::stoi(next->scan->message.type);
            EXPECT_GE(of, round) << "seed " << seed;
            round = of;
            ++handed_out;
        }
    };
    while (samples < 60 || scans < 30) {
        if (scans == 30 || (samples < 60 && random() % 3 != 0)) {
            ImuSample s = imu(100 + 0.1 * (samples % 20));
            s.gyro.x() = samples++ / 20;
            queue.push(s);
        } else {
            QueuedScan s = scan(100 + 0.2 * (scans % 10));
            s.message.type = std::to_string(scans++ / 10);
            queue.push(std::move(s));
        }
        if (random() % 4 == 0) look(random() % 2 == 0);
    }
    look(true);
    EXPECT_EQ(handed_out + queue.counts().scans_cut_off, 90U);
}

TEST(InputQueue, NeverMixesRoundsHoweverTheStreamsInterleave) {
    for (unsigned seed = 0; seed < 300; ++seed) check_rounds(seed);
}

}  // namespace
}  // namespace d2lio::ros1
