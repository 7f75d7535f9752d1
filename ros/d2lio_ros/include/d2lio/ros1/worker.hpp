// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "d2lio/ros1/complaints.hpp"
#include "d2lio/ros1/configuration.hpp"
#include "d2lio/ros1/input_queue.hpp"
#include "d2lio/ros1/recorder.hpp"
#include "d2lio/ros1/scan_timing.hpp"

namespace d2lio::ros1 {

/// What comes with a result for those who publish it.
struct ResultContext {
    const Scan* scan = nullptr;  ///< as it came, where points were asked for
    Vec3 gyro = Vec3::Zero();    ///< newest reading, rad/s
    double latency_ms = 0.0;     ///< from the scan's arrival to now
    std::size_t queue = 0;       ///< scans that wait
    std::size_t dropped = 0;     ///< scans dropped so far
};

/// The estimation thread: takes messages from the queue, decodes, estimates, records, and hands the
/// results out. Knows nothing of ROS.
class Worker {
  public:
    using OnResult = std::function<void(const ScanResult&, const ResultContext&)>;

    Worker(Configuration& config, Recorder& recorder, Complaints& complaints);
    ~Worker();

    /// @param keep_scans whether results come with the scan as it was received
    void start(OnResult on_result, std::function<bool()> keep_scans);
    /// Ends the thread after what the queue holds, or after `patience`.
    void stop(std::chrono::milliseconds patience);

    InputQueue& queue() { return queue_; }
    /// Runs `f` between two scans and waits for it. False if the thread has ended.
    /// Rethrows what `f` throws.
    bool call(const std::function<void()>& f);

    // Only within call(), within on_result, or after stop().
    std::vector<Eigen::Vector3f> map_points() const { return estimator_->map_points(); }
    std::optional<ScanPoints> scan_points() const { return estimator_->scan_points(); }
    void reset();
    /// Changes parameters. @return whether the estimate goes on; else the estimator started anew
    /// @throws ConfigError, nothing changed then
    bool set_params(const ParamMap& changes);

    /// What became of all scans, by name; thread-safe, as of the last scan.
    std::map<std::string, std::size_t> counts() const;
    const ParamMap& params() const { return params_; }
    double host_seconds() const { return host_s_; }
    const std::string& timing_message() const { return timing_.message(); }

  private:
    struct Fed {
        Clock::time_point arrival;
        Scan scan;  ///< empty unless asked for
    };
    void run();
    void run_commands();
    bool work(std::chrono::milliseconds wait);
    void feed(const ImuSample& sample);
    void feed(QueuedScan queued);
    void answer();
    void hand_out(const ScanResult& result);
    void replace(std::unique_ptr<Estimator> estimator);
    void recount();

    Configuration& config_;
    Recorder& recorder_;
    Complaints& complaints_;
    InputQueue queue_;
    ScanTiming timing_;
    std::unique_ptr<Estimator> estimator_;
    ParamMap params_;
    OnResult on_result_;
    std::function<bool()> keep_scans_;

    std::deque<Fed> fed_;  ///< scans in the estimator
    std::size_t pending_ = 0;
    Vec3 gyro_ = Vec3::Zero();
    double host_s_ = 0.0;
    std::map<std::string, std::size_t> own_counts_;

    mutable std::mutex mutex_;  ///< of what follows
    std::map<std::string, std::size_t> shown_counts_;
    std::deque<std::shared_ptr<std::packaged_task<void()>>> commands_;
    bool ended_ = true;
    std::atomic<bool> stop_{false};
    Clock::time_point give_up_;
    std::thread thread_;
};

}  // namespace d2lio::ros1
