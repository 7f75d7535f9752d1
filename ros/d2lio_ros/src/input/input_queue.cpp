// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/input_queue.hpp"

#include <algorithm>

namespace d2lio::ros1 {
namespace {

constexpr double kJumpBack = 0.5;             // s, as the synchronizer: less is a late message
constexpr std::size_t kMaxImu = 200'000;      // samples, minutes of any IMU
constexpr std::chrono::seconds kPatience{1};  // until a stream that has not jumped is left behind

}  // namespace

template <typename T>
void InputQueue::Stream<T>::push(T value, Stamp stamp, Clock::time_point now) {
    if (newest && seconds_between(*newest, stamp) > kJumpBack) {
        ++epoch;
        newest.reset();
    }
    newest = std::max(stamp, newest.value_or(stamp));
    items.push_back({std::move(value), now, epoch});
}

void InputQueue::push(const ImuSample& sample, Clock::time_point now) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        ++counts_.imu_received;
        if (imu_.items.size() >= kMaxImu) {
            imu_.items.pop_front();
            ++counts_.imu_dropped;
        }
        imu_.push(sample, sample.stamp, now);
    }
    arrived_.notify_one();
}

void InputQueue::push(QueuedScan scan) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        ++counts_.scans_received;
        if (max_scans_ > 0 && scans_.items.size() >= max_scans_) {
            scans_.items.pop_front();
            ++counts_.scans_dropped;
        }
        const Stamp stamp = scan.stamp;
        const Clock::time_point arrival = scan.arrival;
        scans_.push(std::move(scan), stamp, arrival);
    }
    arrived_.notify_one();
}

std::optional<QueuedInput> InputQueue::pop(bool want_scan, std::chrono::milliseconds wait) {
    std::unique_lock<std::mutex> lock(mutex_);
    std::optional<QueuedInput> out = next(want_scan, Clock::now());
    if (out || wait.count() == 0) return out;
    arrived_.wait_for(lock, wait);
    return next(want_scan, Clock::now());
}

std::optional<QueuedInput> InputQueue::next(bool want_scan, Clock::time_point now) {
    take_along(imu_, scans_, now);
    take_along(scans_, imu_, now);
    do {
        if (want_scan && scans_.has(epoch_)) return QueuedInput{{}, scans_.take()};
        if (imu_.has(epoch_)) return QueuedInput{imu_.take(), {}};
    } while (begin_epoch());
    return std::nullopt;
}

/// Goes on to the next epoch where both streams have; true if so.
bool InputQueue::begin_epoch() {
    // The samples of these scans will not come any more.
    while (imu_.is_beyond(epoch_) && scans_.has(epoch_)) {
        scans_.take();
        ++counts_.scans_cut_off;
    }
    if (!imu_.is_done(epoch_) || !scans_.is_done(epoch_)) return false;
    const unsigned imu = imu_.items.empty() ? imu_.epoch : imu_.items.front().epoch;
    const unsigned scan = scans_.items.empty() ? scans_.epoch : scans_.items.front().epoch;
    epoch_ = std::min(imu, scan);
    return true;
}

/// Where one stream has jumped back and the other does not follow, the other is taken along.
template <typename Ahead, typename Behind>
void InputQueue::take_along(const Ahead& ahead, Behind& behind, Clock::time_point now) {
    if (!ahead.is_beyond(epoch_) || behind.epoch >= ahead.items.front().epoch) return;
    if (now - ahead.items.front().arrival < kPatience) return;
    behind.epoch = ahead.items.front().epoch;
    for (auto& item : behind.items) item.epoch = behind.epoch;
}

void InputQueue::clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    imu_.items.clear();
    scans_.items.clear();
}

InputQueue::Counts InputQueue::counts() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return counts_;
}

std::size_t InputQueue::waiting_scans() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return scans_.items.size();
}

bool InputQueue::empty() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return imu_.items.empty() && scans_.items.empty();
}

}  // namespace d2lio::ros1
