// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/map/ikd_tree.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "d2lio/config/params.hpp"
#include "ikd_background.hpp"
#include "ikd_traverse.hpp"

namespace d2lio {

using ikd::Entry;

namespace {

void require(bool ok, const std::string& key, double value, const std::string& allowed) {
    if (!ok) throw ConfigError("ikd_tree." + key, std::to_string(value), allowed);
}

void validate(const IkdTreeOptions& o) {
    const double leaf = static_cast<double>(o.downsample_leaf);
    require(leaf > 0.0 && std::isfinite(leaf), "downsample_leaf", leaf, "> 0 m");
    require(o.delete_ratio > 0.0 && o.delete_ratio < 1.0, "delete_ratio", o.delete_ratio, "(0, 1)");
    // Outside this range rebuilding never ends, or the depth bound kMaxDepth does not hold.
    require(o.balance_ratio >= 0.55 && o.balance_ratio <= 0.75, "balance_ratio", o.balance_ratio,
            "[0.55, 0.75]");
    require(o.rebuild_min_points >= 2 * ikd::kBucket && o.rebuild_min_points <= 1024,
            "rebuild_min_points", static_cast<double>(o.rebuild_min_points), "[32, 1024]");
    require(o.background_min_points >= o.rebuild_min_points, "background_min_points",
            static_cast<double>(o.background_min_points), ">= rebuild_min_points");
}

int depth_below(const ikd::NodePool& pool, const Entry& e) {
    if (e.count == 0) return 0;
    if (e.is_leaf()) return 1;
    const ikd::Inner& node = pool.inner(e);
    return 1 + std::max(depth_below(pool, node.child[0]), depth_below(pool, node.child[1]));
}

}  // namespace

IkdTree::IkdTree(const IkdTreeOptions& options) : options_(options) {
    validate(options);
    if (options.background_rebuild) background_ = std::make_unique<Background>();
}

IkdTree::~IkdTree() = default;

std::size_t IkdTree::build(const std::vector<Eigen::Vector3f>& points) {
    clear();
    scratch_.clear();
    std::copy_if(points.begin(), points.end(), std::back_inserter(scratch_),
                 [](const Eigen::Vector3f& p) { return p.allFinite(); });
    root_ = pool_.build(scratch_.data(), scratch_.size());
    return size();
}

void IkdTree::clear() {
    release(root_);
    pool_.clear();
    root_ = Entry{};
}

std::size_t IkdTree::nodes() const {
    std::size_t leaves = 0;
    constexpr float kFar = Entry::kFar;
    ikd::for_each_leaf(pool_, root_, {{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}},
                       [&leaves](const ikd::Leaf&, std::uint32_t) { ++leaves; });
    return leaves == 0 ? 0 : 2 * leaves - 1;  // every inner node has two children
}

std::size_t IkdTree::memory_bytes() const {
    return sizeof(*this) + pool_.memory_bytes() + scratch_.capacity() * sizeof(Eigen::Vector3f);
}

int IkdTree::depth() const { return depth_below(pool_, root_); }

std::vector<Eigen::Vector3f> IkdTree::points() const {
    std::vector<Eigen::Vector3f> out;
    out.reserve(size());
    pool_.collect(root_, out);
    return out;
}

Box IkdTree::bounds() const {
    if (empty()) return {};
    return {Eigen::Vector3f(root_.lo.data()), Eigen::Vector3f(root_.hi.data())};
}

void IkdTree::release(const Entry& e) {
    if (background_) background_->forget(e.ref);
    pool_.release(e);
}

/// A fresh balanced subtree over the points below `e` and, where given, one more.
Entry IkdTree::rebuild(const Entry& e, const Eigen::Vector3f* extra) {
    scratch_.clear();
    pool_.collect(e, scratch_);
    if (extra != nullptr) scratch_.push_back(*extra);
    release(e);
    return pool_.build(scratch_.data(), scratch_.size());
}

/// Balance criterion of the paper (its alpha_bal). Deletions alone never violate it.
bool IkdTree::unbalanced(std::size_t larger_child, std::size_t count, ikd::Wear wear) const {
    return count >= options_.rebuild_min_points &&
           static_cast<double>(larger_child) >
               options_.balance_ratio * static_cast<double>(count + wear.deleted);
}

/// Deletion criterion of the paper (its alpha_del), for what is not cut off anyway.
bool IkdTree::too_empty(std::size_t count, ikd::Wear wear) const {
    return static_cast<double>(wear.holes) >
           options_.delete_ratio * static_cast<double>(count + wear.holes);
}

bool IkdTree::violated(const Entry& e) const {
    const auto& child = pool_.inner(e).child;
    const ikd::Wear wear = pool_.wear(e);
    return too_empty(e.count, wear) ||
           unbalanced(std::max(child[0].count, child[1].count), e.count, wear);
}

/// Whether rebuilding a subtree of this size is left to the second thread.
bool IkdTree::deferred(std::size_t count) const {
    return background_ && !background_->replaying && count >= options_.background_min_points;
}

void IkdTree::poll_background() {
    if (!background_) return;
    if (background_->finished()) exchange_rebuilt();
    if (background_->busy()) return;
    std::vector<std::uint32_t> path;
    Entry worst;
    const auto violates = [this](const Entry& e) { return violated(e); };
    if (!ikd::find_topmost(pool_, root_, options_.background_min_points, violates, path, worst)) {
        return;
    }
    std::vector<Eigen::Vector3f> points;
    points.reserve(worst.count);
    pool_.collect(worst, points);
    background_->start(std::move(points), std::move(path));
}

void IkdTree::finish_background() {
    if (!background_) return;
    background_->wait();
    if (background_->finished()) exchange_rebuilt();
}

/// Puts the rebuilt subtree in the place of the watched one, brought up to date by its log.
void IkdTree::exchange_rebuilt() {
    const Background::Result result = background_->take();
    if (result.path.empty()) return;  // the subtree went away meanwhile
    Entry fresh = pool_.adopt(*result.pool, result.root);
    background_->replaying = true;
    for (const Background::Operation& op : result.log) {
        if (op.is_insert) {
            insert_at(fresh, op.point);
        } else {
            fresh = erase_at(fresh, op.region);
        }
    }
    background_->replaying = false;
    Entry* place = &root_;
    for (std::size_t i = 1; i < result.path.size(); ++i) {
        auto& child = pool_.inner(*place).child;
        place = child[0].ref == result.path[i] ? &child[0] : &child[1];
    }
    pool_.release(*place);
    *place = fresh;
}

}  // namespace d2lio
