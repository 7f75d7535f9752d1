// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace d2lio::ros1 {

/// What is wrong with the input: each kind logged at once, then at most every ten seconds with its
/// count, and kept for the diagnostics. Thread-safe.
class Complaints {
  public:
    using Clock = std::chrono::steady_clock;
    using Log = std::function<void(const std::string&)>;

    explicit Complaints(Log log) : log_(std::move(log)) {}

    /// @param kind same for all complaints that say the same
    void tell(const std::string& kind, const std::string& text,
              Clock::time_point now = Clock::now());
    /// Texts told in the last `age`.
    std::vector<std::string> recent(std::chrono::seconds age,
                                    Clock::time_point now = Clock::now()) const;
    std::map<std::string, std::size_t> counts() const;
    /// The first text of each kind.
    std::vector<std::string> texts() const;

  private:
    struct Entry {
        std::string first, text;
        std::size_t count = 0;
        Clock::time_point last, logged;
    };
    Log log_;
    mutable std::mutex mutex_;
    std::map<std::string, Entry> entries_;
};

}  // namespace d2lio::ros1
