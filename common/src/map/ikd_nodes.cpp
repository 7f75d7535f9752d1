// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/map/ikd_nodes.hpp"

#include <algorithm>

namespace d2lio::ikd {

namespace {

Entry bounds_of(const Eigen::Vector3f* points, std::size_t n) {
    Entry e;
    for (std::size_t i = 0; i < n; ++i) e.grow(points[i]);
    e.count = static_cast<std::uint32_t>(n);
    return e;
}

std::uint32_t widest_axis(const Entry& e) {
    std::uint32_t axis = 0;
    for (std::uint32_t a = 1; a < 3; ++a) {
        // Halves: the extent of opposite huge coordinates would overflow.
        if (0.5F * e.hi[a] - 0.5F * e.lo[a] > 0.5F * e.hi[axis] - 0.5F * e.lo[axis]) axis = a;
    }
    return axis;
}

template <int kAxis>
void split_by(Eigen::Vector3f* first, Eigen::Vector3f* middle, Eigen::Vector3f* last) {
    std::nth_element(first, middle, last, [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
        return a[kAxis] < b[kAxis];
    });
}

void split_at_median(Eigen::Vector3f* points, std::size_t n, std::uint32_t axis) {
    Eigen::Vector3f* const middle = points + n / 2;
    switch (axis) {
        case 0:
            return split_by<0>(points, middle, points + n);
        case 1:
            return split_by<1>(points, middle, points + n);
        default:
            return split_by<2>(points, middle, points + n);
    }
}

}  // namespace

Entry join(std::uint32_t ref, const Entry& left, const Entry& right) {
    Entry e;
    e.ref = ref;
    e.count = left.count + right.count;
    for (unsigned a = 0; a < 3; ++a) {
        e.lo[a] = std::min(left.lo[a], right.lo[a]);
        e.hi[a] = std::max(left.hi[a], right.hi[a]);
    }
    return e;
}

Entry NodePool::build_leaf(const Eigen::Vector3f* points, std::size_t n) {
    Entry e = bounds_of(points, n);
    const std::uint32_t index = new_leaf();
    e.ref = Entry::kLeafBit | index;
    for (std::uint32_t i = 0; i < e.count; ++i) leaves_[index].put(i, points[i]);
    return e;
}

Entry NodePool::build(Eigen::Vector3f* points, std::size_t n) {
    if (n == 0) return {};
    if (n <= kBucket) return build_leaf(points, n);
    const std::uint32_t axis = widest_axis(bounds_of(points, n));
    split_at_median(points, n, axis);
    const std::uint32_t index = new_inner();
    const Entry left = build(points, n / 2);
    const Entry right = build(points + n / 2, n - n / 2);
    inners_[index].child = {left, right};
    return join(index | (axis << Entry::kAxisShift), left, right);
}

Entry NodePool::adopt(const NodePool& other, const Entry& root) {
    if (root.count == 0) return {};
    Entry e = root;
    if (root.is_leaf()) {
        const std::uint32_t index = new_leaf();
        leaves_[index] = other.leaf(root);
        e.ref = Entry::kLeafBit | index;
        return e;
    }
    const std::uint32_t index = new_inner();
    const Entry left = adopt(other, other.inner(root).child[0]);
    const Entry right = adopt(other, other.inner(root).child[1]);
    inners_[index].child = {left, right};
    e.ref = index | (root.axis() << Entry::kAxisShift);
    return e;
}

void NodePool::collect(const Entry& root, std::vector<Eigen::Vector3f>& out) const {
    if (root.count == 0) return;
    if (!root.is_leaf()) {
        for (const Entry& child : inner(root).child) collect(child, out);
        return;
    }
    const Leaf& bucket = leaf(root);
    for (std::uint32_t i = 0; i < root.count; ++i) out.push_back(bucket.at(i));
}

void NodePool::release(const Entry& root) {
    if (root.count > 0) released_.push_back(root.ref);
}

void NodePool::clear() {
    inners_.clear();
    wear_.clear();
    leaves_.clear();
    free_inners_.clear();
    free_leaves_.clear();
    released_.clear();
}

std::size_t NodePool::memory_bytes() const {
    const std::size_t indices =
        free_inners_.capacity() + free_leaves_.capacity() + released_.capacity();
    return inners_.capacity() * sizeof(Inner) + leaves_.capacity() * sizeof(Leaf) +
           wear_.capacity() * sizeof(Wear) + indices * sizeof(std::uint32_t);
}

/// Takes released subtrees apart until a node of the wanted kind turns up; kIndexMask if none does.
std::uint32_t NodePool::take_apart(bool want_leaf) {
    while (!released_.empty()) {
        Entry e;
        e.ref = released_.back();
        released_.pop_back();
        if (!e.is_leaf()) {
            for (const Entry& child : inner(e).child) released_.push_back(child.ref);
        }
        if (e.is_leaf() == want_leaf) return e.index();
        (e.is_leaf() ? free_leaves_ : free_inners_).push_back(e.index());
    }
    return Entry::kIndexMask;
}

std::uint32_t NodePool::new_inner() {
    std::uint32_t index = Entry::kIndexMask;
    if (free_inners_.empty()) {
        index = take_apart(false);
    } else {
        index = free_inners_.back();
        free_inners_.pop_back();
    }
    if (index == Entry::kIndexMask) {
        index = static_cast<std::uint32_t>(inners_.size());
        inners_.emplace_back();
        wear_.emplace_back();
    }
    wear_[index] = Wear{};
    return index;
}

std::uint32_t NodePool::new_leaf() {
    std::uint32_t index = Entry::kIndexMask;
    if (free_leaves_.empty()) {
        index = take_apart(true);
    } else {
        index = free_leaves_.back();
        free_leaves_.pop_back();
    }
    if (index == Entry::kIndexMask) {
        index = static_cast<std::uint32_t>(leaves_.size());
        leaves_.emplace_back();
    }
    return index;
}

}  // namespace d2lio::ikd
