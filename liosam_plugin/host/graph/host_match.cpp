// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/LU>
#include <algorithm>

#include "correction.hpp"
#include "d2lio/geometry/so3.hpp"
#include "host_impl.hpp"

/// The estimate of one scan: match, correction of the inertial state, map.
namespace d2lio::liosam {
namespace {

constexpr double kLeastLoopVariance = 1e-6;  ///< rad^2 and m^2

}  // namespace

/// Scan-to-map estimate of the pose; the prediction where that cannot be had.
Pose Host::Impl::match(ScanResult& r) {
    map_.refresh(r.stamp);
    r.times.map = watch_.lap();
    const Pose predicted = predictor_.state().T_map_imu();
    const Mat6 P = predictor_.covariance();
    adapter_.begin_scan({{previous_.R.data(), previous_.t.data()},
                         {predicted.R.data(), predicted.t.data()},
                         P.data(),
                         cloud_.corners.size(),
                         cloud_.surfaces.size()});
    judged_ = true;
    Pose estimate = predicted;
    report_ = MatchReport{};
    const bool enough = enough_features();
    if (enough) {
        const Mat6 W = filters() ? Mat6(P.inverse()) : Mat6::Zero();
        report_ = matcher_.align({cloud_.corners, cloud_.surfaces, map_.corners(), map_.surfaces()},
                                 estimate, filters() ? &W : nullptr);
    }
    if (matched()) {
        if (const std::optional<Mat3> world = predictor_.orientation()) {
            estimate.R = blend_tilt(estimate.R, *world, config_.rpy_weight);
        }
        covariance_ = pose_covariance(P, report_.limited, config_.matching.variance);
        matched_covariance_ = covariance_;
    } else {
        estimate = predicted;
        covariance_ = filters() ? P : Mat6(matched_covariance_ + P);
    }
    adapter_.end_scan({estimate.R.data(), estimate.t.data()}, report_.converged);
    r.diagnostics = adapter_.diagnostics();
    r.diagnostics.iterations = report_.iterations;
    judge(report_, r);
    if (!enough) r.status = ScanStatus::kTooFewPoints;
    r.times.search = report_.search_ms;
    r.times.update = watch_.lap() - report_.search_ms;
    return estimate;
}

void Host::Impl::judge(const MatchReport& report, ScanResult& r) {
    failures_ = report.status == MatchStatus::kNumericalFailure ? failures_ + 1 : 0;
    switch (report.status) {
        case MatchStatus::kOk:
            r.status = ScanStatus::kOk;
            health_ = report.degenerate ? Health::kDegenerate : Health::kOk;
            degenerate_ += report.degenerate ? 1 : 0;
            return;
        case MatchStatus::kFewRows:
            r.status = ScanStatus::kNoCorrespondence;
            break;
        case MatchStatus::kNumericalFailure:
            r.status = ScanStatus::kNumericalFailure;
            break;
    }
    ++lost_;
    health_ = Health::kLost;
}

/// Hands the estimate to the inertial graph and takes back what it knows of velocity and biases.
void Host::Impl::correct(const Pose& estimate, ScanResult& r) {
    CorrectionNoise noise{config_.correction_rotation, config_.correction_translation,
                          config_.degenerate_rotation, config_.degenerate_translation};
    const bool own_remedy = !adapter_.has_prior();
    const Mat6 C = !matched()   ? lost_covariance(noise)
                   : own_remedy ? upstream_correction(noise, report_.remapped)
                                : weak_correction(noise, r.diagnostics);
    const GraphStatus status =
        imu_graph_.correct(loop_correction_.inverse() * estimate,
                           turn_position(loop_correction_.R.transpose(), C), predictor_.steps());
    if (status != GraphStatus::kOk) {
        ++graph_events_;
        say(r, status == GraphStatus::kReset ? "speed or bias out of bounds: inertial graph reset"
                                             : "inertial graph recovered");
    }
    predictor_.correct(estimate, loop_correction_.R, imu_graph_.state(), matched());
    previous_ = estimate;
}

void Host::Impl::fuse(const Pose& estimate, ScanResult& r) {
    const bool held = predictor_.hold(estimate, matched(), r.diagnostics);
    if (!held && matched()) {
        const double variance = config_.matching.variance;
        predictor_.fuse(estimate, covariance_,
                        {report_.information / variance, report_.limited / variance,
                         report_.mean_square / variance});
    }
    previous_ = predictor_.state().T_map_imu();
    covariance_ = predictor_.covariance();
}

/// The first keyframe is the mean of the scans at rest.
void Host::Impl::collect_rest(const MeasureGroup& group, ScanResult& r) {
    const RestStart& rest = predictor_.rest();
    if (!rest.watched() && !rest.held()) {
        rest_corners_.clear();
        rest_surfaces_.clear();
        return;
    }
    rest_surfaces_.add(cloud_.surfaces);
    rest_corners_.add(cloud_.corners);
    if (!rest.held() || !rest_surfaces_.grown() || map_.size() != 1) return;
    map_.clear();
    map_.add(rest.pose(), group.end, rest_corners_.mean(config_.corner_leaf),
             rest_surfaces_.mean(config_.scan_leaf()));
    r.times.map = watch_.lap();
}

void Host::Impl::grow_map(const MeasureGroup& group, ScanResult& r) {
    if (map_.due(previous_, group.end)) {
        map_.add(previous_, group.end, cloud_.corners, cloud_.surfaces);
        keyframes_.add(previous_);
        if (filters()) predictor_.uncertainty().grow(predictor_.state(), new_share());
        close_loop(r);
    }
    r.times.map += watch_.lap();
}

/// Share of the newest keyframe among those around the body, up to the mean range of its points.
double Host::Impl::new_share() const {
    double range = 0.0;
    for (const Eigen::Vector3f& p : cloud_.surfaces) range += static_cast<double>(p.norm());
    range /= static_cast<double>(std::max<std::size_t>(cloud_.surfaces.size(), 1));
    std::size_t near = 0;
    for (std::size_t i = 0; i < map_.size(); ++i) {
        if ((map_[i].pose.t - previous_.t).norm() <= range) ++near;
    }
    return 1.0 / static_cast<double>(std::max<std::size_t>(near, 1));
}

/// Where the newest keyframe closes a loop: all keyframes move, and the estimate with the newest,
/// which is matched thereby if it was not before.
void Host::Impl::close_loop(ScanResult& r) {
    const std::optional<Loop> loop = loops_.find(map_);
    if (!loop) return;
    const double variance = std::max(loop->fitness, kLeastLoopVariance);
    const GraphStatus status = keyframes_.add_loop(loop->from, loop->to, loop->T_from_to, variance);
    if (status != GraphStatus::kOk || !keyframes_.moved()) return;
    for (std::size_t i = 0; i < map_.size(); ++i) map_.set_pose(i, keyframes_.pose(i));
    const Pose moved = keyframes_.pose(loop->to) * previous_.inverse();
    loop_correction_ = moved * loop_correction_;
    previous_ = keyframes_.pose(loop->to);
    if (filters()) {
        predictor_.move(moved);
    } else {
        predictor_.correct(previous_, loop_correction_.R, imu_graph_.state(), true);
    }
    matched_covariance_ = covariance_;
    ++loops_closed_;
    say(r, "loop closed with keyframe " + std::to_string(loop->from));
}

}  // namespace d2lio::liosam
