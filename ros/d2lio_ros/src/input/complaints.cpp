// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/complaints.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::chrono::seconds kQuiet{10};

}  // namespace

void Complaints::tell(const std::string& kind, const std::string& text, Clock::time_point now) {
    std::string line;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        Entry& e = entries_[kind];
        ++e.count;
        e.text = text;
        e.last = now;
        if (e.count > 1 && now - e.logged < kQuiet) return;
        if (e.count == 1) e.first = text;
        e.logged = now;
        line = e.count == 1 ? text : text + " (" + std::to_string(e.count) + " times)";
    }
    log_(line);
}

std::vector<std::string> Complaints::recent(std::chrono::seconds age, Clock::time_point now) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<std::string> out;
    for (const auto& [kind, e] : entries_) {
        if (now - e.last <= age) out.push_back(e.text);
    }
    return out;
}

std::map<std::string, std::size_t> Complaints::counts() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::map<std::string, std::size_t> out;
    for (const auto& [kind, e] : entries_) out[kind] = e.count;
    return out;
}

std::vector<std::string> Complaints::texts() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<std::string> out;
    for (const auto& [kind, e] : entries_) out.push_back(e.first);
    return out;
}

}  // namespace d2lio::ros1
