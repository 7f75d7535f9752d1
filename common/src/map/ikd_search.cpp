// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <tuple>

#include "d2lio/map/ikd_tree.hpp"
#include "ikd_traverse.hpp"

namespace d2lio {

using ikd::Entry;
using ikd::kBucket;

namespace {

/// Coordinates in a vector register. The fourth lane is idle; 1 keeps it away from denormals, which
/// some processors multiply slowly.
using Query = Eigen::Array4f;

Query query_of(const Eigen::Vector3f& p) { return {p.x(), p.y(), p.z(), 1.F}; }

/// Nearer first; the coordinates order equal distances, whatever the shape of the tree.
inline bool before(const Neighbour& a, const Neighbour& b) {
    if (a.sq_dist != b.sq_dist) return a.sq_dist < b.sq_dist;
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

/// One corner of a box, with whatever follows it in the Entry in the idle lane.
inline Eigen::Array4f corner(const Entry& e, std::size_t offset) {
    static_assert(offsetof(Entry, lo) == 0 && offsetof(Entry, hi) == 16 && sizeof(Entry) == 32,
                  "a corner is the first three of four lanes");
    Eigen::Array4f lanes;
    std::memcpy(lanes.data(), reinterpret_cast<const unsigned char*>(&e) + offset, sizeof(lanes));
    return lanes;
}

inline float box_distance(const Entry& e, const Query& q) {
    const Eigen::Array4f beyond = (corner(e, 0) - q).max(q - corner(e, 16)).max(0.F);
    const Eigen::Array4f sq = beyond * beyond;
    return (sq[0] + sq[1]) + sq[2];  // the order of squared_norm
}

inline void leaf_distances(const ikd::Leaf& leaf, const Query& q, float* sq_dist) {
    for (unsigned i = 0; i < kBucket; ++i) {
        sq_dist[i] =
            ikd::squared_norm(leaf.c[0][i] - q[0], leaf.c[1][i] - q[1], leaf.c[2][i] - q[2]);
    }
}

/// Keeps the k best in ascending order.
class Best {
  public:
    Best(Neighbour* items, int k, float max_sq_dist) : items_(items), k_(k), worst_(max_sq_dist) {}
    int count() const { return count_; }
    /// Points and boxes farther than this cannot change the result.
    float worst() const { return worst_; }

    void offer(const Neighbour& n) {
        int i = count_;
        if (i < k_) {
            ++count_;
        } else if (before(n, items_[k_ - 1])) {
            i = k_ - 1;
        } else {
            return;
        }
        for (; i > 0 && before(n, items_[i - 1]); --i) items_[i] = items_[i - 1];
        items_[i] = n;
        if (count_ == k_) worst_ = items_[k_ - 1].sq_dist;
    }

  private:
    Neighbour* items_;
    int k_, count_ = 0;
    float worst_;
};

inline void scan_leaf(const ikd::Leaf& leaf, std::uint32_t count, const Query& q, Best& best) {
    alignas(16) std::array<float, kBucket> sq_dist;
    leaf_distances(leaf, q, sq_dist.data());
    for (std::uint32_t i = 0; i < count; ++i) {
        if (sq_dist[i] <= best.worst()) {
            best.offer({leaf.c[0][i], leaf.c[1][i], leaf.c[2][i], sq_dist[i]});
        }
    }
}

struct Pending {
    const Entry* entry;
    float sq_dist;
};

}  // namespace

void IkdTree::knn(const Eigen::Vector3f& query, int k, float max_sq_dist, Neighbours& out) const {
    out.count = knn(query, std::clamp(k, 1, Neighbours::kMax), max_sq_dist, out.items.data());
}

int IkdTree::knn(const Eigen::Vector3f& query, int k, float max_sq_dist, Neighbour* out) const {
    if (k < 1 || empty() || !query.allFinite()) return 0;
    Best best(out, k, max_sq_dist);
    const Query q = query_of(query);
    std::array<Pending, ikd::kMaxDepth> stack;
    std::size_t top = 0;
    stack[top++] = {&root_, box_distance(root_, q)};
    while (top > 0) {
        const Pending next = stack[--top];
        if (!(next.sq_dist <= best.worst())) continue;
        const Entry* e = next.entry;
        while (!e->is_leaf()) {
            const auto& child = pool_.inner(*e).child;
            const float d0 = box_distance(child[0], q), d1 = box_distance(child[1], q);
            const unsigned near = d1 < d0 ? 1 : 0;
            const float far = std::max(d0, d1);
            if (far <= best.worst()) stack[top++] = {&child[1 - near], far};
            e = &child[near];
        }
        scan_leaf(pool_.leaf(*e), e->count, q, best);
    }
    return best.count();
}

std::size_t IkdTree::radius_search(const Eigen::Vector3f& query, float radius,
                                   std::vector<Neighbour>& out) const {
    out.clear();
    if (!query.allFinite() || !(radius >= 0.0F)) return 0;
    const Query q = query_of(query);
    const float sq_radius = radius * radius;
    // Slack of a few roundings: the box only preselects.
    const float reach = std::nextafter(radius * 1.000001F, Entry::kFar);
    ikd::Region region{};
    for (unsigned a = 0; a < 3; ++a) {
        const float v = query[static_cast<Eigen::Index>(a)];
        region.lo[a] = std::nextafter(v - reach, -Entry::kFar);
        region.hi[a] = std::nextafter(v + reach, Entry::kFar);
    }
    ikd::for_each_leaf(pool_, root_, region, [&](const ikd::Leaf& leaf, std::uint32_t n) {
        std::array<float, kBucket> sq_dist;
        leaf_distances(leaf, q, sq_dist.data());
        for (std::uint32_t i = 0; i < n; ++i) {
            if (sq_dist[i] > sq_radius) continue;
            out.push_back({leaf.c[0][i], leaf.c[1][i], leaf.c[2][i], sq_dist[i]});
        }
    });
    std::sort(out.begin(), out.end(), before);
    return out.size();
}

std::size_t IkdTree::box_search(const Box& box, std::vector<Eigen::Vector3f>& out) const {
    out.clear();
    const ikd::Region region{{box.min.x(), box.min.y(), box.min.z()},
                             {box.max.x(), box.max.y(), box.max.z()}};
    ikd::for_each_leaf(pool_, root_, region, [&](const ikd::Leaf& leaf, std::uint32_t n) {
        for (std::uint32_t i = 0; i < n; ++i) {
            const Eigen::Vector3f p = leaf.at(i);
            if (box.contains(p)) out.push_back(p);
        }
    });
    return out.size();
}

}  // namespace d2lio
