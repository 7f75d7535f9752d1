// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/degeneracy/spectrum.hpp"

#include <Eigen/Eigenvalues>

namespace d2lio {

int BlockSpectrum::weak_count(double share) const {
    const double limit = share * lambda.sum();
    int n = 0;
    while (n < 3 && lambda[n] <= limit) ++n;
    return n;
}

BlockSpectrum decompose(const Mat3& information) {
    BlockSpectrum out;
    if (!information.allFinite()) return out;
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(0.5 * (information + information.transpose()));
    if (solver.info() != Eigen::Success) return out;
    out.lambda = solver.eigenvalues().cwiseMax(0.0);
    out.v = solver.eigenvectors();
    for (int i = 0; i < 3; ++i) {
        Eigen::Index largest = 0;
        out.v.col(i).cwiseAbs().maxCoeff(&largest);
        if (out.v(largest, i) < 0.0) out.v.col(i) = -out.v.col(i);
    }
    return out;
}

}  // namespace d2lio
