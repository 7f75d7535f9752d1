// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

#include "d2lio/host/imu_intake.hpp"
#include "d2lio/types.hpp"
#include "graph_status.hpp"

namespace d2lio::liosam {

using Mat15x15 = Eigen::Matrix<double, 15, 15>;

/// Noise, priors and bounds; the defaults are LIO-SAM's. All but reset_keys are at least 1e-9.
struct ImuGraphOptions {
    double accel_noise = 3.99e-3;       ///< m/s^2/sqrt(Hz)
    double gyro_noise = 1.56e-3;        ///< rad/s/sqrt(Hz)
    double accel_bias_walk = 6.4e-5;    ///< m/s^2/sqrt(s)
    double gyro_bias_walk = 3.5e-5;     ///< rad/s/sqrt(s)
    double integration_noise = 1e-4;    ///< m/sqrt(s)
    double gravity = 9.80511;           ///< m/s^2, along -z of the map
    double prior_pose_sigma = 1e-2;     ///< rad and m
    double prior_velocity_sigma = 1e4;  ///< m/s
    double prior_bias_sigma = 1e-3;     ///< m/s^2 and rad/s
    int reset_keys = 100;               ///< states before the graph shrinks to its last, [2, 10000]
    double max_speed = 30.0;            ///< m/s; above it the graph starts anew
    double max_bias = 1.0;              ///< m/s^2 and rad/s; likewise
    double max_step = 0.25;             ///< s; an input held for longer is no measurement
    double bridge_accel_noise = 3.0;    ///< m/s^2/sqrt(Hz); of intervals without measurement
    double bridge_gyro_noise = 1.0;     ///< rad/s/sqrt(Hz); likewise

    /// @throws ConfigError with key, value and allowed range
    void validate() const;
};

/// First index of each block of a graph state's error.
struct GraphIndex {
    static constexpr int kRot = 0, kPos = 3, kVel = 6, kGyroBias = 9, kAccelBias = 12, kSize = 15;
};

/// The latest state and the joint covariance of its error.
struct GraphState {
    Pose T_map_imu;
    Vec3 vel = Vec3::Zero();         ///< of the IMU in map, m/s
    Vec3 gyro_bias = Vec3::Zero();   ///< rad/s
    Vec3 accel_bias = Vec3::Zero();  ///< m/s^2
    /// 15x15, blocks as in GraphIndex: rotation (right, body axes), position (map axes), velocity
    /// (map axes), gyro bias, accelerometer bias (body axes).
    Mat15x15 covariance = Mat15x15::Identity();
};

/// What happened since construction.
struct GraphCounts {
    std::size_t corrections = 0;         ///< poses taken in
    std::size_t speed_resets = 0;        ///< started anew: speed beyond its bound
    std::size_t bias_resets = 0;         ///< started anew: a bias beyond its bound
    std::size_t jump_resets = 0;         ///< started anew: the pose contradicts the inertial data
    std::size_t solver_failures = 0;     ///< the solver threw
    std::size_t non_finite_results = 0;  ///< it gave NaN or Inf
    std::size_t marginalisations = 0;    ///< the graph shrank to its last state
    std::size_t bad_poses = 0;           ///< not finite or not rigid: the state was predicted only
    std::size_t bad_covariances = 0;     ///< not finite or not positive definite: repaired
    std::size_t skipped_steps = 0;       ///< dt negative or not finite
    std::size_t held_steps = 0;          ///< input not finite: the previous input was held
    std::size_t bridged_intervals = 0;   ///< no usable input: velocity taken as constant
};

/// LIO-SAM's preintegration graph (Shan et al. 2020, sec. III-B; Forster et al. 2017): one pose,
/// velocity and bias a scan, IMU and bias factors between, a pose factor from scan matching on
/// each, solved by iSAM2. Unlike upstream it shrinks onto the joint marginal of its last state and
/// tells that marginal for every scan. Not thread safe; equal inputs give equal bits.
class ImuGraph {
  public:
    /// @throws ConfigError
    explicit ImuGraph(const ImuGraphOptions& options = {});
    ~ImuGraph();
    ImuGraph(ImuGraph&&) noexcept;
    ImuGraph& operator=(ImuGraph&&) noexcept;

    /// Starts anew at this state with the prior sigmas of the options. Later resets return to the
    /// biases given here; one beyond its bound is taken as zero, LIO-SAM's start.
    /// @return kRejected if anything is not finite or the pose not rigid
    GraphStatus start(const Pose& T_map_imu, const Vec3& vel, const Vec3& gyro_bias,
                      const Vec3& accel_bias);

    /// Adds the pose measured by scan matching and the inputs since the last one, and solves. An
    /// unusable pose leaves a prediction (kRecovered); no usable inputs, a constant velocity with
    /// a grown covariance over the steps' time (over the last interval's if there is none).
    /// @param measured T_map_imu at the end of the last step
    /// @param covariance 6x6 of its error: rotation (right, body axes, rad^2), position (map, m^2)
    /// @param steps in order, covering the time since the last correction exactly; empty ones
    ///        (dt = 0) are allowed
    GraphStatus correct(const Pose& measured, const Mat6& covariance,
                        const std::vector<ImuStep>& steps);

    const GraphState& state() const;
    bool started() const;
    /// Forgets the state; counts stay.
    void clear();
    const GraphCounts& counts() const;

  private:
    class Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace d2lio::liosam
