// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "ieskf.hpp"

#include <Eigen/Cholesky>

namespace d2lio::fastlio {

void Linearisation::reserve(Eigen::Index n) {
    if (H.rows() >= n) return;
    H.conservativeResize(n, 12);
    residual.conservativeResize(n);
}

/// The rows' normal equations, with what all rows have in common.
void Ieskf::limit(Mat12& HtH, Vec12& Htr) const {
    const ScanError& e = rows_.error;
    if (e.rotation == 0.0 && e.position == 0.0) return;
    Vec6 variances;
    variances.segment<3>(StateIndex::kPos).setConstant(e.position);
    variances.segment<3>(StateIndex::kRot).setConstant(e.rotation);
    limit_information<12>(variances / options_.variance, HtH, Htr);
}

/// K = (H^T H + (P / r)^-1)^-1 H^T: fewer states than rows.
bool Ieskf::tall_gain(const Mat23x23& P) {
    const Eigen::LLT<Mat23x23> prior(P / options_.variance);
    if (prior.info() != Eigen::Success) return false;
    const auto H = rows_.H.topRows(rows_.rows);
    Mat12 HtH = Mat12::Zero();
    Vec12 Htr = Vec12::Zero();
    for (Eigen::Index i = 0; i < rows_.rows; ++i) {  // in order: the sum repeats bit for bit
        const Eigen::Matrix<double, 12, 1> h = H.row(i);
        HtH.noalias() += h * h.transpose();
        Htr.noalias() += h * rows_.residual[i];
    }
    HtH_ = HtH;
    limit(HtH, Htr);
    Mat23x23 information = prior.solve(Mat23x23::Identity());
    information.topLeftCorner<12, 12>() += HtH;
    const Eigen::LLT<Mat23x23> posterior(0.5 * (information + information.transpose()));
    if (posterior.info() != Eigen::Success) return false;
    Eigen::Matrix<double, 23, 13> rhs = Eigen::Matrix<double, 23, 13>::Zero();
    rhs.topLeftCorner<12, 12>() = HtH;
    rhs.block<12, 1>(0, 12) = Htr;
    const Eigen::Matrix<double, 23, 13> solved = posterior.solve(rhs);
    KH_ = solved.leftCols<12>();
    Kr_ = solved.col(12);
    return true;
}

/// K = P H^T (H P H^T + r I)^-1: fewer rows than states.
bool Ieskf::wide_gain(const Mat23x23& P) {
    if (Eigen::LLT<Mat23x23>(P).info() != Eigen::Success) return false;
    const Eigen::MatrixXd H = rows_.H.topRows(rows_.rows);
    const Eigen::MatrixXd PHt = P.leftCols<12>() * H.transpose();
    const Eigen::MatrixXd S =
        H * PHt.topRows<12>() + options_.variance * Eigen::MatrixXd::Identity(H.rows(), H.rows());
    const Eigen::LLT<Eigen::MatrixXd> llt(0.5 * (S + S.transpose()));
    if (llt.info() != Eigen::Success) return false;
    const Eigen::MatrixXd K = llt.solve(PHt.transpose()).transpose();
    KH_ = K * H;
    HtH_ = H.transpose() * H;
    Kr_ = K * rows_.residual.head(rows_.rows);
    return true;
}

bool Ieskf::step(const Mat23x23& P, const Vec23& deviation, Vec23& dx) {
    const bool solved = rows_.rows < StateIndex::kSize ? wide_gain(P) : tall_gain(P);
    if (!solved) return false;
    dx = Kr_ + KH_ * deviation.head<12>() - deviation;
    return dx.allFinite();
}

bool Ieskf::posterior(const NavState& predicted, const Mat23x23& P, const Vec23& dx,
                      Mat23x23& out) const {
    const Mat23x23 J = state_transport(predicted, dx, options_.exact_jacobians);
    const Mat23x23 reduced = P - KH_ * P.topRows<12>();
    const Mat23x23 moved = J * reduced * J.transpose();
    out = 0.5 * (moved + moved.transpose());
    return out.allFinite() && Eigen::LLT<Mat23x23>(out).info() == Eigen::Success;
}

PoseUncertainty::Match Ieskf::match(const Mat23x23& P) const {
    PoseUncertainty::Match m;
    m.gain = KH_;
    m.noise = KH_ * P.topRows<12>();
    m.information = HtH_.topLeftCorner<6, 6>() / options_.variance;
    const double squares = rows_.residual.head(rows_.rows).squaredNorm();
    m.misfit = squares / (static_cast<double>(rows_.rows) * options_.variance);
    return m;
}

UpdateReport Ieskf::update(NavState& x, Mat23x23& P, const Measure& measure) {
    const NavState predicted = x;
    const Mat23x23 predicted_P = P;
    UpdateReport report;
    const auto fail = [&] {
        x = predicted;
        P = predicted_P;
        report.status = UpdateStatus::kNumericalFailure;
        return report;
    };
    bool search = true;
    NavState searched = x;
    const auto stays = [&] {
        return state_minus(x, searched).head<6>().cwiseAbs().maxCoeff() <= options_.limit;
    };
    int converged_steps = 0;
    Mat23x23 P_here = predicted_P;  // the prediction's covariance in the tangent space at x
    Vec23 dx = Vec23::Zero();
    const int passes = options_.max_iteration + 1;  // as FAST-LIO2 counts
    for (int i = 0; i < passes; ++i) {
        if (search) searched = x;
        if (!measure(x, search, rows_)) continue;
        const Vec23 d = state_minus(x, predicted);
        const Mat23x23 J = state_transport(predicted, d, options_.exact_jacobians);
        P_here = J * predicted_P * J.transpose();
        if (!step(P_here, J * d, dx)) return fail();
        x = state_plus(x, dx);
        ++report.iterations;
        report.status = UpdateStatus::kOk;
        search = dx.cwiseAbs().maxCoeff() <= options_.limit;
        if (search) ++converged_steps;
        if (search && options_.searches_once && stays()) break;
        if (converged_steps == 0 && i == passes - 2)
            search = true;  // last pass sees new neighbours
        if (converged_steps > 1) break;
    }
    if (report.status == UpdateStatus::kNoMeasurement) return report;
    report.converged = converged_steps > 0;
    if (!posterior(predicted, P_here, dx, P) || !x.is_finite()) return fail();
    return report;
}

}  // namespace d2lio::fastlio
