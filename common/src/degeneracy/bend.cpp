// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/bend.hpp"

#include <algorithm>

namespace d2lio {
namespace {

constexpr double kKeep = 0.9;                ///< share of the past that a new scan leaves
constexpr double kPointVariance = 4e-4;      ///< m^2, of a neighbour's distance from the surface
constexpr double kSignificance = 2.0 * 2.0;  ///< sigmas squared
constexpr double kMinRun = 1e-12;            ///< m^4

/// The estimate, shrunk by the share of it that noise alone may give (James, Stein 1961).
double shrunk(double bend, double variance) {
    const double square = bend * bend;
    return square > kSignificance * variance ? bend * (1.0 - kSignificance * variance / square)
                                             : 0.0;
}

}  // namespace

void BendField::end_scan() {
    any_ = false;
    for (std::size_t i = 0; i < bend_.size(); ++i) {
        const double run = std::max(run_[i], kMinRun);
        bend_[i] = static_cast<float>(shrunk(rise_[i] / run, kPointVariance / run));
        any_ = any_ || bend_[i] != 0.F;
        rise_[i] *= kKeep;
        run_[i] *= kKeep;
    }
}

}  // namespace d2lio
