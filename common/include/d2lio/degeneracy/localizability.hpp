// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/degeneracy/policies.hpp"
#include "d2lio/plugin/row_view.hpp"

namespace d2lio {

/// How much the rows say of each of three directions: sums of the absolute components that are
/// worth counting.
struct Contributions {
    Vec3 filtered = Vec3::Zero();  ///< of components above cos 80 deg
    Vec3 strong = Vec3::Zero();    ///< of components above cos 45 deg
};

/// @param block the rows' rotation or translation part: any vector longer than 1 is shortened to
/// that, as X-ICP does with torques. @param directions columns, unit length.
Contributions contributions(const RowView::Block& block, const Mat3& directions);

/// Hard constraints in the way of X-ICP (Tuna, Nubert, Nava, Khattak, Hutter, "X-ICP:
/// localizability-aware LiDAR registration for robust localization in extreme environments", T-RO
/// 2024): an eigenvector to which too few correspondences contribute keeps the prediction.
///
/// A direction is not localizable where filtered < kappa_2 and strong < kappa_3. What X-ICP calls
/// partially localizable, and solves for with the strong correspondences alone, is left to all
/// rows here.
struct XIcpPrior {
    double kappa_2 = 180.0;
    double kappa_3 = 35.0;

    PriorTerm evaluate(const Spectrum& spectrum, const RowView& rows) const;
};

}  // namespace d2lio
