// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>

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
/// I -> (I^-1 + E)^-1 = M I and b -> M b with M = (1 + I E)^-1, which needs no inverse of I.
/// @param error variances E of the states, by the variance of a row.
template <int N>
void limit_information(const Eigen::Matrix<double, N, 1>& error, Eigen::Matrix<double, N, N>& AtA,
                       Eigen::Matrix<double, N, 1>& Atb) {
    using Matrix = Eigen::Matrix<double, N, N>;
    const Matrix M = Matrix::Identity() + AtA * error.asDiagonal();
    const Eigen::PartialPivLU<Matrix> lu(M);
    const Matrix limited = lu.solve(AtA);
    AtA = 0.5 * (limited + limited.transpose());
    Atb = lu.solve(Atb).eval();
}

}  // namespace d2lio
