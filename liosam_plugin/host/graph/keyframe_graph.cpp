// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "keyframe_graph.hpp"

#include <gtsam/nonlinear/ISAM2.h>
#include <gtsam/nonlinear/NonlinearFactorGraph.h>
#include <gtsam/nonlinear/PriorFactor.h>
#include <gtsam/slam/BetweenFactor.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "d2lio/config/params.hpp"
#include "gtsam_conversions.hpp"

namespace d2lio::liosam {
namespace {

using gtsam::Pose3;
using gtsam::noiseModel::Diagonal;

constexpr double kMinVariance = 1e-12, kMaxVariance = 1e12;
constexpr int kMaxIterations = 10;  // after a loop; Gauss-Newton on poses needs three to five

void check(const char* key, double value) {
    if (!(value >= kMinVariance && value <= kMaxVariance)) {
        throw ConfigError(key, std::to_string(value), "[1e-12, 1e12]");
    }
}

gtsam::ISAM2Params isam_params() {
    gtsam::ISAM2Params p;
    // Only a loop moves poses: relinearisation is forced then, and an odometry factor costs no look
    // at every pose. A tenth of LIO-SAM's threshold: the composition of a chain forgets at most
    // 5e-5 of every step's length.
    p.enableRelinearization = false;
    p.relinearizeThreshold = 0.01;
    // Back-substitution to the last digit that matters, still local.
    p.optimizationParams = gtsam::ISAM2GaussNewtonParams(1e-9);
    // Information of 1e-8 (prior) has to survive beside 1e6 (odometry) along thousands of poses.
    p.factorization = gtsam::ISAM2Params::QR;
    return p;
}

/// iSAM2 whose tree is taken apart node by node: the chain's cliques own one another, and their
/// destructors would recurse through thousands of them.
class Solver {
  public:
    Solver() : isam_(isam_params()) {}
    Solver(const Solver&) = delete;
    Solver& operator=(const Solver&) = delete;
    ~Solver() {
        std::vector<gtsam::ISAM2::sharedClique> cliques;
        cliques.reserve(isam_.nodes().size());
        for (const auto& node : isam_.nodes()) cliques.push_back(node.second);
        for (const auto& clique : cliques) clique->children.clear();
    }
    gtsam::ISAM2& operator*() { return isam_; }
    gtsam::ISAM2* operator->() { return &isam_; }

  private:
    gtsam::ISAM2 isam_;
};

}  // namespace

void KeyframeGraphOptions::validate() const {
    check("keyframe_graph.odometry_rotation_variance", odometry_rotation_variance);
    check("keyframe_graph.odometry_translation_variance", odometry_translation_variance);
    check("keyframe_graph.prior_tilt_variance", prior_tilt_variance);
    check("keyframe_graph.prior_yaw_variance", prior_yaw_variance);
    check("keyframe_graph.prior_position_variance", prior_position_variance);
    if (max_keyframes < 2 || max_keyframes > 20000) {
        throw ConfigError("keyframe_graph.max_keyframes", std::to_string(max_keyframes),
                          "[2, 20000]");
    }
}

class KeyframeGraph::Impl {
  public:
    explicit Impl(const KeyframeGraphOptions& o)
        : max_active_(static_cast<std::size_t>(o.max_keyframes)) {
        gtsam::Vector6 v;
        v << o.prior_tilt_variance, o.prior_tilt_variance, o.prior_yaw_variance,
            gtsam::Vector3::Constant(o.prior_position_variance);
        prior_ = Diagonal::Variances(v);
        v << gtsam::Vector3::Constant(o.odometry_rotation_variance),
            gtsam::Vector3::Constant(o.odometry_translation_variance);
        odometry_ = Diagonal::Variances(v);
    }

    GraphStatus add(const Pose& pose) {
        if (!is_rigid(pose)) return reject();
        if (poses_.size() - base_ >= max_active_) freeze();
        poses_.push_back({renormalise_so3(pose.R), pose.t});
        try {
            append();
            return GraphStatus::kOk;
        } catch (...) {
            return recover();
        }
    }

    GraphStatus add_loop(std::size_t from, std::size_t to, const Pose& T_from_to, double variance) {
        const bool known = from < poses_.size() && to < poses_.size() && from != to;
        const bool active = from >= base_ || to >= base_;
        const bool sane = variance >= kMinVariance && variance <= kMaxVariance;
        if (!known || !active || !sane || !is_rigid(T_from_to)) return reject();
        try {
            solve_loop(from, to, loop_factors(from, to, to_gtsam(T_from_to), variance));
            refresh();
        } catch (...) {
            return recover();
        }
        ++counts_.loops;
        moved_ = true;
        return GraphStatus::kOk;
    }

    Mat6 covariance() {
        if (poses_.empty()) return Mat6::Zero();
        const gtsam::Matrix6 J = map_axes(poses_.back().R);
        const gtsam::Matrix6 P = J * marginal() * J.transpose();
        return 0.5 * (P + P.transpose());
    }

    void clear() {
        solver_.reset();
        poses_.clear();
        base_ = 0;
        moved_ = false;
    }

    std::vector<Pose> poses_;
    std::size_t base_ = 0;  // first pose in the graph
    bool moved_ = false;
    KeyframeGraphCounts counts_;

  private:
    GraphStatus reject() {
        ++counts_.rejected;
        return GraphStatus::kRejected;
    }

    std::size_t newest() const { return poses_.size() - 1; }

    /// Keeps the newest keyframe eliminated last, so that its marginal and the next factor find it
    /// in the root. Keys are indices of keyframes.
    gtsam::ISAM2UpdateParams newest_last() const {
        gtsam::ISAM2UpdateParams p;
        p.constrainedKeys = gtsam::FastMap<gtsam::Key, int>();
        p.constrainedKeys->emplace(newest(), 1);
        return p;
    }

    /// @throws std::runtime_error
    static void check_rigid(const Pose& pose) {
        if (!is_rigid(pose)) throw std::runtime_error("keyframe pose is not finite");
    }

    /// Takes the newest pose into the graph. @throws what the solver throws
    void append() {
        if (!solver_) {
            begin(prior_);
            return;
        }
        const Pose3 pose = to_gtsam(poses_.back()), last = to_gtsam(poses_[newest() - 1]);
        gtsam::NonlinearFactorGraph factors;
        factors.emplace_shared<gtsam::BetweenFactor<Pose3>>(newest() - 1, newest(),
                                                            last.between(pose), odometry_);
        gtsam::Values values;
        values.insert(newest(), pose);
        update(factors, values, newest_last());
        check_rigid(from_gtsam((*solver_)->calculateEstimate<Pose3>(newest())));
    }

    /// A new graph of the newest pose alone. @throws what the solver throws
    void begin(const gtsam::SharedNoiseModel& noise) {
        solver_ = std::make_unique<Solver>();
        base_ = newest();
        const Pose3 pose = to_gtsam(poses_.back());
        gtsam::NonlinearFactorGraph factors;
        factors.emplace_shared<gtsam::PriorFactor<Pose3>>(newest(), pose, noise);
        gtsam::Values values;
        values.insert(newest(), pose);
        update(factors, values, newest_last());
    }

    gtsam::ISAM2Result update(const gtsam::NonlinearFactorGraph& factors,
                              const gtsam::Values& values, const gtsam::ISAM2UpdateParams& params) {
        auto result = (*solver_)->update(factors, values, params);
        counts_.last_reeliminated = result.variablesReeliminated;
        return result;
    }

    /// Between the two, or, where one is frozen, a prior on the other.
    gtsam::NonlinearFactorGraph loop_factors(std::size_t from, std::size_t to,
                                             const Pose3& T_from_to, double variance) const {
        const auto noise = gtsam::noiseModel::Isotropic::Variance(6, variance);
        gtsam::NonlinearFactorGraph factors;
        if (from < base_) {
            factors.emplace_shared<gtsam::PriorFactor<Pose3>>(
                to, to_gtsam(poses_[from]) * T_from_to, noise);
        } else if (to < base_) {
            factors.emplace_shared<gtsam::PriorFactor<Pose3>>(
                from, to_gtsam(poses_[to]) * T_from_to.inverse(), noise);
        } else {
            factors.emplace_shared<gtsam::BetweenFactor<Pose3>>(from, to, T_from_to, noise);
        }
        return factors;
    }

    /// Iterates until no pose is farther than the threshold from its linearisation point.
    void solve_loop(std::size_t from, std::size_t to, const gtsam::NonlinearFactorGraph& factors) {
        gtsam::ISAM2UpdateParams params = newest_last();
        for (const std::size_t key : {from, to}) {
            if (key >= base_) params.constrainedKeys->emplace(key, 1);
        }
        params.extraReelimKeys = gtsam::FastList<gtsam::Key>{newest()};
        std::size_t reeliminated = update(factors, {}, params).variablesReeliminated;
        params.force_relinearize = true;
        for (int i = 0; i < kMaxIterations; ++i) {
            const auto result = update({}, {}, params);
            reeliminated += result.variablesReeliminated;
            if (result.variablesRelinearized == 0) break;
        }
        counts_.last_reeliminated = reeliminated;
    }

    /// Reads all poses of the graph. @throws std::runtime_error if one is not finite
    void refresh() {
        std::vector<Pose> poses;
        poses.reserve(poses_.size() - base_);
        const gtsam::Values values = (*solver_)->calculateEstimate();
        for (std::size_t i = base_; i < poses_.size(); ++i) {
            poses.push_back(from_gtsam(values.at<Pose3>(i)));
            check_rigid(poses.back());
        }
        std::copy(poses.begin(), poses.end(), poses_.begin() + static_cast<std::ptrdiff_t>(base_));
    }

    /// Covariance of the newest in its body axes; the prior's if the solver has none.
    gtsam::Matrix6 marginal() {
        if (!solver_) return prior_->covariance();
        try {
            const gtsam::Matrix6 P = (*solver_)->marginalCovariance(newest());
            const gtsam::Vector6 delta = (*solver_)->getDelta().at(newest());
            const gtsam::Matrix6 J = Pose3::ExpmapDerivative(delta);
            const gtsam::Matrix6 at_estimate = J * P * J.transpose();
            if (at_estimate.allFinite()) return at_estimate;
        } catch (...) {  // falls through
        }
        ++counts_.solver_failures;
        return prior_->covariance();
    }

    /// Starts anew from the newest pose with its marginal; all older ones stay where they are.
    void freeze() {
        ++counts_.restarts;
        const gtsam::Matrix6 P = marginal();
        try {
            begin(joint_noise(0.5 * (P + P.transpose())));
        } catch (...) {
            recover();
        }
    }

    GraphStatus recover() {
        ++counts_.solver_failures;
        try {
            begin(prior_);
        } catch (...) {  // the next keyframe starts a graph
            solver_.reset();
            base_ = newest();
        }
        return GraphStatus::kRecovered;
    }

    std::size_t max_active_;
    gtsam::SharedDiagonal prior_, odometry_;
    std::unique_ptr<Solver> solver_;
};

KeyframeGraph::KeyframeGraph(const KeyframeGraphOptions& options) {
    options.validate();
    impl_ = std::make_unique<Impl>(options);
}
KeyframeGraph::~KeyframeGraph() = default;
KeyframeGraph::KeyframeGraph(KeyframeGraph&&) noexcept = default;
KeyframeGraph& KeyframeGraph::operator=(KeyframeGraph&&) noexcept = default;

GraphStatus KeyframeGraph::add(const Pose& pose) { return impl_->add(pose); }
GraphStatus KeyframeGraph::add_loop(std::size_t from, std::size_t to, const Pose& T_from_to,
                                    double variance) {
    return impl_->add_loop(from, to, T_from_to, variance);
}
const Pose& KeyframeGraph::pose(std::size_t i) const { return impl_->poses_.at(i); }
std::size_t KeyframeGraph::size() const { return impl_->poses_.size(); }
std::size_t KeyframeGraph::first_active() const { return impl_->base_; }
bool KeyframeGraph::moved() { return std::exchange(impl_->moved_, false); }
Mat6 KeyframeGraph::covariance() const { return impl_->covariance(); }
void KeyframeGraph::clear() { impl_->clear(); }
const KeyframeGraphCounts& KeyframeGraph::counts() const { return impl_->counts_; }

}  // namespace d2lio::liosam
