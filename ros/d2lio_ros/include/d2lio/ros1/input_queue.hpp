// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>

#include "d2lio/ros1/decode.hpp"

namespace d2lio::ros1 {

using Clock = std::chrono::steady_clock;

struct QueuedScan {
    RawMessage message;
    Stamp stamp = 0;  ///< of the message's header
    Clock::time_point arrival;
};

/// What the estimator's thread is handed next: a sample or a scan.
struct QueuedInput {
    std::optional<ImuSample> imu;
    std::optional<QueuedScan> scan;
};

/// Between the subscribers and the estimator's thread. Two connections keep no order between them:
/// when the stamps of one jump back (a bag loops), what it brings waits until the other has jumped
/// too, so that none of the old epoch mixes with the new one. Thread-safe.
class InputQueue {
  public:
    struct Counts {
        std::size_t scans_received = 0, imu_received = 0;
        std::size_t scans_dropped = 0;  ///< by the bound, the oldest first
        std::size_t imu_dropped = 0;
        std::size_t scans_cut_off = 0;  ///< without IMU data when an epoch ended
    };

    /// @param max_scans that wait, 0: all
    explicit InputQueue(std::size_t max_scans) : max_scans_(max_scans) {}

    void push(const ImuSample& sample, Clock::time_point now = Clock::now());
    void push(QueuedScan scan);
    /// The next input, waiting for one no longer than `wait`; nothing if there is none.
    /// @param want_scan false while the estimator waits for the samples of the scans it has
    std::optional<QueuedInput> pop(bool want_scan, std::chrono::milliseconds wait);
    void clear();

    Counts counts() const;
    std::size_t waiting_scans() const;
    bool empty() const;

  private:
    template <typename T>
    struct Stream {
        struct Item {
            T value;
            Clock::time_point arrival;
            unsigned epoch;
        };
        std::deque<Item> items;
        std::optional<Stamp> newest;
        unsigned epoch = 0;  ///< of what arrives

        void push(T value, Stamp stamp, Clock::time_point now);
        bool has(unsigned current) const {
            return !items.empty() && items.front().epoch == current;
        }
        bool is_beyond(unsigned current) const {
            return !items.empty() && items.front().epoch > current;
        }
        /// Nothing of this epoch is here or will come.
        bool is_done(unsigned current) const {
            return items.empty() ? epoch > current : is_beyond(current);
        }
        T take() {
            T value = std::move(items.front().value);
            items.pop_front();
            return value;
        }
    };

    std::optional<QueuedInput> next(bool want_scan, Clock::time_point now);
    bool begin_epoch();
    template <typename Ahead, typename Behind>
    void take_along(const Ahead& ahead, Behind& behind, Clock::time_point now);

    const std::size_t max_scans_;
    mutable std::mutex mutex_;
    std::condition_variable arrived_;
    Stream<ImuSample> imu_;
    Stream<QueuedScan> scans_;
    unsigned epoch_ = 0;  ///< of what is handed out
    Counts counts_;
};

}  // namespace d2lio::ros1
