// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace d2lio::ikd {

constexpr std::uint32_t kBucket = 16;  ///< points a leaf can hold

/// Closed box of float coordinates; every region the tree deletes is one.
struct Region {
    std::array<float, 3> lo, hi;  ///< m

    bool contains(float x, float y, float z) const {
        return x >= lo[0] && x <= hi[0] && y >= lo[1] && y <= hi[1] && z >= lo[2] && z <= hi[2];
    }
};

/// A subtree as its parent sees it: tight bounding box, number of points, and where its root is.
/// A search decides from this alone, so a pruned subtree is never touched.
struct Entry {
    static constexpr float kFar = std::numeric_limits<float>::infinity();
    static constexpr std::uint32_t kLeafBit = 1U << 31, kAxisShift = 29,
                                   kIndexMask = (1U << 29) - 1;

    std::array<float, 3> lo{kFar, kFar, kFar};     ///< m
    std::uint32_t ref = kLeafBit | kIndexMask;     ///< leaf bit, split axis (2 bits), pool index
    std::array<float, 3> hi{-kFar, -kFar, -kFar};  ///< m
    std::uint32_t count = 0;                       ///< points below; 0 has no node at all

    bool is_leaf() const { return (ref & kLeafBit) != 0; }
    std::uint32_t index() const { return ref & kIndexMask; }
    std::uint32_t axis() const { return (ref >> kAxisShift) & 3U; }

    void grow(const Eigen::Vector3f& p) {
        for (unsigned a = 0; a < 3; ++a) {
            const float v = p[static_cast<Eigen::Index>(a)];
            lo[a] = v < lo[a] ? v : lo[a];
            hi[a] = v > hi[a] ? v : hi[a];
        }
    }
    bool disjoint(const Region& r) const {
        return hi[0] < r.lo[0] || lo[0] > r.hi[0] || hi[1] < r.lo[1] || lo[1] > r.hi[1] ||
               hi[2] < r.lo[2] || lo[2] > r.hi[2];
    }
    bool inside(const Region& r) const {
        return r.contains(lo[0], lo[1], lo[2]) && r.contains(hi[0], hi[1], hi[2]);
    }
};

/// One cache line: both children with their boxes. Along the split axis the left box ends no later
/// than the right one begins; points equal to the split may be on either side.
struct alignas(64) Inner {
    std::array<Entry, 2> child;
};
static_assert(sizeof(Inner) == 64, "an inner node is one cache line");

/// Coordinates by axis, so that the distances of a bucket are one vector loop. How many are in use
/// stands in the Entry.
struct alignas(64) Leaf {
    std::array<std::array<float, kBucket>, 3> c{};  ///< m

    Eigen::Vector3f at(std::uint32_t i) const { return {c[0][i], c[1][i], c[2][i]}; }
    void put(std::uint32_t i, const Eigen::Vector3f& p) {
        c[0][i] = p.x();
        c[1][i] = p.y();
        c[2][i] = p.z();
    }
};

/// What deletions did below an inner node since it was built; later insertions make up for them.
struct Wear {
    std::uint32_t deleted = 0;  ///< points; with those left it is the paper's tree size
    std::uint32_t holes = 0;    ///< of them taken out of leaves that stayed, not cut off as a whole

    void mend() {
        deleted -= deleted > 0 ? 1 : 0;
        holes -= holes > 0 ? 1 : 0;
    }
};

/// Contiguous storage of the nodes of one tree. A released subtree is put aside as a whole in O(1)
/// and taken apart one node at a time as later allocations need nodes (the lazy deletion of the
/// paper). Capacity is kept: memory is bounded by the largest tree seen.
class NodePool {
  public:
    /// Balanced tree over `n` points by median splits along the widest axis; reorders `points`.
    Entry build(Eigen::Vector3f* points, std::size_t n);
    /// Copies a subtree of another pool into this one.
    Entry adopt(const NodePool& other, const Entry& root);
    /// Appends the points below `root`.
    void collect(const Entry& root, std::vector<Eigen::Vector3f>& out) const;
    void release(const Entry& root);
    /// Releases one inner node whose children are not (or no longer) its own.
    void release_inner(std::uint32_t index) { free_inners_.push_back(index); }
    void clear();

    const Inner& inner(const Entry& e) const { return inners_[e.index()]; }
    Inner& inner(const Entry& e) { return inners_[e.index()]; }
    const Leaf& leaf(const Entry& e) const { return leaves_[e.index()]; }
    Leaf& leaf(const Entry& e) { return leaves_[e.index()]; }

    Inner& inner(std::uint32_t index) { return inners_[index]; }
    Wear& wear(const Entry& e) { return wear_[e.index()]; }
    const Wear& wear(const Entry& e) const { return wear_[e.index()]; }
    /// Bytes reserved, in use or not.
    std::size_t memory_bytes() const;

  private:
    std::uint32_t new_inner();
    std::uint32_t new_leaf();
    std::uint32_t take_apart(bool want_leaf);
    Entry build_leaf(const Eigen::Vector3f* points, std::size_t n);

    std::vector<Inner> inners_;
    std::vector<Wear> wear_;  ///< of each inner node; apart, as searches do not need it
    std::vector<Leaf> leaves_;
    std::vector<std::uint32_t> free_inners_, free_leaves_;
    std::vector<std::uint32_t> released_;  ///< refs of whole subtrees not yet taken apart
};

/// Entry that describes the union of the two children of inner node `ref`.
Entry join(std::uint32_t ref, const Entry& left, const Entry& right);

}  // namespace d2lio::ikd
