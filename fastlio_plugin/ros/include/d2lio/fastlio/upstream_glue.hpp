// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/ros/record.hpp"
#include "d2lio/ros/settings.hpp"

namespace d2lio {
namespace fastlio {

/// What a patched FAST_LIO calls: patches/fast_lio/GLUE.md. C++14; names no type of upstream. With
/// mode off, method none and no record asked for it leaves everything to upstream, bit for bit.
///
/// State: pos (m), rot (quaternion, toRotationMatrix()), offset_R_L_I, offset_T_L_I. Covariances
/// are column-major with position at 0 and rotation (right tangent) at 3.
class UpstreamGlue {
  public:
    /// Reads and checks all parameters under d2lio/.
    /// @param map_voxel of upstream's map, m.
    /// @throws std::invalid_argument naming every wrong key, its value and what is allowed.
    template <class Node>
    void configure(Node& node, double map_voxel) {
        ros_glue::SettingsReader settings(node);
        std::string csv, topic = "-";
        settings.read("upstream_fixes", fixes_);
        settings.read("diagnostics.csv", csv);
        settings.read("diagnostics.topic", topic);
        adapter_.set_map_voxel(map_voxel);
        recorder_.open_csv(csv, settings);
        settings.finish(adapter_, {"upstream_fixes", "diagnostics.csv", "diagnostics.topic"});
        changes_ = adapter_.rejects() || adapter_.has_prior() || adapter_.reads_surfaces();
        if (topic == "-") topic = changes_ ? "d2lio/diagnostics" : "";
        recorder_.advertise(node, topic, "fast_lio");
    }

    /// @param x posterior of the last scan.
    template <class State>
    void before_prediction(const State& x) {
        previous_ = copy_of(x);
    }

    /// @param x, P prediction of this scan. @param points that will be offered.
    template <class State, class Cov>
    void begin_scan(double stamp, const State& x, const Cov& P, int points) {
        if (!active()) return;
        const PoseCopy predicted = copy_of(x);
        stamp_ = stamp;
        offered_ = points;
        rows_ = 0;
        adapter_.begin_scan({previous_.view(), predicted.view(), P.data(),
                             static_cast<int>(P.rows()), kPosition, kRotation,
                             static_cast<std::size_t>(points > 0 ? points : 0), false});
    }

    /// Whether accept() decides; otherwise upstream's own gates do.
    bool decides() const { return adapter_.rejects() || adapter_.reads_surfaces(); }

    /// @param fresh the neighbours come from a new search; only then are `sq_distances` read.
    /// @param plane on acceptance gets the normal in x, y, z and the signed distance (m) in
    /// intensity. Any thread, one point each.
    template <class State, class Vec, class Point, class Points>
    bool accept(int i, bool fresh, const State& x, const Vec& p_lidar, const Point& p_map,
                const Points& neighbours, const std::vector<float>& sq_distances, Point& plane) {
        const Vec p_imu = x.offset_R_L_I * p_lidar + x.offset_T_L_I;
        Candidate c{};
        c.index = static_cast<std::size_t>(i);
        c.fresh = fresh;
        c.imu_range = p_imu.norm();
        c.lidar_range = p_lidar.norm();
        c.p_map = &p_map.x;
        if (!neighbours.empty()) c.neighbours = &neighbours[0].x;
        c.sq_distances = sq_distances.data();
        c.neighbour_step = sizeof(neighbours[0]) / sizeof(float);
        c.distance_step = 1;
        const std::size_t pairs =
            neighbours.size() < sq_distances.size() ? neighbours.size() : sq_distances.size();
        c.neighbour_count = static_cast<int>(pairs);
        Correspondence fit;
        if (adapter_.accept(c, &fit) != Verdict::kAccepted) return false;
        plane.x = fit.normal[0];
        plane.y = fit.normal[1];
        plane.z = fit.normal[2];
        plane.intensity = fit.residual;
        return true;
    }

    /// Appends the rows of the prior to `H` (m x 12: position, rotation, extrinsic) and `z` (m, the
    /// negative residuals).
    /// @param variance of the measurements, m^2.
    template <class State, class Matrix, class Vector>
    void condition(const State& x, double variance, Matrix& H, Vector& z) {
        if (!active()) return;
        const PoseCopy here = copy_of(x);
        rows_ = static_cast<int>(H.rows());
        last_ = here;
        PriorBlock prior;
        adapter_.condition({H.data(), z.data(), rows_, H.rowStride(), H.colStride(), kPosition,
                            kRotation, kExtrinsic},
                           here.view(), variance, &prior);
        if (prior.count == 0) return;
        H.conservativeResize(rows_ + prior.count, H.cols());
        z.conservativeResize(rows_ + prior.count);
        for (int r = 0; r < prior.count; ++r) {
            for (int c = 0; c < H.cols(); ++c) {
                H(rows_ + r, c) = c < 6 ? prior.jacobian[r][c] : 0.0;
            }
            z(rows_ + r) = prior.residual[r];
        }
    }

    /// Takes the prior's information out of the filter's covariance and writes the record.
    template <class Filter>
    void end_scan(Filter& kf) {
        if (!active() && !fixes_) return;
        const PoseCopy posterior = copy_of(kf.get_x());
        rotation_ = posterior;
        if (!active()) return;
        auto P = kf.get_P();
        const int size = static_cast<int>(P.rows());
        adapter_.end_scan(posterior.view(), converged(posterior), P.data(), size);
        if (adapter_.has_prior()) kf.change_P(P);
        if (recorder_.active()) recorder_.write(record());
    }

    /// With d2lio/upstream_fixes: covariance of this scan in ROS order (x y z, rotation about x y
    /// z of the map), row-major 6 x 6. Upstream fills it a scan late and swaps the blocks.
    template <class Cov, class Array>
    void fill_covariance(const Cov& P, Array& covariance) const {
        if (!fixes_) return;
        double J[6][6] = {};  // the body tangent turns into the map
        for (int i = 0; i < 3; ++i) {
            J[i][i] = 1.0;
            for (int j = 0; j < 3; ++j) J[3 + i][3 + j] = rotation_.R[i + 3 * j];
        }
        for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) {
                double sum = 0.0;
                for (int k = 0; k < 6; ++k) {
                    for (int l = 0; l < 6; ++l) sum += J[i][k] * P(k, l) * J[j][l];
                }
                covariance[static_cast<std::size_t>(6 * i + j)] = sum;
            }
        }
    }

  private:
    static constexpr int kPosition = 0, kRotation = 3,
                         kExtrinsic = 6;         ///< FAST-LIO2's order of the state
    static constexpr double kConverged = 0.001;  ///< upstream's limit, m and rad

    struct PoseCopy {
        double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< column-major
        double t[3] = {0, 0, 0};
        PoseView view() const { return {R, t}; }
    };
    template <class State>
    static PoseCopy copy_of(const State& x) {
        PoseCopy out;
        const auto R = x.rot.toRotationMatrix();
        for (int j = 0; j < 3; ++j) {
            for (int i = 0; i < 3; ++i) out.R[i + 3 * j] = R(i, j);
            out.t[j] = x.pos[j];
        }
        return out;
    }

    bool active() const { return changes_ || recorder_.active(); }

    /// Upstream does not tell; its last step is what lies between the last rows and the posterior.
    bool converged(const PoseCopy& posterior) const {
        double turn = 0.0, step = 0.0;  // trace of R_last^T R and longest coordinate
        for (int i = 0; i < 9; ++i) turn += last_.R[i] * posterior.R[i];
        for (int i = 0; i < 3; ++i) step = std::fmax(step, std::fabs(posterior.t[i] - last_.t[i]));
        const double angle = std::acos(std::fmax(-1.0, std::fmin(1.0, (turn - 1.0) / 2.0)));
        return rows_ > 0 && step <= kConverged && angle <= kConverged;
    }

    ros_glue::Record record() const {
        ros_glue::Record out = ros_glue::last_record(adapter_, stamp_);
        if (decides()) return out;
        out.set("offered", offered_);  // upstream's gates chose: it says how many, not why
        out.set("accepted", rows_);
        for (auto& column : out.columns) {
            if (std::string(column.first).compare(0, 9, "rejected_") == 0) column.second = NAN;
        }
        return out;
    }

    Adapter adapter_;
    ros_glue::Recorder recorder_;
    bool fixes_ = false, changes_ = false;
    PoseCopy previous_, last_, rotation_;
    double stamp_ = 0.0;
    int offered_ = 0, rows_ = 0;
};

}  // namespace fastlio
}  // namespace d2lio
