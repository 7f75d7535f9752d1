// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "imu_graph.hpp"

#include <gtsam/navigation/ImuFactor.h>
#include <gtsam/nonlinear/ISAM2.h>
#include <gtsam/nonlinear/NonlinearFactorGraph.h>
#include <gtsam/slam/BetweenFactor.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <memory>
#include <optional>

#include "d2lio/config/params.hpp"
#include "gtsam_conversions.hpp"
#include "imu_graph_interval.hpp"
#include "imu_graph_state.hpp"

namespace d2lio::liosam {
namespace {

using gtsam::imuBias::ConstantBias;

constexpr double kRecoveredVelocitySigma = 1.0;  // m/s, on top of what was known of the velocity
constexpr double kMinVariance = 1e-12;           // rad^2, m^2: 1 um; keeps a factor's weight sane
constexpr double kMaxVariance = 1e12;            // likewise
constexpr double kMinOption = 1e-9;              // squares have to stay well above underflow

// A residual beyond one of these and beyond kJumpSigmas is a jump (a relocalisation, a lost match)
// and no noise: the graph would take minutes to forget it.
constexpr double kJumpRotation = 0.5;  // rad
constexpr double kJumpPosition = 2.0;  // m
constexpr double kJumpSigmas = 10.0;

void check(const char* key, double value, double max) {
    if (!(value >= kMinOption && value <= max)) {
        throw ConfigError(key, std::to_string(value), "[1e-9, " + std::to_string(max) + "]");
    }
}

gtsam::ISAM2Params isam_params() {
    gtsam::ISAM2Params p;
    p.relinearizeThreshold = 0.1;
    p.relinearizeSkip = 1;
    // Variances span twenty decades (velocity prior 1e8, preintegration 1e-9): the normal equations
    // of the Cholesky variant would lose them all.
    p.factorization = gtsam::ISAM2Params::QR;
    return p;
}

bool is_jump(const Vec3& residual, const Mat3& covariance, double bound) {
    if (residual.norm() <= bound) return false;
    return residual.dot(covariance.ldlt().solve(residual)) > kJumpSigmas * kJumpSigmas;
}

bool is_within(const Vec3& v, double bound) { return v.allFinite() && v.norm() <= bound; }

/// `covariance` made symmetric with eigenvalues in [kMinVariance, kMaxVariance]; `repaired` tells
/// whether it needed that.
Mat6 sane_covariance(const Mat6& covariance, bool& repaired) {
    repaired = true;
    if (!covariance.allFinite()) return Mat6::Identity();
    Mat6 P = 0.5 * (covariance + covariance.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(P)};
    const Eigen::VectorXd& values = solver.eigenvalues();
    if (values.minCoeff() >= kMinVariance && values.maxCoeff() <= kMaxVariance) {
        repaired = false;
        return P;
    }
    const Eigen::MatrixXd& V = solver.eigenvectors();
    return V * values.cwiseMax(kMinVariance).cwiseMin(kMaxVariance).asDiagonal() * V.transpose();
}

}  // namespace

void ImuGraphOptions::validate() const {
    check("imu_graph.accel_noise", accel_noise, 1e3);
    check("imu_graph.gyro_noise", gyro_noise, 1e3);
    check("imu_graph.accel_bias_walk", accel_bias_walk, 1e3);
    check("imu_graph.gyro_bias_walk", gyro_bias_walk, 1e3);
    check("imu_graph.integration_noise", integration_noise, 1e3);
    check("imu_graph.gravity", gravity, 1e2);
    check("imu_graph.prior_pose_sigma", prior_pose_sigma, 1e6);
    check("imu_graph.prior_velocity_sigma", prior_velocity_sigma, 1e6);
    check("imu_graph.prior_bias_sigma", prior_bias_sigma, 1e3);
    check("imu_graph.max_speed", max_speed, 1e6);
    check("imu_graph.max_bias", max_bias, 1e3);
    check("imu_graph.max_step", max_step, 1e3);
    check("imu_graph.bridge_accel_noise", bridge_accel_noise, 1e3);
    check("imu_graph.bridge_gyro_noise", bridge_gyro_noise, 1e3);
    if (reset_keys < 2 || reset_keys > 10000) {
        throw ConfigError("imu_graph.reset_keys", std::to_string(reset_keys), "[2, 10000]");
    }
}

class ImuGraph::Impl {
  public:
    explicit Impl(const ImuGraphOptions& options) : options_(options), integrator_(options) {}

    GraphStatus start(const Pose& T_map_imu, const Vec3& vel, const Vec3& gyro_bias,
                      const Vec3& accel_bias) {
        if (!is_rigid(T_map_imu) || !is_within(vel, kMaxCoordinate) || !gyro_bias.allFinite() ||
            !accel_bias.allFinite()) {
            return GraphStatus::kRejected;
        }
        const auto bounded = [this](const Vec3& bias) -> Vec3 {
            return is_within(bias, options_.max_bias) ? bias : Vec3::Zero();
        };
        start_bias_ = ConstantBias(bounded(accel_bias), bounded(gyro_bias));
        integrator_.clear();
        return restart(with_prior_covariance(to_gtsam(T_map_imu), vel, start_bias_),
                       GraphStatus::kOk);
    }

    GraphStatus correct(const Pose& measured, const Mat6& covariance,
                        const std::vector<ImuStep>& steps) {
        if (!started_) return GraphStatus::kRejected;
        const Measurement m = check_measurement(measured, covariance);
        try {
            const auto interval = integrator_.integrate(estimate_, steps, counts_);
            if (index_ + 1 >= static_cast<std::size_t>(options_.reset_keys)) {
                ++counts_.marginalisations;
                begin(estimate_);
            }
            extend(interval, m);
        } catch (...) {  // indeterminate systems, missing keys: the library has many types
            ++counts_.solver_failures;
            return recover(m);
        }
        return accept(m);
    }

    void clear() {
        started_ = false;
        isam_.reset();
    }

    GraphCounts counts_;
    GraphState state_;
    bool started_ = false;

  private:
    struct Measurement {
        std::optional<gtsam::Pose3> pose;
        Mat6 covariance;
    };

    Measurement check_measurement(const Pose& measured, const Mat6& covariance) {
        bool repaired = false;
        Measurement m{std::nullopt, sane_covariance(covariance, repaired)};
        if (repaired) ++counts_.bad_covariances;
        if (!is_rigid(measured)) {
            ++counts_.bad_poses;
            return m;
        }
        m.pose = to_gtsam(measured);
        return m;
    }

    GraphEstimate with_prior_covariance(const gtsam::Pose3& pose, const Vec3& vel,
                                        const ConstantBias& bias) const {
        const auto square = [](double x) { return x * x; };
        GraphEstimate e{pose, vel, bias, Mat15x15::Zero()};
        e.covariance.diagonal() << gtsam::Vector6::Constant(square(options_.prior_pose_sigma)),
            gtsam::Vector3::Constant(square(options_.prior_velocity_sigma)),
            gtsam::Vector6::Constant(square(options_.prior_bias_sigma));
        return e;
    }

    /// A new graph with this state alone. @throws what the solver throws
    void begin(const GraphEstimate& estimate) {
        const StateKeys keys(0);
        gtsam::NonlinearFactorGraph factors;
        factors.emplace_shared<StatePrior>(keys, estimate);
        gtsam::Values values;
        values.insert(keys.pose, estimate.pose);
        values.insert(keys.vel, estimate.vel);
        values.insert(keys.bias, estimate.bias);
        isam_ = std::make_unique<gtsam::ISAM2>(isam_params());
        isam_->update(factors, values);
        index_ = 0;
        adopt(estimate);
        started_ = true;
    }

    void extend(const IntervalIntegrator::Interval& interval, const Measurement& m) {
        const gtsam::NavState predicted = interval.measurement.predict(
            gtsam::NavState(estimate_.pose, estimate_.vel), estimate_.bias);
        ++index_;
        const StateKeys keys(index_);
        gtsam::Values values;
        // The measurement is the better start where the prediction is a guess.
        values.insert(keys.pose, interval.bridged && m.pose ? *m.pose : predicted.pose());
        values.insert(keys.vel, predicted.velocity());
        values.insert(keys.bias, estimate_.bias);
        solve(factors_between(interval.measurement, m), values);
        candidate_ = read_estimate(*isam_, index_);
    }

    gtsam::NonlinearFactorGraph factors_between(const gtsam::PreintegratedImuMeasurements& interval,
                                                const Measurement& m) const {
        const StateKeys from(index_ - 1), to(index_);
        const double root_dt = std::sqrt(interval.deltaTij());
        gtsam::Vector6 walk;
        walk << gtsam::Vector3::Constant(root_dt * options_.accel_bias_walk),
            gtsam::Vector3::Constant(root_dt * options_.gyro_bias_walk);
        gtsam::NonlinearFactorGraph factors;
        factors.emplace_shared<gtsam::ImuFactor>(from.pose, from.vel, to.pose, to.vel, from.bias,
                                                 interval);
        // Not "smart": that makes an equality of a sigma below 1e-8.
        factors.emplace_shared<gtsam::BetweenFactor<ConstantBias>>(
            from.bias, to.bias, ConstantBias(), gtsam::noiseModel::Diagonal::Sigmas(walk, false));
        if (m.pose) {
            factors.emplace_shared<PoseMeasurement>(to.pose, *m.pose, m.covariance);
        }
        return factors;
    }

    void solve(const gtsam::NonlinearFactorGraph& factors, const gtsam::Values& values) {
        // Eliminated last, the latest state has its joint marginal in the root.
        const StateKeys keys(index_);
        gtsam::ISAM2UpdateParams last;
        last.constrainedKeys = gtsam::FastMap<gtsam::Key, int>();
        for (const gtsam::Key key : {keys.pose, keys.vel, keys.bias}) {
            last.constrainedKeys->emplace(key, 1);
        }
        isam_->update(factors, values, last);
        isam_->update({}, {}, last);
    }

    GraphStatus accept(const Measurement& m) {
        if (!candidate_.is_finite()) {
            ++counts_.non_finite_results;
            return recover(m);
        }
        if (std::size_t* reason = reset_reason(m)) {
            ++*reason;
            return restart(
                with_prior_covariance(m.pose.value_or(estimate_.pose), Vec3::Zero(), start_bias_),
                GraphStatus::kReset);
        }
        adopt(candidate_);
        if (!m.pose) return GraphStatus::kRecovered;
        ++counts_.corrections;
        return GraphStatus::kOk;
    }

    /// The counter of the bound that the candidate breaks, if any.
    std::size_t* reset_reason(const Measurement& m) {
        const ConstantBias& bias = candidate_.bias;
        if (candidate_.vel.norm() > options_.max_speed) return &counts_.speed_resets;
        if (!is_within(bias.gyroscope(), options_.max_bias) ||
            !is_within(bias.accelerometer(), options_.max_bias)) {
            return &counts_.bias_resets;
        }
        if (!m.pose) return nullptr;
        const Vec3 rotation =
            log_so3(m.pose->rotation().between(candidate_.pose.rotation()).matrix());
        const Vec3 position = candidate_.pose.translation() - m.pose->translation();
        const bool jump = is_jump(rotation, m.covariance.topLeftCorner<3, 3>(), kJumpRotation) ||
                          is_jump(position, m.covariance.bottomRightCorner<3, 3>(), kJumpPosition);
        return jump ? &counts_.jump_resets : nullptr;
    }

    /// Goes on from the last good state at the measured pose, with the cross terms dropped.
    GraphStatus recover(const Measurement& m) {
        GraphEstimate e =
            with_prior_covariance(m.pose.value_or(estimate_.pose), estimate_.vel, estimate_.bias);
        if (m.pose) {
            const gtsam::Matrix6 J = map_axes(m.pose->rotation().matrix()).transpose();
            e.covariance.topLeftCorner<6, 6>() = J * m.covariance * J.transpose();
        }
        e.covariance.block<3, 3>(6, 6) =
            estimate_.covariance.block<3, 3>(6, 6) +
            gtsam::I_3x3 * (kRecoveredVelocitySigma * kRecoveredVelocitySigma);
        e.covariance.block<6, 6>(9, 9) = estimate_.covariance.block<6, 6>(9, 9);
        return restart(e, GraphStatus::kRecovered);
    }

    /// begin() that falls back on the prior covariance and, should that fail too, stops.
    GraphStatus restart(const GraphEstimate& estimate, GraphStatus status) {
        try {
            begin(estimate);
        } catch (...) {
            ++counts_.solver_failures;
            try {
                begin(with_prior_covariance(estimate.pose, estimate.vel, estimate.bias));
            } catch (...) {
                clear();
                return GraphStatus::kRejected;
            }
        }
        return status;
    }

    void adopt(const GraphEstimate& estimate) {
        estimate_ = estimate;
        state_ = estimate.state();
    }

    ImuGraphOptions options_;
    IntervalIntegrator integrator_;
    std::unique_ptr<gtsam::ISAM2> isam_;
    std::size_t index_ = 0;  // of the latest state in the graph
    ConstantBias start_bias_;
    GraphEstimate estimate_, candidate_;
};

ImuGraph::ImuGraph(const ImuGraphOptions& options) {
    options.validate();
    impl_ = std::make_unique<Impl>(options);
}
ImuGraph::~ImuGraph() = default;
ImuGraph::ImuGraph(ImuGraph&&) noexcept = default;
ImuGraph& ImuGraph::operator=(ImuGraph&&) noexcept = default;

GraphStatus ImuGraph::start(const Pose& T_map_imu, const Vec3& vel, const Vec3& gyro_bias,
                            const Vec3& accel_bias) {
    return impl_->start(T_map_imu, vel, gyro_bias, accel_bias);
}
GraphStatus ImuGraph::correct(const Pose& measured, const Mat6& covariance,
                              const std::vector<ImuStep>& steps) {
    return impl_->correct(measured, covariance, steps);
}
const GraphState& ImuGraph::state() const { return impl_->state_; }
bool ImuGraph::started() const { return impl_->started_; }
void ImuGraph::clear() { impl_->clear(); }
const GraphCounts& ImuGraph::counts() const { return impl_->counts_; }

}  // namespace d2lio::liosam
