// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/host/point_loop.hpp"
#include "d2lio/host/stop_watch.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "ieskf.hpp"
#include "nearest.hpp"

namespace d2lio::fastlio {

/// Point-to-plane measurement of one scan against the map: FAST-LIO2's h, with the adapter deciding
/// on every correspondence and adding its rows.
class ScanMatcher {
  public:
    ScanMatcher(Adapter& adapter, bool extrinsic_est, double variance, int threads);

    /// @param points down-sampled scan, LiDAR frame at scan end; must outlive the matching.
    void begin(const std::vector<Eigen::Vector3f>& points, const IkdTree& tree);
    /// The measurement at x; false when no point was accepted.
    bool measure(const NavState& x, bool search, Linearisation& out);
    /// Moves all points to the map frame under x.
    const std::vector<Eigen::Vector3f>& to_map(const NavState& x);
    const std::vector<Nearest>& neighbours() const { return neighbours_; }
    double search_ms() const { return search_ms_; }

  private:
    Vec3 place(std::size_t i, const NavState& x);
    void look_up(std::size_t i, const NavState& x);
    void match(std::size_t i, const NavState& x, bool search);
    void fill_row(const NavState& x, std::size_t i, Linearisation& out, Eigen::Index row) const;
    void append_prior(const NavState& x, Linearisation& out);

    Adapter& adapter_;
    bool extrinsic_est_;
    double variance_;
    PointLoop loop_;
    const std::vector<Eigen::Vector3f>* points_ = nullptr;
    const IkdTree* tree_ = nullptr;
    std::vector<Nearest> neighbours_;
    std::vector<Correspondence> matches_;
    std::vector<Verdict> verdicts_;
    std::vector<Eigen::Vector3f> in_map_;
    double search_ms_ = 0.0;
};

}  // namespace d2lio::fastlio
