// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "scan_matcher.hpp"

#include <Eigen/Geometry>
#include <limits>

#include "d2lio/geometry/so3.hpp"

namespace d2lio::fastlio {
namespace {

/// Far neighbours are of no use to the match, but the map's insertion rule looks at them too.
constexpr float kUnbounded = std::numeric_limits<float>::infinity();

}  // namespace

ScanMatcher::ScanMatcher(Adapter& adapter, bool extrinsic_est, double variance, int threads)
    : adapter_(adapter), extrinsic_est_(extrinsic_est), variance_(variance), loop_(threads) {}

void ScanMatcher::begin(const std::vector<Eigen::Vector3f>& points, const IkdTree& tree) {
    points_ = &points;
    tree_ = &tree;
    neighbours_.resize(points.size());
    matches_.resize(points.size());
    verdicts_.assign(points.size(), Verdict::kFewNeighbours);
    in_map_.resize(points.size());
    search_ms_ = 0.0;
}

/// Moves a point to the map frame. @returns it in that of the IMU.
Vec3 ScanMatcher::place(std::size_t i, const NavState& x) {
    const Vec3 p_imu = x.extrinsic_rot * (*points_)[i].cast<double>() + x.extrinsic_pos;
    in_map_[i] = (x.rot * p_imu + x.pos).cast<float>();
    return p_imu;
}

void ScanMatcher::look_up(std::size_t i, const NavState& x) {
    place(i, x);
    Nearest& near = neighbours_[i];
    near.count = tree_->knn(in_map_[i], Nearest::kMost, kUnbounded, near.items.data());
}

void ScanMatcher::match(std::size_t i, const NavState& x, bool search) {
    if (!search && verdicts_[i] != Verdict::kAccepted) return;  // out until the next search
    const Vec3 p_imu = place(i, x);
    const Nearest& near = neighbours_[i];
    Candidate c{};
    c.index = i;
    c.fresh = search;
    c.imu_range = p_imu.norm();
    c.lidar_range = static_cast<double>((*points_)[i].norm());
    c.p_map = in_map_[i].data();
    c.neighbours = &near.items[0].x;
    c.sq_distances = &near.items[0].sq_dist;
    c.neighbour_step = c.distance_step = sizeof(Neighbour) / sizeof(float);
    c.neighbour_count = near.count;
    verdicts_[i] = adapter_.accept(c, &matches_[i]);
}

/// H = [n^T, (p_I x c)^T, (p_L x R_LI^T c)^T, c^T] with c = R^T n (UPSTREAM.md).
void ScanMatcher::fill_row(const NavState& x, std::size_t i, Linearisation& out,
                           Eigen::Index row) const {
    const Vec3 p = (*points_)[i].cast<double>();
    const Vec3 p_imu = x.extrinsic_rot * p + x.extrinsic_pos;
    const Vec3 n = Eigen::Map<const Eigen::Vector3f>(matches_[i].normal).cast<double>();
    const Vec3 c = x.rot.transpose() * n;
    out.H.block<1, 3>(row, 0) = n.transpose();
    out.H.block<1, 3>(row, 3) = p_imu.cross(c).transpose();
    if (extrinsic_est_) {
        out.H.block<1, 3>(row, 6) = p.cross(x.extrinsic_rot.transpose() * c).transpose();
        out.H.block<1, 3>(row, 9) = c.transpose();
    } else {
        out.H.block<1, 6>(row, 6).setZero();
    }
    out.residual[row] = -static_cast<double>(matches_[i].residual);
}

void ScanMatcher::append_prior(const NavState& x, Linearisation& out) {
    const int extrinsic = extrinsic_est_ ? 6 : -1;
    const Rows rows{out.H.data(), out.residual.data(), static_cast<int>(out.rows), 12, 1, 0, 3,
                    extrinsic};
    PriorBlock prior;
    out.error = ScanError{};
    if (adapter_.condition(rows, {x.rot.data(), x.pos.data()}, variance_, &prior) != Status::kOk) {
        return;
    }
    const double squares = out.residual.head(out.rows).squaredNorm();
    out.error = adapter_.scan_error(squares / (static_cast<double>(out.rows) * variance_));
    for (int i = 0; i < prior.count; ++i) {
        for (int j = 0; j < 6; ++j) out.H(out.rows, j) = prior.jacobian[i][j];
        out.H.block<1, 6>(out.rows, 6).setZero();
        out.residual[out.rows++] = prior.residual[i];
    }
}

bool ScanMatcher::measure(const NavState& x, bool search, Linearisation& out) {
    StopWatch watch;
    if (search) loop_(points_->size(), [&](std::size_t i) { look_up(i, x); });
    loop_(points_->size(), [&](std::size_t i) { match(i, x, search); });
    search_ms_ += watch.lap();
    constexpr Eigen::Index kPriorRows = 6;
    out.reserve(static_cast<Eigen::Index>(points_->size()) + kPriorRows);
    out.rows = 0;
    for (std::size_t i = 0; i < points_->size(); ++i) {
        if (verdicts_[i] == Verdict::kAccepted) fill_row(x, i, out, out.rows++);
    }
    if (out.rows == 0) return false;
    append_prior(x, out);
    return true;
}

const std::vector<Eigen::Vector3f>& ScanMatcher::to_map(const NavState& x) {
    const Pose T = x.T_map_lidar();
    for (std::size_t i = 0; i < points_->size(); ++i) {
        in_map_[i] = (T * (*points_)[i].cast<double>()).cast<float>();
    }
    return in_map_;
}

}  // namespace d2lio::fastlio
