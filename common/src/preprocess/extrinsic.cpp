// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/extrinsic.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <sstream>

#include "d2lio/config/params.hpp"

namespace d2lio {
namespace {

[[noreturn]] void refuse(const Mat3& R, const std::string& key, double tolerance) {
    std::ostringstream value, allowed;
    value << R.format(Eigen::IOFormat(6, Eigen::DontAlignCols, ", ", "; ", "", "", "[", "]"))
          << " with determinant " << R.determinant();
    allowed << "a rotation matrix: determinant +1 and orthonormal to " << tolerance;
    throw ConfigError(key, value.str(), allowed.str());
}

}  // namespace

Mat3 checked_rotation(const Mat3& R, const std::string& key, double tolerance) {
    if (!R.allFinite()) refuse(R, key, tolerance);
    // Dynamic size: the fixed-size one trips GCC 12's maybe-uninitialized warning.
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double deviation = (svd.singularValues().array() - 1.0).abs().maxCoeff();
    if (deviation > tolerance || R.determinant() <= 0.0) refuse(R, key, tolerance);
    return svd.matrixU() * svd.matrixV().transpose();
}

Pose checked_extrinsic(const Mat3& R, const Vec3& t, const std::string& key) {
    if (!t.allFinite()) {
        std::ostringstream value;
        value << "translation " << t.transpose();
        throw ConfigError(key, value.str(), "finite numbers, m");
    }
    return {checked_rotation(R, key), t};
}

}  // namespace d2lio
