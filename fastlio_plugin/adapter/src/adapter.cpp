// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/adapter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "d2lio/degeneracy/clean_rows.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/plugin/core.hpp"
#include "gate.hpp"

namespace d2lio::fastlio {
namespace {

using StridedRows = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3>, 0,
                               Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;

StridedRows block(const Rows& rows, int column) {
    return {rows.jacobian + column * rows.column_step, rows.count, 3,
            Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(rows.column_step, rows.row_step)};
}

RowView::Block view_of(const Rows& rows, int column) {
    return {rows.jacobian + column * rows.column_step, rows.count, rows.row_step, rows.column_step};
}

Mat3 gram(const StridedRows& A) {
    Mat3 M = Mat3::Zero();
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
        const Vec3 a = A.row(i);
        M.noalias() += a * a.transpose();
    }
    return M;
}

/// A filter that did not begin at rest knows its velocity from the scans alone: it gets all of them
/// while it learns it.
constexpr int kSettlingScans = 20;

}  // namespace

struct Adapter::Impl {
    Gate gate;
    int position_index = 0, rotation_index = 3;
    PriorBlock rows{};
    double variance = 0.0;
    int scans = 0;                      ///< since the last reset
    bool rested = false;                ///< one of them
    bool at_rest = false;               ///< this one
    std::vector<std::size_t> accepted;  ///< the points behind the rows, in order
    RowCleaner cleaner;
    Gate::Look look = Gate::Look::kAll;

    bool read(const ScanInput& input, Core& core);
    void copy_rows(const PriorRows& rows);
    bool settled() const { return rested || scans > kSettlingScans; }
    void clean(const Rows& rows, const Pose& x, double row_variance, Core& core);
    void choose_look(const Core& core);
    Status remove_prior(double* covariance, int size) const;
};

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

/// Copies what later calls need; the views are not kept. False for a covariance that has no such
/// blocks.
bool Adapter::Impl::read(const ScanInput& in, Core& core) {
    const int n = in.covariance_size;
    const auto fits = [n](int index) { return index >= 0 && index + 3 <= n; };
    if (in.covariance == nullptr || !fits(in.position_index) || !fits(in.rotation_index)) {
        return false;
    }
    core.predicted = to_pose(in.predicted);
    position_index = in.position_index;
    rotation_index = in.rotation_index;
    const Eigen::Map<const Eigen::MatrixXd> P(in.covariance, n, n);
    core.P_t = P.block<3, 3>(position_index, position_index);
    core.P_r = P.block<3, 3>(rotation_index, rotation_index);
    return true;
}

Status Adapter::begin_scan(const ScanInput& input) {
    impl_->rows = PriorBlock{};
    ++impl_->scans;
    impl_->at_rest = input.at_rest;
    impl_->rested = impl_->rested || input.at_rest;
    const bool usable = impl_->read(input, core());
    const Status status = core().begin(usable, to_pose(input.previous));
    if (!core().degeneracy.cleans_rows()) impl_->look = Gate::Look::kNot;
    impl_->gate.begin_scan(input.points, core().predicted.t, impl_->look);
    return status;
}

Verdict Adapter::accept(const Candidate& candidate, Correspondence* out) {
    return impl_->gate.accept(candidate, core().gates(), out);
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

/// Where the last scan saw every direction well, a sample of the next one's surfaces will tell.
void Adapter::Impl::choose_look(const Core& core) {
    const double well = 0.5 * core.degeneracy.noise_aware.share_low;
    const bool seeing = core.current.noise_share[0] < well;
    look = seeing ? Gate::Look::kSample : Gate::Look::kAll;
}

/// The host's rows as RowCleaner sees them.
class HostRows {
  public:
    HostRows(const Rows& rows, double variance, const Pose& x, const Gate& gate,
             const std::vector<std::size_t>& accepted)
        : rows_(rows),
          variance_(variance),
          R_inverse_(x.R.transpose()),
          t_(x.t),
          gate_(gate),
          accepted_(accepted) {}

    std::size_t size() const { return accepted_.size(); }
    Vec3 normal(std::size_t k) const {
        const double* const n = entry(k, rows_.position_column);
        return {n[0], n[rows_.column_step], n[2 * rows_.column_step]};
    }
    const Patch* patch(std::size_t k) const { return gate_.patch(accepted_[k]); }
    double trusted(std::size_t k, const Vec3& normal, const BlindDirections& blind) const {
        return trust(rows_.residual[k], normal, *patch(k), blind, variance_);
    }

    void replace(std::size_t k, const CleanedRow& cleaned, bool lost) {
        const Vec3 arm = gate_.point(accepted_[k]).cast<double>() - t_;
        const Vec3 kept = cleaned.weight * cleaned.normal;
        put(k, rows_.position_column, kept);
        put(k, rows_.rotation_column, R_inverse_ * arm.cross(kept));
        rows_.residual[k] *= cleaned.weight;
        if (rows_.extrinsic_column < 0) return;
        // A row that lost something tells nothing of the extrinsic.
        const double share = lost ? 0.0 : cleaned.weight;
        double* const extrinsic = entry(k, rows_.extrinsic_column);
        for (int c = 0; c < 6; ++c) extrinsic[c * rows_.column_step] *= share;
    }

  private:
    double* entry(std::size_t k, int column) const {
        return rows_.jacobian + static_cast<std::ptrdiff_t>(k) * rows_.row_step +
               column * rows_.column_step;
    }
    void put(std::size_t k, int column, const Vec3& v) {
        double* const to = entry(k, column);
        to[0] = v[0];
        to[rows_.column_step] = v[1];
        to[2 * rows_.column_step] = v[2];
    }

    const Rows rows_;
    const double variance_;
    const Mat3 R_inverse_;
    const Vec3 t_;
    const Gate& gate_;
    const std::vector<std::size_t>& accepted_;
};

/// Takes what noise has put into the rows along blind directions out of them (method noise_aware).
void Adapter::Impl::clean(const Rows& rows, const Pose& x, double row_variance, Core& core) {
    accepted.clear();
    for (std::size_t i = 0; i < gate.book().size(); ++i) {
        if (gate.book().verdict(i) == Verdict::kAccepted) accepted.push_back(i);
    }
    if (static_cast<int>(accepted.size()) != rows.count) return;  // not the rows offered here
    HostRows host(rows, row_variance, x, gate, accepted);
    const BlindDirections blind = core.find_blind(cleaner.sums(host));
    if (look == Gate::Look::kSample && blind.count > 0) {  // by too few patches to act on it
        core.forget_blind();
        return;
    }
    if (blind.count == 0 || at_rest || !settled()) return;
    core.current.cleaned = cleaner.clean(blind, core.degeneracy.noise_aware, host);
}

Status Adapter::condition(const Rows& rows, const PoseView& pose, double variance,
                          PriorBlock* prior) {
    Impl& m = *impl_;
    m.rows = PriorBlock{};
    *prior = m.rows;
    if (!core().in_scan) return Status::kNoScan;
    StridedRows A_t = block(rows, rows.position_column);
    StridedRows A_r = block(rows, rows.rotation_column);
    const Pose x = to_pose(pose);
    core().current.cleaned = 0;
    if (core().degeneracy.cleans_rows() && is_finite(x)) m.clean(rows, x, variance, core());
    const RowView view{view_of(rows, rows.rotation_column), view_of(rows, rows.position_column)};
    const PriorTerm term = core().analyse(gram(A_r), gram(A_t), &view);
    if (term.projects) {
        A_t *= term.keep_t;
        A_r *= term.keep_r;
    }
    if (!term.adds_prior || !is_finite(x)) return Status::kOk;
    const Vec3 e_r = log_so3(core().predicted.R.transpose() * x.R);
    m.copy_rows(make_prior_rows(term, e_r, x.t - core().predicted.t, variance));
    m.variance = variance;
    *prior = m.rows;
    return Status::kOk;
}

Status Adapter::end_scan(const PoseView& posterior, bool converged, double* covariance, int size) {
    Status status = core().end(to_pose(posterior), converged);
    if (status == Status::kOk && core().degeneracy.inflate_only && covariance != nullptr) {
        status = impl_->remove_prior(covariance, size);
    }
    impl_->gate.end_scan();
    impl_->choose_look(core());
    impl_->gate.book().close(core().current);
    core().publish();
    return status;
}

void Adapter::reset() {
    Plugin::reset();
    impl_->gate.reset();
    impl_->scans = 0;
    impl_->look = Gate::Look::kAll;
    impl_->rested = false;
}

std::size_t Adapter::verdict_count() const { return impl_->gate.book().size(); }

Verdict Adapter::verdict(std::size_t i) const {
    const std::vector<Verdict>& verdicts = impl_->gate.book().verdicts();
    return i < verdicts.size() ? verdicts[i] : Verdict::kFewNeighbours;
}

}  // namespace d2lio::fastlio
