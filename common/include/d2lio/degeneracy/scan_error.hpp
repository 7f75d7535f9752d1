// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Cholesky>

#include "d2lio/degeneracy/blind.hpp"

namespace d2lio {

/// Error of a scan as a rigid body, which no number of rows averages out: the beams' angles, the
/// rings and voxels that sampled the map. Variances of rotation (rad^2) and of position (m^2), each
/// about every axis; zero where nothing is to be limited.
///
/// Thousands of rows claim 0.05 mrad and 0.3 mm of a pose; the gyroscope, which would know better
/// than wrong planes of a bank seen in a few rings, is overruled by 10 mrad. And where a direction
/// is blind, what is claimed across it is read as tilt, which gravity turns into motion along it.
struct ScanError {
    double rotation = 0.0;
    double position = 0.0;
};

/// The position is only doubted as far as a direction of it is blind: elsewhere the position itself
/// matters, and the rows are right. The rotation is doubted by the square of the rows' misfit:
/// smooth walls (0.1) tell a tunnel's pitch to less than 0.05 mrad, and gravity asks for that.
/// @param blind of the scan. @param misfit mean square of its rows' residuals by the variance of a
/// row.
ScanError scan_error(const BlindDirections& blind, double misfit);

/// Normal equations of rows that have, besides their own noise, an error common to all:
/// I -> (I^-1 + E)^-1 and b -> (1 + I E)^-1 b, by Woodbury's identity, which needs no inverse of I.
/// @param error variances E of the first six states, by the variance of a row.
template <int N>
void limit_information(const Vec6& error, Eigen::Matrix<double, N, N>& AtA,
                       Eigen::Matrix<double, N, 1>& Atb) {
    const Vec6 sigma = error.cwiseSqrt();
    Eigen::Matrix<double, 6, N> felt = AtA.template topRows<6>();
    felt.array().colwise() *= sigma.array();
    Mat6 all = felt.template leftCols<6>() * sigma.asDiagonal();
    all.diagonal().array() += 1.0;
    const Eigen::LLT<Mat6> llt(all);
    llt.matrixL().solveInPlace(felt);
    Vec6 share = sigma.cwiseProduct(Atb.template head<6>());
    llt.matrixL().solveInPlace(share);
    AtA.noalias() -= felt.transpose().lazyProduct(felt);
    Atb.noalias() -= felt.transpose() * share;
}

}  // namespace d2lio
