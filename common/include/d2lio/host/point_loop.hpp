// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstddef>

namespace d2lio {

/// Runs f(i) for i in [0, n) on a fixed number of threads. Where every call writes only entries of
/// its own, the result does not depend on that number.
class PointLoop {
  public:
    explicit PointLoop(int threads) : threads_(threads), arena_(threads) {}

    template <typename F>
    void operator()(std::size_t n, const F& f) {
        if (threads_ == 1) {
            for (std::size_t i = 0; i < n; ++i) f(i);
            return;
        }
        arena_.execute([&] {
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, kGrain), [&f](const auto& r) {
                for (std::size_t i = r.begin(); i != r.end(); ++i) f(i);
            });
        });
    }

  private:
    static constexpr std::size_t kGrain = 128;  ///< points per task
    int threads_;
    tbb::task_arena arena_;
};

}  // namespace d2lio
