// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "d2lio/map/ikd_nodes.hpp"

namespace d2lio::ikd {

/// No tree gets deeper: balance_ratio bounds the depth to about 100 for 2^32 points, and an
/// insertion that meets more than kRescueDepth levels (possible while a background rebuild is under
/// way) rebuilds the whole tree at once. A subtree exchanged below that depth adds at most 40.
constexpr std::size_t kRescueDepth = 128, kMaxDepth = 192;

/// Squared distance in a fixed order of operations. Rounding is monotonic, so the distance to a box
/// never exceeds that to a point inside it, and pruning is exact also in float.
inline float squared_norm(float dx, float dy, float dz) { return (dx * dx + dy * dy) + dz * dz; }

/// Calls visit(leaf, count) for every leaf whose box meets the region.
template <typename Visit>
void for_each_leaf(const NodePool& pool, const Entry& root, const Region& region, Visit&& visit) {
    std::array<const Entry*, kMaxDepth> stack;
    std::size_t top = 0;
    const Entry* e = &root;
    if (e->count == 0 || e->disjoint(region)) return;
    for (;;) {
        if (e->is_leaf()) {
            visit(pool.leaf(*e), e->count);
            if (top == 0) return;
            e = stack[--top];
            continue;
        }
        const Inner& node = pool.inner(*e);
        const bool left = !node.child[0].disjoint(region), right = !node.child[1].disjoint(region);
        if (left && right) stack[top++] = &node.child[1];
        if (!left && !right) {
            if (top == 0) return;
            e = stack[--top];
        } else {
            e = &node.child[left ? 0 : 1];
        }
    }
}

/// The topmost inner node with at least `min_points` for which violates(entry) holds: true and the
/// refs from the root down to it in `path`, the node itself in `found`.
template <typename Violates>
bool find_topmost(const NodePool& pool, const Entry& e, std::size_t min_points,
                  const Violates& violates, std::vector<std::uint32_t>& path, Entry& found) {
    if (e.count < min_points || e.is_leaf()) return false;
    path.push_back(e.ref);
    if (violates(e)) {
        found = e;
        return true;
    }
    for (const Entry& child : pool.inner(e).child) {
        if (find_topmost(pool, child, min_points, violates, path, found)) return true;
    }
    path.pop_back();
    return false;
}

}  // namespace d2lio::ikd
