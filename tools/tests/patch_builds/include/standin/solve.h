// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

/// Solvers that compile in no time: the tests build them a dozen times. C++11.
namespace standin {

/// A x = b by elimination with row pivoting; A is n x n, row by row.
inline std::vector<double> solve_dense(std::vector<double> A, std::vector<double> b) {
    const std::size_t n = b.size();
    for (std::size_t k = 0; k < n; ++k) {
        std::size_t pivot = k;
        for (std::size_t r = k + 1; r < n; ++r) {
            if (std::fabs(A[r * n + k]) > std::fabs(A[pivot * n + k])) pivot = r;
        }
        for (std::size_t c = 0; c < n; ++c) std::swap(A[k * n + c], A[pivot * n + c]);
        std::swap(b[k], b[pivot]);
        for (std::size_t r = k + 1; r < n; ++r) {
            const double factor = A[r * n + k] / A[k * n + k];
            for (std::size_t c = k; c < n; ++c) A[r * n + c] -= factor * A[k * n + c];
            b[r] -= factor * b[k];
        }
    }
    for (std::size_t k = n; k-- > 0;) {
        for (std::size_t c = k + 1; c < n; ++c) b[k] -= A[k * n + c] * b[c];
        b[k] /= A[k * n + k];
    }
    return b;
}

/// Least squares of n.p = -1 over five points, scaled: unit normal and offset.
/// @returns the largest distance of a point.
inline double fit_plane(const std::array<Eigen::Vector3d, 5>& points, Eigen::Vector3d& normal,
                        double& offset) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const auto& p : points) {
        A += p * p.transpose();
        b -= p;
    }
    normal = A.inverse() * b;
    offset = 1.0 / normal.norm();
    normal *= offset;
    double largest = 0.0;
    for (const auto& p : points) {
        const double off = std::fabs(normal.dot(p) + offset);
        if (!(off <= largest)) largest = off;  // NaN as well
    }
    return largest;
}

/// Centre and principal axis of five points, by powers of their scatter.
/// @returns the principal eigenvalue's share of the trace.
inline double fit_line(const std::array<Eigen::Vector3d, 5>& points, Eigen::Vector3d& centre,
                       Eigen::Vector3d& along) {
    centre.setZero();
    for (const auto& p : points) centre += p / 5.0;
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const auto& p : points) scatter += (p - centre) * (p - centre).transpose();
    along = Eigen::Vector3d(0.48, 0.6, 0.64);
    for (int i = 0; i < 20; ++i) along = (scatter * along).normalized();
    return along.dot(scatter * along) / scatter.trace();
}

}  // namespace standin
