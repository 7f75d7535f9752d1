// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "d2lio/map/box.hpp"
#include "d2lio/map/ikd_nodes.hpp"

namespace d2lio {

/// One stored point found by a search.
struct Neighbour {
    float x, y, z;  ///< m
    float sq_dist;  ///< squared distance to the query, m^2

    Eigen::Vector3f point() const { return {x, y, z}; }
};

/// Result of a k-nearest search, ascending by distance; fixed storage, left uninitialised.
struct Neighbours {
    static constexpr int kMax = 32;
    int count = 0;
    std::array<Neighbour, kMax> items;

    const Neighbour& operator[](int i) const { return items[static_cast<std::size_t>(i)]; }
};

struct IkdTreeOptions {
    float downsample_leaf = 0.5F;              ///< side of a down-sampling voxel, m, > 0
    double delete_ratio = 0.5;                 ///< share of emptied slots a subtree bears, (0, 1)
    double balance_ratio = 0.6;                ///< largest share of one child, [0.55, 0.75]
    std::size_t rebuild_min_points = 32;       ///< smaller subtrees may be unbalanced, 16..1024
    bool background_rebuild = false;           ///< rebuild large subtrees in a second thread
    std::size_t background_min_points = 1500;  ///< what counts as large, >= rebuild_min_points
};

/// What became of the points given to IkdTree::insert.
struct InsertReport {
    std::size_t added = 0;       ///< entered the tree
    std::size_t removed = 0;     ///< stored points that gave way to a new one of their voxel
    std::size_t not_nearer = 0;  ///< not added: the voxel has a point nearer to its centre
    std::size_t non_finite = 0;  ///< NaN or infinite, ignored
};

/// Incremental k-d tree with down-sampling on the tree, box-wise lazy deletion and partial
/// rebuilding (Cai, Xu, Zhang 2021, "ikd-Tree"; Xu et al. 2022, "FAST-LIO2", section V).
///
/// Unlike the paper's one point per node, points lie in leaf buckets and a parent holds both
/// children's boxes. With the points deleted since its last rebuild counted in, a subtree is
/// rebuilt when one child holds more than `balance_ratio` of it, or `delete_ratio` of it went out
/// of leaves that stayed. A subtree wholly inside a deleted box is cut off in O(1) and leaves
/// nothing behind.
///
/// Any number of threads may call const members at a time, but none while another thread is in a
/// non-const one. The second thread of `background_rebuild` never touches the live tree: it works
/// on a copy of a subtree's points, and the next non-const call exchanges the subtree after
/// replaying what happened to it meanwhile. Search results depend on the stored points only, not on
/// the shape of the tree: equal distances are ordered by x, y, z.
class IkdTree {
  public:
    /// @throws ConfigError for an option outside its range.
    explicit IkdTree(const IkdTreeOptions& options = {});
    ~IkdTree();
    IkdTree(const IkdTree&) = delete;
    IkdTree& operator=(const IkdTree&) = delete;

    /// Replaces the content. Non-finite points are ignored; returns how many were stored.
    std::size_t build(const std::vector<Eigen::Vector3f>& points);
    /// Adds points one by one. With `downsample`, of every touched voxel exactly the point nearest
    /// to its centre stays (paper, algorithm 2), whatever the order of insertion.
    InsertReport insert(const std::vector<Eigen::Vector3f>& points, bool downsample);
    /// Removes every stored point equal to one given; returns how many were removed.
    std::size_t erase(const std::vector<Eigen::Vector3f>& points);
    std::size_t erase_box(const Box& box);
    std::size_t erase_boxes(const std::vector<Box>& boxes);
    void clear();

    /// The up to `k` nearest points with squared distance <= `max_sq_dist`, k in 1..32 (clamped).
    /// A non-finite query finds nothing. No allocation.
    void knn(const Eigen::Vector3f& query, int k, float max_sq_dist, Neighbours& out) const;
    /// The same into storage for `k` of any number; returns how many were found.
    int knn(const Eigen::Vector3f& query, int k, float max_sq_dist, Neighbour* out) const;
    /// All points with distance <= `radius` m, ascending; returns their number.
    std::size_t radius_search(const Eigen::Vector3f& query, float radius,
                              std::vector<Neighbour>& out) const;
    /// All points in the box, in no particular order; returns their number.
    std::size_t box_search(const Box& box, std::vector<Eigen::Vector3f>& out) const;

    std::size_t size() const { return root_.count; }
    bool empty() const { return root_.count == 0; }
    std::size_t nodes() const;  ///< inner nodes and leaves in use
    std::size_t memory_bytes() const;
    int depth() const;  ///< levels, a lone leaf is 1; 0 when empty
    /// All stored points, in no particular order.
    std::vector<Eigen::Vector3f> points() const;
    /// Smallest and largest coordinates, both attained (max belongs to it); zeros when empty.
    Box bounds() const;
    const IkdTreeOptions& options() const { return options_; }

    /// Waits for a background rebuild under way and takes its result in.
    void finish_background();
    /// Checks every structural invariant; for tests.
    bool consistent() const;

  private:
    struct Background;

    void insert_downsampled(const Eigen::Vector3f& p, InsertReport& report);
    void insert_at(ikd::Entry& root, const Eigen::Vector3f& p);
    std::size_t erase_region(const ikd::Region& region);
    ikd::Entry erase_at(ikd::Entry e, const ikd::Region& region);
    ikd::Entry erase_in_leaf(ikd::Entry e, const ikd::Region& region);
    ikd::Entry repair(std::uint32_t ref, ikd::Wear wear);
    ikd::Entry rebuild(const ikd::Entry& e, const Eigen::Vector3f* extra);
    void release(const ikd::Entry& e);

    bool unbalanced(std::size_t larger_child, std::size_t count, ikd::Wear wear) const;
    bool too_empty(std::size_t count, ikd::Wear wear) const;
    bool violated(const ikd::Entry& e) const;
    bool deferred(std::size_t count) const;
    void poll_background();
    void exchange_rebuilt();

    IkdTreeOptions options_;
    ikd::NodePool pool_;
    ikd::Entry root_;
    std::vector<Eigen::Vector3f> scratch_;
    std::uint32_t taken_from_leaves_ = 0;  ///< running count, modulo 2^32
    std::unique_ptr<Background> background_;
};

}  // namespace d2lio
