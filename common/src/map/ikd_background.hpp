// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "d2lio/map/ikd_tree.hpp"

namespace d2lio {

/// The second thread of IkdTree: builds one detached subtree at a time from a copy of its points.
/// Everything but the three fields handed over under the mutex belongs to the thread that updates
/// the tree; so does every public call.
struct IkdTree::Background {
    struct Operation {
        bool is_insert;
        Eigen::Vector3f point;  ///< inserted point
        ikd::Region region;     ///< erased region
    };
    struct Result {
        std::unique_ptr<ikd::NodePool> pool;
        ikd::Entry root;
        std::vector<std::uint32_t> path;  ///< refs from the root to the old subtree; empty if gone
        std::vector<Operation> log;       ///< what happened to the old subtree meanwhile, in order
    };

    Background();
    ~Background();
    Background(const Background&) = delete;
    Background& operator=(const Background&) = delete;

    /// Starts rebuilding the subtree at the end of `path`. Only when not busy.
    void start(std::vector<Eigen::Vector3f> points, std::vector<std::uint32_t> path);
    bool busy() const { return busy_; }
    bool finished();  ///< a result waits to be taken
    void wait();      ///< until finished, at once when not busy
    Result take();

    /// The node is about to go: gives the rebuild up if the watched subtree is at or below it.
    void forget(std::uint32_t ref);
    bool watches(std::uint32_t ref) const { return !path_.empty() && path_.back() == ref; }
    void log_insert(const Eigen::Vector3f& p) { log_.push_back({true, p, {}}); }
    void log_erase(const ikd::Region& r) { log_.push_back({false, Eigen::Vector3f::Zero(), r}); }

    bool replaying = false;  ///< rebuild at once, whatever the size

  private:
    void run();

    bool busy_ = false;
    std::vector<std::uint32_t> path_;
    std::vector<Operation> log_;

    std::mutex mutex_;
    std::condition_variable changed_;
    std::vector<Eigen::Vector3f> points_;  ///< guarded: work to do
    Result result_;                        ///< guarded: pool and root only
    bool stop_ = false;                    ///< guarded
    std::thread thread_;                   ///< last: starts when the rest exists
};

}  // namespace d2lio
