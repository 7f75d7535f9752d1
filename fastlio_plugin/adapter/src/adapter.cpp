// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/adapter.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <string>

#include "d2lio/degeneracy/prior.hpp"
#include "d2lio/geometry/so3.hpp"
#include "gate.hpp"

namespace d2lio::fastlio {
namespace {

Pose to_pose(const PoseView& v) {
    return {Eigen::Map<const Mat3>(v.rotation), Eigen::Map<const Vec3>(v.position)};
}

bool finite(const Pose& p) { return p.R.allFinite() && p.t.allFinite(); }

using StridedRows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3>, 0,
                               Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;

StridedRows block(const Rows& rows, int column) {
    return {rows.jacobian + column * rows.column_step, rows.count, 3,
            Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(rows.column_step, rows.row_step)};
}

Mat3 gram(const StridedRows& A) {
    Mat3 M = Mat3::Zero();
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
        const Vec3 a = A.row(i);
        M.noalias() += a * a.transpose();
    }
    return M;
}

}  // namespace

struct Adapter::Impl {
    RejectionConfig rejection;
    DegeneracyConfig degeneracy;
    ParamTable table;
    std::vector<ParamInfo> docs;
    double map_voxel = 0.5;
    std::string error;

    Rejector rejector{rejection, map_voxel};
    const Rejector host_gates{RejectionConfig{}, map_voxel};  ///< mode off
    DirectionalPrior prior{degeneracy};
    Gate gate;
    ScanDiagnostics current, last;
    std::vector<std::pair<std::string, double>> columns = last.columns();

    bool in_scan = false;
    Pose predicted;
    Mat3 P_r = Mat3::Identity(), P_t = Mat3::Identity();
    int position_index = 0, rotation_index = 3;
    PriorBlock rows{};
    double variance = 0.0;

    Impl() {
        rejection.bind(table);
        degeneracy.bind(table);
        docs = table.describe();
    }
    void rebuild() {
        rejector = Rejector(rejection, map_voxel);
        prior = DirectionalPrior(degeneracy);
    }
    Status read(const ScanInput& input);
    void copy_rows(const PriorRows& rows);
    void publish();
    void keep_spectrum(const Spectrum& s, const PriorTerm& term);
    void keep_corrections(const Pose& posterior);
    Status remove_prior(double* covariance, int size) const;
};

void Adapter::Impl::keep_spectrum(const Spectrum& s, const PriorTerm& term) {
    current.lambda_r = s.rotation.lambda;
    current.lambda_t = s.translation.lambda;
    current.v_r = s.rotation.v;
    current.v_t = s.translation.v;
    current.weak_r = s.rotation.weak_count(degeneracy.weak_share);
    current.weak_t = s.translation.weak_count(degeneracy.weak_share);
    for (int i = 0; i < 3; ++i) {
        current.prior_r[i] = s.rotation.v.col(i).dot(term.W_r * s.rotation.v.col(i));
        current.prior_t[i] = s.translation.v.col(i).dot(term.W_t * s.translation.v.col(i));
    }
}

void Adapter::Impl::keep_corrections(const Pose& posterior) {
    const Vec3 dr = log_so3(predicted.R.transpose() * posterior.R);
    const Vec3 dt = posterior.t - predicted.t;
    const auto part = [](const Mat3& v, int count, const Vec3& d) {
        double sum = 0.0;
        for (int i = 0; i < count; ++i) sum += std::pow(v.col(i).dot(d), 2);
        return std::sqrt(sum);
    };
    current.correction_r = dr.norm();
    current.correction_t = dt.norm();
    if (!current.v_t.allFinite()) return;  // no rows this scan
    current.correction_weak_r = part(current.v_r, current.weak_r, dr);
    current.correction_weak_t = part(current.v_t, current.weak_t, dt);
}

/// P without the k prior rows H (each of variance r): P + P H^T (r I - H P H^T)^-1 H P, the
/// Woodbury form of (P^-1 - H^T H / r)^-1.
Status Adapter::Impl::remove_prior(double* covariance, int size) const {
    if (rows.count == 0) return Status::kOk;
    Eigen::Map<Eigen::MatrixXd> P(covariance, size, size);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(rows.count, size);
    for (int i = 0; i < rows.count; ++i) {
        for (int j = 0; j < 3; ++j) {
            H(i, position_index + j) = rows.jacobian[i][j];
            H(i, rotation_index + j) = rows.jacobian[i][3 + j];
        }
    }
    const Eigen::MatrixXd PHt = P * H.transpose();
    const Eigen::MatrixXd S =
        variance * Eigen::MatrixXd::Identity(rows.count, rows.count) - H * PHt;
    const Eigen::LLT<Eigen::MatrixXd> llt(0.5 * (S + S.transpose()));
    if (llt.info() != Eigen::Success) return Status::kSingular;
    const Eigen::MatrixXd gain = PHt * llt.solve(PHt.transpose());
    if (!gain.allFinite()) return Status::kSingular;
    P += 0.5 * (gain + gain.transpose());
    return Status::kOk;
}

Adapter::Adapter() : impl_(std::make_unique<Impl>()) {}
Adapter::~Adapter() = default;

bool Adapter::set(const char* key, const char* value) {
    if (key == nullptr || value == nullptr) {
        impl_->error = "key or value missing";
        return false;
    }
    try {
        impl_->table.set(key, value);
        impl_->rebuild();
        impl_->error.clear();
        return true;
    } catch (const std::exception& e) {
        impl_->error = e.what();
        return false;
    }
}

bool Adapter::check() {
    try {
        impl_->rejection.validate();
        return true;
    } catch (const ConfigError& e) {
        impl_->error = e.what();
        return false;
    }
}

const char* Adapter::error() const { return impl_->error.c_str(); }
std::size_t Adapter::param_count() const { return impl_->docs.size(); }

ParamDoc Adapter::param(std::size_t i) const {
    if (i >= impl_->docs.size()) return {};
    const ParamInfo& d = impl_->docs[i];
    return {d.key.c_str(),   d.type.c_str(), d.default_value.c_str(),
            d.range.c_str(), d.unit.c_str(), d.doc.c_str()};
}

bool Adapter::set_map_voxel(double size) {
    if (!(size > 0.0) || !std::isfinite(size)) {
        impl_->error = "the map's voxel size must be positive";
        return false;
    }
    impl_->map_voxel = size;
    impl_->rebuild();
    return true;
}

bool Adapter::rejects() const { return impl_->rejector.active(); }
bool Adapter::has_prior() const { return impl_->prior.active(); }

/// Copies what later calls need. The views are not kept.
Status Adapter::Impl::read(const ScanInput& in) {
    const int n = in.covariance_size;
    const auto fits = [n](int index) { return index >= 0 && index + 3 <= n; };
    if (in.covariance == nullptr || !fits(in.position_index) || !fits(in.rotation_index)) {
        return Status::kBadInput;
    }
    predicted = to_pose(in.predicted);
    position_index = in.position_index;
    rotation_index = in.rotation_index;
    const Eigen::Map<const Eigen::MatrixXd> P(in.covariance, n, n);
    P_t = P.block<3, 3>(position_index, position_index);
    P_r = P.block<3, 3>(rotation_index, rotation_index);
    const bool usable = finite(predicted) && P_t.allFinite() && P_r.allFinite();
    return usable ? Status::kOk : Status::kBadInput;
}

Status Adapter::begin_scan(const ScanInput& input) {
    Impl& m = *impl_;
    m.current = ScanDiagnostics{};
    m.rows = PriorBlock{};
    m.gate.begin_scan(input.points);
    m.in_scan = false;
    const Pose previous = to_pose(input.previous);
    const Status status = m.read(input);
    if (status != Status::kOk || !finite(previous)) return Status::kBadInput;
    m.in_scan = true;
    m.rejector.begin_scan(previous.inverse() * m.predicted);
    m.current.sigma = m.rejector.sigma();
    return Status::kOk;
}

Verdict Adapter::accept(const Candidate& candidate, Correspondence* out) {
    return impl_->gate.accept(candidate, impl_->in_scan ? impl_->rejector : impl_->host_gates, out);
}

void Adapter::Impl::copy_rows(const PriorRows& p) {
    for (int i = 0; i < p.count; ++i) {
        for (int j = 0; j < 3; ++j) {
            rows.jacobian[i][j] = p.translation(i, j);
            rows.jacobian[i][3 + j] = p.rotation(i, j);
        }
        rows.residual[i] = p.residual[i];
    }
    rows.count = p.count;
}

Status Adapter::condition(const Rows& rows, const PoseView& pose, double variance,
                          PriorBlock* prior) {
    Impl& m = *impl_;
    m.rows = PriorBlock{};
    *prior = m.rows;
    if (!m.in_scan) return Status::kNoScan;
    ++m.current.iterations;
    StridedRows A_t = block(rows, rows.position_column);
    StridedRows A_r = block(rows, rows.rotation_column);
    const Spectrum spectrum{decompose(gram(A_r)), decompose(gram(A_t))};
    const PriorTerm term = m.prior.evaluate(spectrum, m.P_r, m.P_t);
    m.keep_spectrum(spectrum, term);
    if (term.projects) {
        A_t *= term.keep_t;
        A_r *= term.keep_r;
    }
    const Pose x = to_pose(pose);
    if (!term.adds_prior || !finite(x)) return Status::kOk;
    const Vec3 e_r = log_so3(m.predicted.R.transpose() * x.R);
    m.copy_rows(make_prior_rows(term, e_r, x.t - m.predicted.t, variance));
    m.variance = variance;
    *prior = m.rows;
    return Status::kOk;
}

void Adapter::Impl::publish() {
    current.counts = gate.counts();
    gate.threshold_statistics(current);
    last = current;
    columns = last.columns();
}

Status Adapter::end_scan(const PoseView& posterior, bool converged, double* covariance, int size) {
    Impl& m = *impl_;
    const bool in_scan = m.in_scan;
    m.in_scan = false;
    m.current.converged = converged;
    const Pose x = to_pose(posterior);
    Status status = in_scan ? Status::kBadInput : Status::kNoScan;
    if (in_scan && finite(x)) {
        status = Status::kOk;
        m.rejector.end_scan(m.predicted.inverse() * x);
        m.keep_corrections(x);
        if (m.degeneracy.inflate_only && covariance != nullptr) {
            status = m.remove_prior(covariance, size);
        }
    }
    m.publish();
    return status;
}

void Adapter::reset() {
    impl_->rebuild();
    impl_->in_scan = false;
}

std::size_t Adapter::diagnostics_size() const { return impl_->columns.size(); }
const char* Adapter::diagnostics_name(std::size_t i) const {
    return i < impl_->columns.size() ? impl_->columns[i].first.c_str() : nullptr;
}
double Adapter::diagnostics_value(std::size_t i) const {
    return i < impl_->columns.size() ? impl_->columns[i].second : kNaN;
}
const ScanDiagnostics& Adapter::diagnostics() const { return impl_->last; }

}  // namespace d2lio::fastlio
