// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "ikd_background.hpp"

#include <algorithm>
#include <utility>

namespace d2lio {

IkdTree::Background::Background() : thread_([this] { run(); }) {}

IkdTree::Background::~Background() {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void IkdTree::Background::start(std::vector<Eigen::Vector3f> points,
                                std::vector<std::uint32_t> path) {
    busy_ = true;
    path_ = std::move(path);
    log_.clear();
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        points_ = std::move(points);
    }
    changed_.notify_all();
}

bool IkdTree::Background::finished() {
    if (!busy_) return false;
    const std::lock_guard<std::mutex> lock(mutex_);
    return result_.pool != nullptr;
}

void IkdTree::Background::wait() {
    if (!busy_) return;
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return result_.pool != nullptr; });
}

IkdTree::Background::Result IkdTree::Background::take() {
    Result out;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        out.pool = std::move(result_.pool);
        out.root = result_.root;
    }
    out.path = std::move(path_);
    out.log = std::move(log_);
    path_.clear();
    log_.clear();
    busy_ = false;
    return out;
}

void IkdTree::Background::forget(std::uint32_t ref) {
    if (std::find(path_.begin(), path_.end(), ref) == path_.end()) return;
    path_.clear();
    log_.clear();
}

void IkdTree::Background::run() {
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stop_ || !points_.empty(); });
        if (stop_) return;
        std::vector<Eigen::Vector3f> points = std::move(points_);
        points_.clear();
        lock.unlock();
        auto pool = std::make_unique<ikd::NodePool>();
        const ikd::Entry root = pool->build(points.data(), points.size());
        lock.lock();
        result_.root = root;
        result_.pool = std::move(pool);
        changed_.notify_all();
    }
}

}  // namespace d2lio
