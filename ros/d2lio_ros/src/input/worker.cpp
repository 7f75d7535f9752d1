// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/worker.hpp"

#include <algorithm>
#include <exception>

namespace d2lio::ros1 {
namespace {

constexpr std::chrono::milliseconds kWait{50};
constexpr std::size_t kInHost = 2;  // scans the estimator holds; the rest wait in the queue

void add_counts(const HostCounts& c, std::map<std::string, std::size_t>& out) {
    const SyncCounts& s = c.sync;
    const FilterCounts& p = c.points;
    const std::pair<const char*, std::size_t> entries[] = {
        {"imu_accepted", s.imu_accepted},
        {"imu_late", s.imu_late},
        {"imu_duplicate", s.imu_duplicate},
        {"imu_bad", s.imu_bad},
        {"imu_overflow", s.imu_overflow},
        {"imu_cleared", s.imu_cleared},
        {"imu_gaps", s.imu_gaps},
        {"scans_accepted", s.scans_accepted},
        {"scans_late", s.scans_late},
        {"scans_duplicate", s.scans_duplicate},
        {"scans_bad", s.scans_bad},
        {"scans_overflow", s.scans_overflow},
        {"scans_uncovered", s.scans_uncovered},
        {"scans_without_imu", s.scans_without_imu},
        {"scans_cleared", s.scans_cleared},
        {"lidar_gaps", s.lidar_gaps},
        {"epochs", s.epochs},
        {"resets", c.resets},
        {"points_offered", p.offered},
        {"points_not_finite", p.not_finite},
        {"points_zero", p.zero},
        {"points_bad_time", p.bad_time},
        {"points_too_near", p.too_near},
        {"points_too_far", p.too_far},
        {"points_kept", p.kept},
    };
    for (const auto& [name, value] : entries) out[name] = value;
    for (const auto& [name, value] : c.own) out[name] = value;
}

}  // namespace

Worker::Worker(Configuration& config, Recorder& recorder, Complaints& complaints)
    : config_(config),
      recorder_(recorder),
      complaints_(complaints),
      queue_(static_cast<std::size_t>(config.node.queue_scans)),
      timing_(config.source.time_hint()),
      estimator_(std::move(config.estimator)),
      params_(config.params) {}

Worker::~Worker() { stop(std::chrono::milliseconds(0)); }

void Worker::start(OnResult on_result, std::function<bool()> keep_scans) {
    on_result_ = std::move(on_result);
    keep_scans_ = std::move(keep_scans);
    ended_ = false;
    thread_ = std::thread([this] { run(); });
}

void Worker::stop(std::chrono::milliseconds patience) {
    if (!thread_.joinable()) return;
    give_up_ = Clock::now() + patience;
    stop_ = true;
    thread_.join();
}

bool Worker::call(const std::function<void()>& f) {
    auto task = std::make_shared<std::packaged_task<void()>>(f);
    std::future<void> done = task->get_future();
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (ended_) return false;
        commands_.push_back(std::move(task));
    }
    try {
        done.get();
        return true;
    } catch (const std::future_error&) {  // the thread ended before its turn
        return false;
    }
}

void Worker::run() {
    while (!stop_) {
        run_commands();
        work(kWait);
    }
    while (Clock::now() < give_up_ && work(std::chrono::milliseconds(0))) {
    }
    try {
        estimator_->finish();
        answer();
        recount();
    } catch (const std::exception& e) {
        complaints_.tell("exception", std::string("the last scans were given up: ") + e.what());
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
    commands_.clear();  // whoever waits learns of it by a broken promise
}

void Worker::run_commands() {
    for (;;) {
        std::shared_ptr<std::packaged_task<void()>> task;
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            if (commands_.empty()) return;
            task = std::move(commands_.front());
            commands_.pop_front();
        }
        (*task)();
    }
}

/// One input and all results that it completes. False if there was none.
bool Worker::work(std::chrono::milliseconds wait) {
    try {
        std::optional<QueuedInput> input = queue_.pop(pending_ < kInHost, wait);
        if (!input) return false;
        if (input->imu) {
            feed(*input->imu);
        } else {
            feed(std::move(*input->scan));
        }
        answer();
    } catch (const std::exception& e) {
        complaints_.tell("exception", std::string("a scan was given up: ") + e.what());
    }
    return true;
}

void Worker::feed(const ImuSample& sample) {
    const PushStatus status = estimator_->add_imu(sample);
    if (status == PushStatus::kBadValue) {
        complaints_.tell("imu_bad", "an IMU sample holds NaN, infinity or an impossible stamp");
    }
    if (accepted(status)) gyro_ = sample.gyro;
    if (status == PushStatus::kNewEpoch) recount();
}

void Worker::feed(QueuedScan queued) {
    RawScan raw;
    std::string error;
    const DecodeOptions options{config_.source.time_field, config_.source.model};
    if (!decode_scan(queued.message, options, raw, error, own_counts_)) {
        ++own_counts_["scans_bad_message"];
        complaints_.tell("scan_message", error);
        return;
    }
    Fed fed{queued.arrival, {}};
    Scan scan;
    switch (timing_.resolve(std::move(raw), scan)) {
        case ScanTiming::Outcome::kEmpty:
            ++own_counts_["scans_empty"];
            complaints_.tell("scan_empty", "a scan holds no points");
            return;
        case ScanTiming::Outcome::kRefused:
            ++own_counts_["scans_bad_times"];
            complaints_.tell("scan_times", timing_.message());
            return;
        case ScanTiming::Outcome::kOk:
            break;
    }
    if (keep_scans_ && keep_scans_()) fed.scan = scan;
    const PushStatus status = estimator_->add_scan(std::move(scan));
    if (accepted(status)) {
        fed_.push_back(std::move(fed));
    } else {
        complaints_.tell("scan_order", "a scan came late, twice, or with an impossible stamp");
    }
    recount();
}

void Worker::answer() {
    for (;;) {
        const Clock::time_point begin = Clock::now();
        const std::optional<ScanResult> result = estimator_->step();
        host_s_ += std::chrono::duration<double>(Clock::now() - begin).count();
        if (!result) return;
        hand_out(*result);
    }
}

void Worker::hand_out(const ScanResult& result) {
    pending_ = pending_scans(estimator_->counts());
    while (fed_.size() > pending_ + 1) fed_.pop_front();  // dropped between
    ResultContext context;
    Fed fed;
    if (!fed_.empty()) {
        fed = std::move(fed_.front());
        fed_.pop_front();
        const auto age = Clock::now() - fed.arrival;
        context.latency_ms = std::chrono::duration<double, std::milli>(age).count();
    }
    if (!fed.scan.points.empty()) context.scan = &fed.scan;
    context.gyro = gyro_;
    context.queue = queue_.waiting_scans();
    context.dropped = queue_.counts().scans_dropped;
    recorder_.add(result);
    if (on_result_) on_result_(result, context);
    recount();
}

void Worker::recount() {
    const HostCounts host = estimator_->counts();
    pending_ = pending_scans(host);
    while (fed_.size() > pending_) fed_.pop_front();
    std::map<std::string, std::size_t> counts = own_counts_;
    add_counts(host, counts);
    const InputQueue::Counts q = queue_.counts();
    counts["scans_received"] = q.scans_received;
    counts["imu_received"] = q.imu_received;
    counts["scans_queue_full"] = q.scans_dropped;
    counts["imu_queue_full"] = q.imu_dropped;
    counts["scans_cut_off"] = q.scans_cut_off;
    const std::lock_guard<std::mutex> lock(mutex_);
    shown_counts_ = std::move(counts);
}

std::map<std::string, std::size_t> Worker::counts() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return shown_counts_;
}

void Worker::reset() { replace(config_.kind->make(params_, config_.node.threads)); }

void Worker::replace(std::unique_ptr<Estimator> estimator) {
    estimator_ = std::move(estimator);
    fed_.clear();
    pending_ = 0;
    recorder_.begin_epoch();
    recount();
}

bool Worker::set_params(const ParamMap& changes) {
    ParamMap next = params_;
    for (const auto& [key, value] : changes) next[key] = value;
    auto fresh = config_.kind->make(next, config_.node.threads);  // refuses what is wrong
    const bool goes_on = estimator_->can_reconfigure();
    if (goes_on) {
        estimator_->reconfigure(changes);
    } else {
        replace(std::move(fresh));
    }
    params_ = std::move(next);
    return goes_on;
}

}  // namespace d2lio::ros1
