// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "d2lio/degeneracy/clean_rows.hpp"
#include "d2lio/fastlio/adapter.hpp"
#include "gate.hpp"

namespace d2lio::fastlio {

/// The host's rows that may speak of a blind direction, as RowCleaner sees them, and the others.
class HostRows {
  public:
    struct Entry {
        int row;
        std::size_t point;
    };

    /// @param variance of a residual, m^2. @param listed room for the rows that may speak.
    HostRows(const Rows& rows, double variance, const Pose& x, Gate& gate,
             std::vector<Entry>& listed)
        : rows_(rows),
          variance_(variance),
          R_inverse_(x.R.transpose()),
          t_(x.t),
          gate_(gate),
          listed_(listed) {}

    std::size_t size() const { return listed_.size(); }
    Vec3 normal(std::size_t k) const { return at(row_of(k), rows_.position_column); }
    const Patch* patch(std::size_t k) const { return &gate_.patch(listed_[k].point); }
    double trusted(std::size_t k, const Vec3& normal, const BlindDirections& blind) const {
        return trust(rows_.residual[listed_[k].row], normal, *patch(k), blind, variance_);
    }

    void replace(std::size_t k, const CleanedRow& cleaned, bool lost) {
        double* const row = row_of(k);
        const Vec3 kept = cleaned.weight * cleaned.normal;
        put(row, rows_.position_column, kept);
        put(row, rows_.rotation_column, turn_of(listed_[k].point, kept));
        rows_.residual[listed_[k].row] *= cleaned.weight;
        scale_extrinsic(row, lost ? 0.0 : cleaned.weight);
    }

    /// Lists the rows that may speak and takes out of the others what they cannot prove.
    /// @param already that came with their normals; what is left is the extrinsic's.
    void clean_others(const BlindDirections& blind, bool already) {
        const std::vector<Verdict>& verdicts = gate_.book().verdicts();
        listed_.clear();
        int row = 0;
        for (std::size_t i = 0; i < verdicts.size(); ++i) {
            if (verdicts[i] != Verdict::kAccepted) continue;
            if (gate_.speaks(i)) {
                listed_.push_back({row, i});
            } else {
                clean_other(row, i, blind, already);
            }
            ++row;
        }
    }

  private:
    void clean_other(int index, std::size_t i, const BlindDirections& blind, bool already) const {
        double* const row = rows_.jacobian + index * rows_.row_step;
        scale_extrinsic(row, 0.0);
        if (already) return;
        const Vec3 kept = without(at(row, rows_.position_column), blind);
        put(row, rows_.position_column, kept);
        put(row, rows_.rotation_column, turn_of(i, kept));
        gate_.tell(i, kept);
    }
    double* row_of(std::size_t k) const { return rows_.jacobian + listed_[k].row * rows_.row_step; }
    /// The rotation's part of the row of point i with this normal.
    Vec3 turn_of(std::size_t i, const Vec3& normal) const {
        const Vec3 arm = gate_.point(i).cast<double>() - t_;
        return R_inverse_ * arm.cross(normal);
    }
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
    Gate& gate_;
    std::vector<Entry>& listed_;
};

}  // namespace d2lio::fastlio
