// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/liosam/adapter.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "d2lio/geometry/so3.hpp"
#include "d2lio/plugin/core.hpp"
#include "d2lio/plugin/verdict_book.hpp"
#include "step_control.hpp"

namespace d2lio::liosam {
namespace {

/// LIO-SAM's constants of the correspondence test (UPSTREAM.md: kNN, gate, minimum of s).
constexpr int kNeighbours = 5;
constexpr float kMaxSqDistance = 1.0F;  ///< m^2, of the farthest neighbour
constexpr double kMinWeight = 0.1;
/// Weight of an accepted feature that the host alone would have rejected: just above its minimum.
constexpr double kFloorWeight = 0.101;
constexpr double kMinCosPitch = 1e-6;  ///< nearer to 90 deg of pitch the variables are singular

constexpr float kReject = std::numeric_limits<float>::infinity();

using Mat6Map = Eigen::Map<Mat6>;
using Vec6Map = Eigen::Map<Vec6>;

/// A term that pins the directions a policy takes from the scan to the prediction, as strongly as
/// the scan holds its best direction.
PriorTerm hold(const PriorTerm& term, const Mat6& AtA) {
    PriorTerm out;
    const double scale_r = std::max(AtA.topLeftCorner<3, 3>().trace(), 1.0);
    const double scale_t = std::max(AtA.bottomRightCorner<3, 3>().trace(), 1.0);
    out.W_r = scale_r * (Mat3::Identity() - term.keep_r);
    out.W_t = scale_t * (Mat3::Identity() - term.keep_t);
    out.adds_prior = true;
    return out;
}

void add_rows(const PriorRows& rows, const NormalEquations& eq) {
    Mat6 J;
    J << rows.rotation, rows.translation;
    Mat6Map(eq.AtA).noalias() += J.transpose() * J;
    Vec6Map(eq.Atb).noalias() += J.transpose() * rows.residual;
}

}  // namespace

void rotation_from_rpy(const double* rpy, double* out) {
    Eigen::Map<Mat3> R(out);
    R = (Eigen::AngleAxisd(rpy[2], Vec3::UnitZ()) * Eigen::AngleAxisd(rpy[1], Vec3::UnitY()) *
         Eigen::AngleAxisd(rpy[0], Vec3::UnitX()))
            .toRotationMatrix();
}

void euler_jacobian(double roll, double pitch, double* out) {
    Eigen::Map<Mat3> E(out);
    const double sr = std::sin(roll), cr = std::cos(roll);
    const double sp = std::sin(pitch), cp = std::cos(pitch);
    E << 1.0, 0.0, -sp, 0.0, cr, sr * cp, 0.0, -sr, cr * cp;
}

struct Adapter::Impl {
    VerdictBook book;
    StepControl steps;
    std::size_t corners = 0;
    bool degenerate = false;

    std::size_t slot(Feature feature, std::size_t index) const {
        return feature == Feature::kCorner ? index : corners + index;
    }
};

Adapter::Adapter() : impl_(std::make_unique<Impl>()) {}
Adapter::~Adapter() = default;

Status Adapter::begin_scan(const ScanInput& input) {
    impl_->corners = input.corners;
    impl_->book.begin_scan(input.corners + input.surfaces);
    impl_->degenerate = false;
    impl_->steps.begin();
    if (input.covariance != nullptr) {
        const Eigen::Map<const Mat6> P(input.covariance);
        core().P_r = P.topLeftCorner<3, 3>();
        core().P_t = P.bottomRightCorner<3, 3>();
    }
    core().predicted = to_pose(input.predicted);
    return core().begin(input.covariance != nullptr, to_pose(input.previous));
}

float Adapter::gate(const Candidate& c) {
    const std::size_t slot = impl_->slot(c.feature, c.index);
    if (slot >= impl_->book.size()) return kReject;
    impl_->book.set_range(slot, c.range);
    Verdict& verdict = impl_->book.verdict(slot);
    verdict = Verdict::kFewNeighbours;
    if (c.neighbour_count < kNeighbours) return kReject;

    const Rejector& rejector = core().gates();
    const float farthest = c.sq_distances[(kNeighbours - 1) * c.distance_step];
    verdict = Verdict::kFarNeighbours;
    if (rejector.host_gates() && !(farthest < kMaxSqDistance)) return kReject;

    const double threshold = rejector.threshold(c.range);
    impl_->book.set_threshold(slot, threshold);
    verdict = Verdict::kThreshold;
    const auto nearest = static_cast<double>(c.sq_distances[0]);
    if (!(nearest <= threshold * threshold)) return kReject;
    verdict = Verdict::kPlaneFit;  // until the host's fit has come to weigh()
    return rejector.host_gates() ? farthest : 0.0F;
}

double Adapter::weigh(Feature feature, std::size_t index, double weight) {
    const std::size_t slot = impl_->slot(feature, index);
    if (slot >= impl_->book.size() || !std::isfinite(weight)) return 0.0;
    Verdict& verdict = impl_->book.verdict(slot);
    if (core().gates().host_gates()) {
        verdict = weight > kMinWeight ? Verdict::kAccepted : Verdict::kResidual;
        return verdict == Verdict::kAccepted ? weight : 0.0;
    }
    verdict = Verdict::kAccepted;
    return std::max(weight, kFloorWeight);
}

void Adapter::mark_singular(Feature feature, std::size_t index) {
    const std::size_t slot = impl_->slot(feature, index);
    if (slot < impl_->book.size()) impl_->book.verdict(slot) = Verdict::kSingularPlane;
}

Status Adapter::condition_tangent(const PoseView& pose, double variance,
                                  const NormalEquations& equations) {
    if (!core().in_scan) return Status::kNoScan;
    const Mat6 AtA = Mat6Map(equations.AtA);
    if (!AtA.allFinite()) return Status::kBadInput;
    PriorTerm term =
        core().analyse(AtA.topLeftCorner<3, 3>(), AtA.bottomRightCorner<3, 3>(), equations.rows);
    impl_->degenerate = core().current.weak_r + core().current.weak_t > 0;
    const Pose x = to_pose(pose);
    if (!is_finite(x)) return Status::kBadInput;
    if (term.projects) {
        Mat6 K = Mat6::Zero();
        K.topLeftCorner<3, 3>() = term.keep_r;
        K.bottomRightCorner<3, 3>() = term.keep_t;
        Mat6Map(equations.AtA) = K.transpose() * AtA * K;
        Vec6Map(equations.Atb) = (K.transpose() * Vec6Map(equations.Atb)).eval();
        term = hold(term, AtA);
        variance = 1.0;
    }
    if (!term.adds_prior) return Status::kOk;
    const Pose& predicted = core().predicted;
    const Vec3 e_r = log_so3(predicted.R.transpose() * x.R);
    add_rows(make_prior_rows(term, e_r, x.t - predicted.t, variance), equations);
    return Status::kOk;
}

/// With J = blkdiag(E, I), a step d in LIO-SAM's variables is the step J d in the tangent.
Status Adapter::condition(const double* pose, double variance, const NormalEquations& equations) {
    if (!core().in_scan) return Status::kNoScan;
    if (!Eigen::Map<const Vec6>(pose).allFinite()) return Status::kBadInput;
    if (!(std::abs(std::cos(pose[1])) > kMinCosPitch)) return Status::kSingular;
    Mat3 E;
    euler_jacobian(pose[0], pose[1], E.data());
    Mat6 J = Mat6::Identity(), J_inverse = Mat6::Identity();
    J.topLeftCorner<3, 3>() = E;
    J_inverse.topLeftCorner<3, 3>() = E.inverse();

    Mat6 AtA = J_inverse.transpose() * Mat6Map(equations.AtA) * J_inverse;
    Vec6 Atb = J_inverse.transpose() * Vec6Map(equations.Atb);
    Mat3 R;
    rotation_from_rpy(pose, R.data());
    const Vec3 t(pose[3], pose[4], pose[5]);
    const Status status =
        condition_tangent({R.data(), t.data()}, variance, {AtA.data(), Atb.data()});
    if (status != Status::kOk || !has_prior()) return status;
    Mat6Map(equations.AtA) = J.transpose() * AtA * J;
    Vec6Map(equations.Atb) = J.transpose() * Atb;
    return Status::kOk;
}

double Adapter::step_factor(const double* step, const double* AtA) {
    if (core().gates().host_gates()) return 1.0;
    return impl_->steps.factor(Eigen::Map<const Vec6>(step), Eigen::Map<const Mat6>(AtA));
}

bool Adapter::degenerate() const { return impl_->degenerate; }

Status Adapter::end_scan(const PoseView& estimate, bool converged) {
    const Status status = core().end(to_pose(estimate), converged);
    impl_->book.close(core().current);
    core().publish();
    return status;
}

std::size_t Adapter::verdict_count() const { return impl_->book.size(); }

Verdict Adapter::verdict(std::size_t i) const {
    const std::vector<Verdict>& verdicts = impl_->book.verdicts();
    return i < verdicts.size() ? verdicts[i] : Verdict::kFewNeighbours;
}

}  // namespace d2lio::liosam
