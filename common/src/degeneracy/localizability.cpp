// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/localizability.hpp"

#include <algorithm>
#include <cmath>

namespace d2lio {
namespace {

constexpr double kFiltered = 0.17364817766693033;  ///< cos 80 deg
constexpr double kStrong = 0.70710678118654752;    ///< cos 45 deg

}  // namespace

Contributions contributions(const RowView::Block& block, const Mat3& directions) {
    Contributions out;
    for (std::ptrdiff_t row = 0; row < block.count; ++row) {
        const double* const at = block.data + row * block.row_step;
        const Vec3 v(at[0], at[block.column_step], at[2 * block.column_step]);
        const Vec3 parts = (directions.transpose() * v).cwiseAbs() / std::max(v.norm(), 1.0);
        for (int i = 0; i < 3; ++i) {
            if (parts[i] >= kFiltered) out.filtered[i] += parts[i];
            if (parts[i] >= kStrong) out.strong[i] += parts[i];
        }
    }
    return out;
}

PriorTerm XIcpPrior::evaluate(const Spectrum& s, const RowView& rows) const {
    PriorTerm out;
    const auto keep = [&](const RowView::Block& block, const Mat3& directions) {
        const Contributions c = contributions(block, directions);
        Mat3 kept = Mat3::Zero();
        for (int i = 0; i < 3; ++i) {
            const bool localizable = c.filtered[i] >= kappa_2 || c.strong[i] >= kappa_3;
            if (localizable) kept += directions.col(i) * directions.col(i).transpose();
            out.projects = out.projects || !localizable;
        }
        return kept;
    };
    out.keep_r = keep(rows.rotation, s.rotation.v);
    out.keep_t = keep(rows.translation, s.translation.v);
    return out;
}

}  // namespace d2lio
