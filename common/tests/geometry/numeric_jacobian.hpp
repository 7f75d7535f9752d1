// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace d2lio::test {

/// Central differences of f: R^n -> R^m at x. `f` takes and returns Eigen::VectorXd.
template <typename F>
Eigen::MatrixXd numeric_jacobian(const F& f, const Eigen::VectorXd& x, double step = 1e-6) {
    const Eigen::VectorXd y = f(x);
    Eigen::MatrixXd J(y.size(), x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
        Eigen::VectorXd hi = x, lo = x;
        hi[i] += step;
        lo[i] -= step;
        J.col(i) = (f(hi) - f(lo)) / (2.0 * step);
    }
    return J;
}

}  // namespace d2lio::test
