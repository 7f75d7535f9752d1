// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/adapter.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "d2lio/degeneracy/clean_rows.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/plugin/core.hpp"
#include "gate.hpp"
#include "host_rows.hpp"

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

/// How many times its own information the prediction gets along a direction that a policy holds.
/// More would hold no better, and what is left of S in remove_prior() would be rounding.
constexpr double kHold = 1e6;

/// kHold (V^T P V)^-1 on the directions V that `keep` takes out.
Mat3 held(const Mat3& keep, const Mat3& P) {
    const Mat3 drop = Mat3::Identity() - keep;
    if (drop.trace() < 0.5) return Mat3::Zero();  // a projector's trace is a whole number
    return kHold * drop * (drop * P * drop + keep).inverse() * drop;
}

/// Pins the directions a policy takes from the scan to the prediction. Rows without them are not
/// enough in a filter: P couples position and attitude with each other and with what the rows see,
/// and the directions of one scan lie a degree beside those of the last.
void hold(const Mat3& P_r, const Mat3& P_t, PriorTerm& term) {
    term.W_r = held(term.keep_r, P_r);
    term.W_t = held(term.keep_t, P_t);
    term.adds_prior = true;
}

}  // namespace

struct Adapter::Impl {
    Gate gate;
    int position_index = 0, rotation_index = 3;
    PriorBlock rows{};
    double variance = 0.0;
    int scans = 0;         ///< since the last reset
    bool rested = false;   ///< one of them
    bool at_rest = false;  ///< this one
    std::vector<HostRows::Entry> speaking;
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

/// Takes what noise has put into the rows along blind directions out of them (method noise_aware).
/// What is blind is found from the first rows of a scan. They are cleaned where they are; from then
/// on the gate gives normals that are clean already, all but those of the few rows that speak.
void Adapter::Impl::clean(const Rows& rows, const Pose& x, double row_variance, Core& core) {
    if (gate.book().accepted() != rows.count) return;  // not the rows offered here
    if (!gate.surveyed()) core.find_blind(gate.survey(rows.residual));
    if (look == Gate::Look::kSample) {
        core.forget_blind();  // too few patches to act by
        return;
    }
    const BlindDirections blind = core.blind_now;
    if (blind.count == 0 || at_rest || !settled()) return;
    const NoiseAwareConfig& config = core.degeneracy.noise_aware;
    const bool clean_already = gate.cleans();
    gate.clean(blind, config);
    HostRows host(rows, row_variance, x, gate, speaking);
    host.clean_others(blind, clean_already);
    const int others = rows.count - static_cast<int>(host.size());
    core.current.cleaned = others + cleaner.clean(blind, config, host);
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
    PriorTerm term = core().analyse(gram(A_r), gram(A_t), &view);
    if (term.projects) {
        A_t *= term.keep_t;
        A_r *= term.keep_r;
        hold(core().P_r, core().P_t, term);
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

ScanError Adapter::scan_error(double misfit) const {
    return impl_->settled() ? Plugin::scan_error(misfit) : ScanError{};
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
