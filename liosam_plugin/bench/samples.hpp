// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <numeric>
#include <vector>

#include "d2lio/host/stop_watch.hpp"

namespace d2lio::bench {

/// The value that a share `q` of the (at least one) values does not exceed (nearest rank).
inline double quantile(std::vector<double> values, double q) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5)];
}

/// Times of single runs of a benchmark that uses manual time and one thread.
class Samples {
  public:
    void start() {
        cpu_start_ = thread_cpu_ms();
        watch_.lap();
    }
    void stop(benchmark::State& state) {
        ms_.push_back(watch_.lap());
        cpu_sum_ += thread_cpu_ms() - cpu_start_;
        state.SetIterationTime(ms_.back() * 1e-3);
    }
    double mean() const {
        return std::accumulate(ms_.begin(), ms_.end(), 0.0) / static_cast<double>(ms_.size());
    }
    double mean_cpu() const { return cpu_sum_ / static_cast<double>(ms_.size()); }
    /// Counters mean_ms, median_ms and p95_ms of wall time, and cpu_ms: the mean time on a core,
    /// which says more on a machine that does other things as well.
    void report(benchmark::State& state) const {
        if (ms_.empty()) return;
        state.counters["mean_ms"] = mean();
        state.counters["median_ms"] = quantile(ms_, 0.5);
        state.counters["p95_ms"] = quantile(ms_, 0.95);
        state.counters["cpu_ms"] = mean_cpu();
    }

  private:
    static double thread_cpu_ms() {
        timespec t{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
        return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
    }

    StopWatch watch_;
    double cpu_start_ = 0.0, cpu_sum_ = 0.0;
    std::vector<double> ms_;
};

}  // namespace d2lio::bench
