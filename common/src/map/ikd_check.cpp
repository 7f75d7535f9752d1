// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "d2lio/map/ikd_tree.hpp"
#include "ikd_background.hpp"
#include "ikd_traverse.hpp"

namespace d2lio {

using ikd::Entry;

namespace {

bool same(const Entry& a, const Entry& b) {
    return a.lo == b.lo && a.hi == b.hi && a.count == b.count;
}

bool leaf_consistent(const ikd::Leaf& leaf, const Entry& e) {
    Entry tight;
    for (std::uint32_t i = 0; i < e.count; ++i) tight.grow(leaf.at(i));
    tight.count = e.count;
    return e.count <= ikd::kBucket && same(tight, e);
}

/// Counts and boxes exact, split planes respected, no empty child, depth within its bound.
bool below_consistent(const ikd::NodePool& pool, const Entry& e, std::size_t level) {
    if (e.count == 0 || level > ikd::kMaxDepth) return false;
    if (e.is_leaf()) return leaf_consistent(pool.leaf(e), e);
    const auto& [left, right] = pool.inner(e).child;
    return same(ikd::join(e.ref, left, right), e) && left.hi[e.axis()] <= right.lo[e.axis()] &&
           below_consistent(pool, left, level + 1) && below_consistent(pool, right, level + 1);
}

}  // namespace

bool IkdTree::consistent() const {
    if (empty()) return true;
    if (!below_consistent(pool_, root_, 1)) return false;
    if (background_) return true;  // may be unbalanced until the second thread is done
    std::vector<std::uint32_t> path;
    Entry found;
    const auto violates = [this](const Entry& e) { return violated(e); };
    return !ikd::find_topmost(pool_, root_, options_.rebuild_min_points, violates, path, found);
}

}  // namespace d2lio
