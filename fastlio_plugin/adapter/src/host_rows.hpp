// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "d2lio/degeneracy/clean_rows.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/geometry/so3.hpp"
#include "gate.hpp"

namespace d2lio::fastlio {

/// The host's rows as RowCleaner sees them.
class HostRows {
  public:
    struct Entry {
        int row;
        std::size_t point;
    };

    /// @param listed the rows to be seen, of accepted points. @param variance of a residual, m^2.
    HostRows(const Rows& rows, double variance, const Pose& x, const Gate& gate,
             const std::vector<Entry>& listed, const BlindDirections& blind)
        : rows_(rows),
          variance_(variance),
          R_inverse_(x.R.transpose()),
          t_(x.t),
          gate_(gate),
          listed_(listed) {
        for (int i = 0; i < blind.count; ++i) {
            levers_[static_cast<std::size_t>(i)] = -R_inverse_ * hat(blind.axes.col(i));
        }
    }

    std::size_t size() const { return listed_.size(); }
    Vec3 normal(std::size_t k) const { return at(row_of(k), rows_.position_column); }
    const Patch* patch(std::size_t k) const { return gate_.patch(listed_[k].point); }
    double trusted(std::size_t k, const Vec3& normal, const BlindDirections& blind) const {
        return trust(rows_.residual[listed_[k].row], normal, *patch(k), blind, variance_);
    }

    /// Of the rotation's column R^T (arm x n) goes R^T (arm x d), a linear function of the arm.
    void take_out(std::size_t k, const BlindDirections& blind, const Vec3& components) {
        double* const row = row_of(k);
        const Vec3 arm = gate_.point(listed_[k].point).cast<double>() - t_;
        Vec3 n = at(row, rows_.position_column), turn = at(row, rows_.rotation_column);
        for (int i = 0; i < blind.count; ++i) {
            n -= components[i] * blind.axes.col(i);
            turn -= components[i] * (levers_[static_cast<std::size_t>(i)] * arm);
        }
        put(row, rows_.position_column, n);
        put(row, rows_.rotation_column, turn);
        scale_extrinsic(row, 0.0);
    }

    void replace(std::size_t k, const CleanedRow& cleaned, bool lost) {
        double* const row = row_of(k);
        const Vec3 arm = gate_.point(listed_[k].point).cast<double>() - t_;
        const Vec3 kept = cleaned.weight * cleaned.normal;
        put(row, rows_.position_column, kept);
        put(row, rows_.rotation_column, R_inverse_ * arm.cross(kept));
        rows_.residual[listed_[k].row] *= cleaned.weight;
        scale_extrinsic(row, lost ? 0.0 : cleaned.weight);
    }

    /// Of all rows, listed or not.
    void scale_extrinsics(double share) const {
        if (rows_.extrinsic_column < 0) return;
        for (int row = 0; row < rows_.count; ++row) {
            scale_extrinsic(rows_.jacobian + row * rows_.row_step, share);
        }
    }

  private:
    double* row_of(std::size_t k) const { return rows_.jacobian + listed_[k].row * rows_.row_step; }
    Vec3 at(const double* row, int column) const {
        const double* const from = row + column * rows_.column_step;
        return {from[0], from[rows_.column_step], from[2 * rows_.column_step]};
    }
    void put(double* row, int column, const Vec3& v) const {
        double* const to = row + column * rows_.column_step;
        to[0] = v[0];
        to[rows_.column_step] = v[1];
        to[2 * rows_.column_step] = v[2];
    }
    /// A row that lost something tells nothing of the extrinsic.
    void scale_extrinsic(double* row, double share) const {
        if (rows_.extrinsic_column < 0) return;
        double* const extrinsic = row + rows_.extrinsic_column * rows_.column_step;
        for (int c = 0; c < 6; ++c) extrinsic[c * rows_.column_step] *= share;
    }

    const Rows rows_;
    const double variance_;
    const Mat3 R_inverse_;
    const Vec3 t_;
    const Gate& gate_;
    const std::vector<Entry>& listed_;
    std::array<Mat3, 3> levers_;  ///< an arm to R^T (arm x d), for each blind d
};

}  // namespace d2lio::fastlio
