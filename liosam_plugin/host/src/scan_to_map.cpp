// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "scan_to_map.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "d2lio/degeneracy/scan_error.hpp"
#include "d2lio/geometry/plane.hpp"
#include "d2lio/geometry/so3.hpp"
#include "d2lio/host/stop_watch.hpp"
#include "line_fit.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kNeighbours = 5;
constexpr float kGate = 1.0F;           ///< m^2, farthest neighbour LIO-SAM looks at
constexpr float kPlaneDistance = 0.2F;  ///< m, of every neighbour from the plane
constexpr double kWeightSlope = 0.9;    ///< of LIO-SAM's s
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// The kernel's scale by the upper quartile of the distances (2.3 sigma of normal ones), and its
/// limits in shares of what is configured, the upper one within a scan that is still moving; from
/// scan to scan it is 1.
constexpr double kQuartile = 0.75, kKernelByQuartile = 2.0;
constexpr double kLeastKernel = 0.3, kMostKernelWithin = 5.0;

constexpr double kDegree = 57.29577951308232;
constexpr double kCentimetre = 100.0;

/// The weight a correspondence gets from its distance alone; LIO-SAM's s or the square root of the
/// Cauchy kernel's weight (rows are multiplied by it, so the cost sees its square).
double weight_of(double kernel_scale, Feature feature, double distance, double range) {
    const double d = std::abs(distance);
    if (kernel_scale > 0.0) return 1.0 / std::sqrt(1.0 + std::pow(d / kernel_scale, 2));
    if (feature == Feature::kCorner) return 1.0 - kWeightSlope * d;
    return 1.0 - kWeightSlope * d / std::sqrt(range);
}

}  // namespace

ScanToMap::ScanToMap(Adapter& adapter, const MatchOptions& options, int threads)
    : adapter_(adapter),
      options_(options),
      loop_(threads),
      kernel_scale_(options.kernel_scale),
      spread_(static_cast<float>(mean_spread(options.map_leaf))) {}

/// Nearest map points. By the triangle inequality the neighbours of the last search still lie
/// within its reach plus the query's motion, so bounding the search there changes nothing but its
/// time.
void ScanToMap::search(const Eigen::Vector3f& query, const IkdTree& map, Memory& memory,
                       Neighbours& near) const {
    constexpr float kRounding = 1.0001F;
    const float moved = (query - memory.query).norm();
    const float within = (memory.reach + moved) * (memory.reach + moved) * kRounding;
    const float gate = bounded_search_ ? kGate : kInfinity;
    map.knn(query, kNeighbours, within < gate ? within : gate, near);
    memory.query = query;
    memory.reach = near.count == kNeighbours ? std::sqrt(near[kNeighbours - 1].sq_dist) : kInfinity;
}

/// Whether the adapter lets the feature go on to a fit.
bool ScanToMap::admit(Feature feature, std::size_t index, double range, const Neighbours& near,
                      const IkdTree& map) {
    float sq[kNeighbours];
    for (int i = 0; i < kNeighbours; ++i) sq[i] = i < near.count ? near[i].sq_dist : kInfinity;
    const bool cut_off = bounded_search_ && map.size() >= kNeighbours;  // the others are beyond
    const Candidate candidate{feature, index, range, sq, 1, cut_off ? kNeighbours : near.count};
    return adapter_.gate(candidate) < kGate;
}

/// Line or plane through the neighbours; false where they have none.
bool ScanToMap::fit(Feature feature, std::size_t index, const Neighbours& near,
                    const Eigen::Vector3f& q, Match& m) {
    const float* const xyz = &near.items[0].x;
    constexpr int kStride = sizeof(Neighbour) / sizeof(float);
    if (feature == Feature::kCorner) {
        Line line;
        if (!fit_line(xyz, kStride, kNeighbours, line)) return false;
        m.normal = line.away_from(q);
        m.distance = static_cast<double>(m.normal.dot(q - line.point));
        return true;
    }
    Plane plane;
    PlaneFitOptions options;
    options.max_distance = kPlaneDistance;
    options.min_spread_ratio = options_.min_spread_ratio;
    PlaneMoments moments;
    const PlaneStatus status = fit_plane(xyz, kStride, kNeighbours, options, plane,
                                         m.patch != nullptr ? &moments : nullptr);
    if (status == PlaneStatus::kSingular) adapter_.mark_singular(feature, index);
    if (status != PlaneStatus::kOk) return false;
    m.normal = plane.normal;
    float distance = plane.signed_distance(q);
    if (m.patch != nullptr) {
        const SurfaceSide side = side_of(plane.normal, sensor_ - near[0].point());
        make_patch(xyz, kStride, kNeighbours, moments, plane.normal, side, *m.patch);
        distance -= bends_.sag(*m.patch, plane.normal, q, spread_);
    }
    m.distance = static_cast<double>(distance);
    return true;
}

ScanToMap::Row ScanToMap::match(Feature feature, std::size_t index, const Eigen::Vector3f& p_imu,
                                const IkdTree& map, const Pose& T, Memory& memory, Patch* patch) {
    const Vec3 p = p_imu.cast<double>();
    Row row{Vec6::Zero(), 0.0, false, 1.0, patch != nullptr, p};
    const Eigen::Vector3f q = (T * p).cast<float>();
    const double range = p.norm();
    Neighbours near;
    search(q, map, memory, near);
    Match m{Eigen::Vector3f::Zero(), 0.0, patch};
    if (!admit(feature, index, range, near, map) || !fit(feature, index, near, q, m)) return row;
    const double weight =
        adapter_.weigh(feature, index, weight_of(kernel_scale_, feature, m.distance, range));
    if (!(weight > 0.0)) return row;
    const Vec3 n = m.normal.cast<double>();
    row.jacobian << weight * p.cross(T.R.transpose() * n), weight * n;
    row.residual = weight * m.distance;
    row.weight = weight;
    row.used = std::isfinite(row.residual) && row.jacobian.allFinite();
    return row;
}

/// Rows are found in parallel and summed in order, so the sum does not depend on the threads.
int ScanToMap::linearise(const MatchInput& in, const Pose& T, Mat6& AtA, Vec6& Atb) {
    const std::size_t corners = in.corners.size();
    rows_.resize(corners + in.surfaces.size());
    const bool surfaces = adapter_.reads_surfaces();
    if (surfaces) patches_.resize(rows_.size());
    loop_(rows_.size(), [&](std::size_t i) {
        rows_[i] =
            i < corners
                ? match(Feature::kCorner, i, in.corners[i], in.corner_map, T, memory_[i], nullptr)
                : match(Feature::kSurface, i - corners, in.surfaces[i - corners], in.surface_map, T,
                        memory_[i], surfaces ? &patches_[i] : nullptr);
    });
    if (surfaces) clean(T);
    AtA.setZero();
    Atb.setZero();
    int used = 0;
    for (const Row& row : rows_) {
        if (!row.used) continue;
        AtA.selfadjointView<Eigen::Lower>().rankUpdate(row.jacobian);
        Atb -= row.residual * row.jacobian;
        ++used;
    }
    AtA.triangularView<Eigen::StrictlyUpper>() = AtA.transpose();
    return used;
}

/// The rows in use, without their weights.
RowView ScanToMap::view_rows() {
    unweighted_.clear();
    for (const Row& row : rows_) {
        if (row.used) unweighted_.push_back(row.jacobian / row.weight);
    }
    const auto block = [this](int column) -> RowView::Block {
        const double* const first = unweighted_.empty() ? nullptr : unweighted_[0].data() + column;
        return {first, static_cast<int>(unweighted_.size()), 6, 1};
    };
    return {block(0), block(3)};
}

double ScanToMap::mean_square() const {
    double squares = 0.0, weights = 0.0;
    for (const Row& row : rows_) {
        if (!row.used) continue;
        squares += row.residual * row.residual;
        weights += row.weight * row.weight;
    }
    return weights > 0.0 ? squares / weights : 0.0;
}

/// The rows in use as RowCleaner sees them.
class ScanToMap::UsedRows {
  public:
    UsedRows(const MatchOptions& options, std::vector<Row>& rows, const std::vector<Patch>& patches,
             const Mat3& R)
        : options_(options), rows_(rows), patches_(patches), R_(R) {
        for (std::size_t i = 0; i < rows.size(); ++i) {
            if (rows[i].used) used_.push_back(i);
        }
    }
    std::size_t size() const { return used_.size(); }
    Vec3 normal(std::size_t k) const { return rows_[used_[k]].normal(); }
    const Patch* patch(std::size_t k) const {
        return rows_[used_[k]].has_patch ? &patches_[used_[k]] : nullptr;
    }
    double trusted(std::size_t k, const Vec3& normal, const BlindDirections& blind) const {
        if (options_.kernel_scale > 0.0) return 1.0;  // the weight is a robust one already
        const Row& row = rows_[used_[k]];
        return trust(row.residual / row.weight, normal, *patch(k), blind, options_.variance);
    }
    void replace(std::size_t k, const CleanedRow& cleaned, bool /*lost*/) {
        Row& row = rows_[used_[k]];
        const Vec3 kept = row.weight * cleaned.weight * cleaned.normal;
        row.jacobian << row.p.cross(R_.transpose() * kept), kept;
        row.residual *= cleaned.weight;
    }

  private:
    const MatchOptions& options_;
    std::vector<Row>& rows_;
    const std::vector<Patch>& patches_;
    const Mat3& R_;
    std::vector<std::size_t> used_;
};

/// Takes what noise has put into the rows along blind directions out of them (method noise_aware).
void ScanToMap::clean(const Pose& T) {
    UsedRows rows(options_, rows_, patches_, T.R);
    const BlindDirections blind = adapter_.find_blind(cleaner_.sums(rows));
    if (blind.count == 0 || resting_) return;
    adapter_.note_cleaned(cleaner_.clean(blind, adapter_.noise_aware(), rows));
}

/// Where the guess is an estimate of its own, the scan's own error as a rigid body matters.
void ScanToMap::limit(Mat6& AtA, Vec6& Atb) const {
    const ScanError error = adapter_.scan_error(mean_square() / options_.variance);
    Vec6 variances;
    variances << Vec3::Constant(error.rotation), Vec3::Constant(error.position);
    limit_information<6>(variances / options_.variance, AtA, Atb);
}

/// Adds information W of the guess: the cost |e|^2_W, e = (Log(R_guess^T R), t - t_guess), in units
/// of the rows' variance.
void ScanToMap::add_prior(const Pose& T, Mat6& AtA, Vec6& Atb) const {
    Vec6 e;
    e << log_so3(guess_.R.transpose() * T.R), T.t - guess_.t;
    Mat6 J = Mat6::Identity();
    J.topLeftCorner<3, 3>() = right_jacobian_inverse_so3(e.head<3>());
    const Mat6 W = options_.variance * *prior_;
    AtA.noalias() += J.transpose() * W * J;
    Atb.noalias() -= J.transpose() * (W * e);
}

/// How far the points of this place lie from its surfaces: walls to 2 cm, bushes to a decimetre.
/// Beyond that a distance is a wrong match, and there are many along a street. While a scan is
/// being moved to the map all its distances are long, and a kernel as narrow as the place would
/// hold it where it is: at a start in motion, for good.
void ScanToMap::learn_kernel() {
    distances_.clear();
    for (const Row& row : rows_) {
        if (row.used) distances_.push_back(std::abs(row.residual / row.weight));
    }
    if (options_.kernel_scale <= 0.0 || distances_.empty()) return;
    const double rank = kQuartile * static_cast<double>(distances_.size());
    const auto quartile = distances_.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(distances_.begin(), quartile, distances_.end());
    kernel_scale_ = std::clamp(kKernelByQuartile * *quartile, kLeastKernel * options_.kernel_scale,
                               kMostKernelWithin * options_.kernel_scale);
}

void ScanToMap::learn_bends() {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i].used && rows_[i].has_patch) bends_.add(patches_[i]);
    }
    bends_.end_scan();
}

/// LIO-SAM's own remedy (Zhang 2016): directions of the mixed-unit A^T A with an eigenvalue below
/// the threshold get no step. Found at the first iteration, kept for the scan.
void ScanToMap::find_remapping(const Mat6& AtA, MatchReport& report) {
    keep_.setIdentity();
    const bool own = !adapter_.has_prior() && prior_ == nullptr;
    if (!own || options_.eigenvalue_threshold <= 0.0) return;
    const Eigen::SelfAdjointEigenSolver<Mat6> solver(AtA);
    for (int i = 0; i < 6; ++i) {
        if (solver.eigenvalues()[i] >= options_.eigenvalue_threshold) continue;
        const Vec6 v = solver.eigenvectors().col(i);
        keep_ -= v * v.transpose();
        report.remapped = true;
    }
}

/// One Gauss-Newton step. @returns false when the iterations are over.
bool ScanToMap::step(const MatchInput& input, Pose& T, MatchReport& report) {
    Mat6 AtA;
    Vec6 Atb;
    StopWatch watch;
    const int used = linearise(input, T, AtA, Atb);
    if (adapter_.reads_surfaces()) learn_kernel();
    report.search_ms += watch.lap();
    if (used < options_.min_rows) {
        report.status = MatchStatus::kFewRows;
        return false;
    }
    if (report.iterations == 0) find_remapping(AtA, report);
    report.information = AtA;
    ++report.iterations;
    const RowView rows = adapter_.counts_rows() ? view_rows() : RowView{};
    adapter_.condition_tangent({T.R.data(), T.t.data()}, options_.variance,
                               {AtA.data(), Atb.data(), adapter_.counts_rows() ? &rows : nullptr});
    if (prior_ != nullptr) limit(AtA, Atb);
    report.limited = AtA;
    if (prior_ != nullptr) add_prior(T, AtA, Atb);
    report.degenerate = adapter_.degenerate() || report.remapped;
    const Vec6 whole = AtA.ldlt().solve(Atb);
    const Vec6 d = adapter_.step_factor(whole.data(), AtA.data()) * keep_ * whole;
    const Pose next{renormalise_so3(T.R * exp_so3(d.head<3>())), T.t + d.tail<3>()};
    if (!next.R.allFinite() || !next.t.allFinite()) {
        report.status = MatchStatus::kNumericalFailure;
        return false;
    }
    T = next;
    report.status = MatchStatus::kOk;
    report.converged = d.head<3>().norm() * kDegree < options_.rotation_epsilon &&
                       d.tail<3>().norm() * kCentimetre < options_.translation_epsilon;
    return !report.converged;
}

MatchReport ScanToMap::align(const MatchInput& input, Pose& T_map_imu, const Mat6* prior) {
    MatchReport report;
    prior_ = prior;
    guess_ = T_map_imu;
    sensor_ = T_map_imu.t.cast<float>();
    bounded_search_ = !adapter_.rejects();
    memory_.assign(input.corners.size() + input.surfaces.size(),
                   {Eigen::Vector3f::Zero(), kInfinity});
    Pose T = T_map_imu;
    while (report.iterations < options_.max_iterations && step(input, T, report)) {
    }
    if (report.status != MatchStatus::kNumericalFailure) T_map_imu = T;
    if (adapter_.reads_surfaces()) {
        report.mean_square = mean_square();
        learn_bends();
        kernel_scale_ = std::min(kernel_scale_, options_.kernel_scale);
    }
    return report;
}

}  // namespace d2lio::liosam
