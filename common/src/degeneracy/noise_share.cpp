// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/noise_share.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace d2lio {
namespace {

constexpr double kFloor = 1e-9;  ///< share of the trace that keeps the information invertible

}  // namespace

NoiseShare noise_share(const Mat3& information, const Mat3& noise) {
    NoiseShare out;
    if (!information.allFinite() || !noise.allFinite()) return out;
    Mat3 L = 0.5 * (information + information.transpose());
    L.diagonal().array() += kFloor * std::max(L.trace(), 1.0);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Mat3> solver(0.5 * (noise + noise.transpose()),
                                                                L);
    if (solver.info() != Eigen::Success || !solver.eigenvectors().allFinite()) return out;
    for (int i = 0; i < 3; ++i) {
        out.share[i] = std::max(solver.eigenvalues()[2 - i], 0.0);
        out.axes.col(i) = solver.eigenvectors().col(2 - i).normalized();
    }
    return out;
}

double smooth_step(double x, double low, double high) {
    if (!(x > low)) return 0.0;
    if (x >= high) return 1.0;
    const double t = (x - low) / (high - low);
    return t * t * (3.0 - 2.0 * t);
}

}  // namespace d2lio
