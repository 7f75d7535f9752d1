// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "d2lio/degeneracy/scan_error.hpp"
#include "d2lio/geometry/state.hpp"
#include "d2lio/host/pose_uncertainty.hpp"

namespace d2lio::fastlio {

/// Linearised measurement: `rows` rows r_i ~ -(H_i dx) of one variance. H covers the first 12 error
/// states (position, rotation, extrinsic rotation, extrinsic translation).
struct Linearisation {
    Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor> H;
    Eigen::VectorXd residual;  ///< minus the measurement error, z - h(x)
    Eigen::Index rows = 0;     ///< rows in use; the storage only grows
    ScanError error;           ///< common to all rows

    void reserve(Eigen::Index n);
};

/// Fills the rows at a state. `search`: look for new neighbours. Returns false where nothing can be
/// measured.
using Measure = std::function<bool(const NavState& x, bool search, Linearisation& out)>;

struct IeskfOptions {
    int max_iteration = 3;
    double variance = 0.001;  ///< of every row, m^2 (FAST-LIO2: LASER_POINT_COV)
    double limit = 0.001;     ///< convergence limit of every error state
    bool exact_jacobians = false;
    /// Ends where the pose has moved by less than the limit since the last search; FAST-LIO2
    /// searches again then, and finds nearly the same neighbours.
    bool searches_once = false;
};

enum class UpdateStatus {
    kOk,
    kNoMeasurement,     ///< no iteration had rows: state and covariance as predicted
    kNumericalFailure,  ///< non-finite or indefinite: state and covariance as predicted
};

struct UpdateReport {
    UpdateStatus status = UpdateStatus::kNoMeasurement;
    int iterations = 0;
    bool converged = false;
};

using Vec12 = Eigen::Matrix<double, 12, 1>;

/// Iterated error-state Kalman update on the 23-DoF manifold (FAST-LIO2, section IV-C; He, Xu,
/// Zhang 2021). `x` and `P` hold the prediction on entry and the posterior on return.
class Ieskf {
  public:
    explicit Ieskf(const IeskfOptions& options) : options_(options) {}
    UpdateReport update(NavState& x, Mat23x23& P, const Measure& measure);
    /// How the last update moved the state. @param P its posterior.
    PoseUncertainty::Match match(const Mat23x23& P) const;

  private:
    /// Covariance after the last step, carried over to the posterior's tangent space; false when
    /// it is not positive definite.
    bool posterior(const NavState& predicted, const Mat23x23& P, const Vec23& dx,
                   Mat23x23& out) const;
    /// One Gauss-Newton step from x; false when a matrix is singular or the step not finite.
    bool step(const Mat23x23& P, const Vec23& deviation, Vec23& dx);
    void limit(Mat12& HtH, Vec12& Htr) const;
    bool wide_gain(const Mat23x23& P);
    bool tall_gain(const Mat23x23& P);

    IeskfOptions options_;
    Linearisation rows_;
    Mat12 HtH_ = Mat12::Zero();  ///< of the rows of the last step
    Vec23 Kr_ = Vec23::Zero();   ///< K residual
    Eigen::Matrix<double, 23, 12> KH_ = Eigen::Matrix<double, 23, 12>::Zero();  ///< first columns
};

}  // namespace d2lio::fastlio
