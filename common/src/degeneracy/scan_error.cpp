// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/scan_error.hpp"

namespace d2lio {
namespace {

constexpr double kRotation = 0.5e-3;  ///< rad, at a misfit of 1
constexpr double kMostMisfit = 2.0;
constexpr double kPosition = 5e-3;  ///< m, where a direction is blind

}  // namespace

ScanError scan_error(const BlindDirections& blind, double misfit) {
    const double most = blind.count > 0 ? blind.blend.head(blind.count).maxCoeff() : 0.0;
    const double disagreement = misfit < kMostMisfit ? misfit : kMostMisfit;
    const double rotation = kRotation * disagreement * disagreement;
    return {rotation * rotation, most * kPosition * kPosition};
}

}  // namespace d2lio
