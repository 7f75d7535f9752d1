// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <tuple>

#include "d2lio/map/ikd_tree.hpp"
#include "ikd_background.hpp"
#include "ikd_traverse.hpp"

namespace d2lio {

using ikd::Entry;
using ikd::Region;

namespace {

constexpr float kFar = Entry::kFar;

/// Half-open to closed: the largest float below `max` is the last one inside.
Region closed_region(const Box& box) {
    Region r{};
    for (unsigned a = 0; a < 3; ++a) {
        r.lo[a] = box.min[static_cast<Eigen::Index>(a)];
        r.hi[a] = std::nextafter(box.max[static_cast<Eigen::Index>(a)], -kFar);
    }
    return r;
}

bool is_empty(const Box& box) { return !(box.min.array() < box.max.array()).all(); }

struct Voxel {
    Region region;
    Eigen::Vector3d centre;  ///< m
};

/// The voxel of a point. Its borders are the floats nearest to i * leaf, which makes membership
/// exact in float; doubles keep huge coordinates from overflowing. Where float is too coarse for
/// the leaf every coordinate is a voxel of its own.
Voxel voxel_of(const Eigen::Vector3f& p, float leaf_size) {
    const double leaf = static_cast<double>(leaf_size);
    Voxel v;
    for (unsigned a = 0; a < 3; ++a) {
        const float x = p[static_cast<Eigen::Index>(a)];
        const auto border = [leaf](double i) { return static_cast<float>(i * leaf); };
        double i = std::floor(static_cast<double>(x) / leaf);
        if (x < border(i)) i -= 1.0;
        if (x >= border(i + 1.0)) i += 1.0;
        v.region.lo[a] = std::min(border(i), x);
        v.region.hi[a] = std::max(std::nextafter(border(i + 1.0), -kFar), x);
        v.centre[static_cast<Eigen::Index>(a)] = (i + 0.5) * leaf;
    }
    return v;
}

/// Order of preference inside a voxel; coordinates decide between equal distances.
struct Candidate {
    double sq_dist;
    Eigen::Vector3f p;

    bool operator<(const Candidate& o) const {
        return std::tie(sq_dist, p.x(), p.y(), p.z()) <
               std::tie(o.sq_dist, o.p.x(), o.p.y(), o.p.z());
    }
};

/// Which child a point belongs to: the one whose side of the gap is nearer; the lighter of two that
/// both end at the point, so that duplicates spread evenly.
unsigned side_of(const ikd::Inner& node, std::uint32_t axis, const Eigen::Vector3f& p) {
    const float v = p[static_cast<Eigen::Index>(axis)];
    const float beyond_left = v - node.child[0].hi[axis];
    const float before_right = node.child[1].lo[axis] - v;
    if (beyond_left < before_right) return 0;
    if (beyond_left > before_right) return 1;
    return node.child[0].count <= node.child[1].count ? 0 : 1;
}

}  // namespace

InsertReport IkdTree::insert(const std::vector<Eigen::Vector3f>& points, bool downsample) {
    InsertReport report;
    poll_background();
    for (const Eigen::Vector3f& p : points) {
        if (!p.allFinite()) {
            ++report.non_finite;
        } else if (downsample) {
            insert_downsampled(p, report);
        } else {
            insert_at(root_, p);
            ++report.added;
        }
    }
    poll_background();
    return report;
}

/// Algorithm 2 of the paper.
void IkdTree::insert_downsampled(const Eigen::Vector3f& p, InsertReport& report) {
    const Voxel voxel = voxel_of(p, options_.downsample_leaf);
    const auto candidate = [&voxel](const Eigen::Vector3f& q) {
        return Candidate{(q.cast<double>() - voxel.centre).squaredNorm(), q};
    };
    Candidate best{std::numeric_limits<double>::infinity(), p};
    std::size_t present = 0;
    ikd::for_each_leaf(pool_, root_, voxel.region, [&](const ikd::Leaf& leaf, std::uint32_t n) {
        for (std::uint32_t i = 0; i < n; ++i) {
            if (!voxel.region.contains(leaf.c[0][i], leaf.c[1][i], leaf.c[2][i])) continue;
            const Candidate stored = candidate(leaf.at(i));
            if (present++ == 0 || stored < best) best = stored;
        }
    });
    const bool wins = present == 0 || candidate(p) < best;
    ++(wins ? report.added : report.not_nearer);
    if (!wins && present == 1) return;
    if (present > 0) {
        erase_region(voxel.region);
        report.removed += wins ? present : present - 1;
    }
    insert_at(root_, wins ? p : best.p);
}

void IkdTree::insert_at(Entry& root, const Eigen::Vector3f& p) {
    Entry* e = &root;
    std::uint32_t parent = 0;  // of `e`, with the side below it
    unsigned side = 0;
    std::size_t depth = 0;
    while (e->count > 0) {
        if (background_ && background_->watches(e->ref)) background_->log_insert(p);
        if (e->is_leaf()) {
            if (e->count == ikd::kBucket) break;  // to be split
            pool_.leaf(*e).put(e->count++, p);
            e->grow(p);
            return;
        }
        ikd::Inner& node = pool_.inner(*e);
        const unsigned next = side_of(node, e->axis(), p);
        ikd::Wear& wear = pool_.wear(*e);
        wear.mend();
        const std::uint32_t larger =
            std::max(node.child[next].count + 1, node.child[1 - next].count);
        if (unbalanced(larger, e->count + 1, wear) && !deferred(e->count)) break;
        if (++depth > ikd::kRescueDepth) {
            root = rebuild(root, &p);
            return;
        }
        parent = e->index();
        side = next;
        e->grow(p);
        ++e->count;
        e = &node.child[next];
    }
    const Entry fresh = rebuild(*e, &p);  // `e` may dangle from here: the pool may grow
    (depth == 0 ? root : pool_.inner(parent).child[side]) = fresh;
}

std::size_t IkdTree::erase(const std::vector<Eigen::Vector3f>& points) {
    std::size_t removed = 0;
    poll_background();
    for (const Eigen::Vector3f& p : points) {
        if (!p.allFinite()) continue;
        const std::array<float, 3> c{p.x(), p.y(), p.z()};
        removed += erase_region({c, c});
    }
    poll_background();
    return removed;
}

std::size_t IkdTree::erase_box(const Box& box) {
    poll_background();
    const std::size_t removed = is_empty(box) ? 0 : erase_region(closed_region(box));
    poll_background();
    return removed;
}

std::size_t IkdTree::erase_boxes(const std::vector<Box>& boxes) {
    std::size_t removed = 0;
    for (const Box& box : boxes) removed += erase_box(box);
    return removed;
}

std::size_t IkdTree::erase_region(const Region& region) {
    const std::size_t before = size();
    root_ = erase_at(root_, region);
    return before - size();
}

/// The subtree `e` without the points in the region; covered subtrees go as a whole.
Entry IkdTree::erase_at(Entry e, const Region& region) {
    if (e.count == 0 || e.disjoint(region)) return e;
    if (e.inside(region)) {
        release(e);
        return {};
    }
    if (background_ && background_->watches(e.ref)) background_->log_erase(region);
    if (e.is_leaf()) return erase_in_leaf(e, region);
    const std::uint32_t taken_before = taken_from_leaves_;
    std::uint32_t left = 0;
    for (unsigned side = 0; side < 2; ++side) {
        const Entry child = erase_at(pool_.inner(e).child[side], region);
        pool_.inner(e).child[side] = child;
        left += child.count;
    }
    return left == e.count ? e : repair(e.ref, {e.count - left, taken_from_leaves_ - taken_before});
}

Entry IkdTree::erase_in_leaf(Entry e, const Region& region) {
    ikd::Leaf& leaf = pool_.leaf(e);
    Entry kept;
    kept.ref = e.ref;
    for (std::uint32_t i = 0; i < e.count; ++i) {
        const Eigen::Vector3f p = leaf.at(i);
        if (region.contains(p.x(), p.y(), p.z())) continue;
        leaf.put(kept.count++, p);
        kept.grow(p);
    }
    taken_from_leaves_ += e.count - kept.count;
    return kept;
}

/// Pulls up what the children of an inner node became, and rebuilds where a criterion is violated.
Entry IkdTree::repair(std::uint32_t ref, ikd::Wear wear) {
    Entry e;
    e.ref = ref;
    const std::array<Entry, 2> child = pool_.inner(e).child;
    for (unsigned side = 0; side < 2; ++side) {
        if (child[side].count > 0) continue;
        if (background_) background_->forget(ref);
        pool_.release_inner(e.index());
        return child[1 - side];
    }
    e = ikd::join(ref, child[0], child[1]);
    pool_.wear(e).deleted += wear.deleted;
    pool_.wear(e).holes += wear.holes;
    return violated(e) && !deferred(e.count) ? rebuild(e, nullptr) : e;
}

}  // namespace d2lio
