// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "config.hpp"
#include "d2lio/host/imu_intake.hpp"
#include "d2lio/host/pose_uncertainty.hpp"
#include "d2lio/host/rest_start.hpp"
#include "imu_graph.hpp"

namespace d2lio::liosam {

/// What the rows of one scan say of the pose: rotation (body), position (map); rad^-2, m^-2.
struct ScanSays {
    Mat6 information = Mat6::Zero();
    Mat6 limited = Mat6::Zero();  ///< as it was used; see ScanError
    double misfit = 1.0;          ///< see PoseUncertainty::Match
};

/// Forward propagation from the last corrected state to the end of a scan: the initial guess, its
/// covariance relative to the last matched estimate, and the motion for de-skewing.
class Predictor {
  public:
    explicit Predictor(const HostConfig& config);

    bool initialised() const { return initialised_; }
    /// Averages one group's samples; once there are enough, sets the state to start from: at rest,
    /// gravity from the mean acceleration or from the IMU's own orientation.
    /// @returns false when no start can be made from them; averaging begins anew.
    bool initialise(const std::vector<ImuSample>& samples);
    /// Moves the state to the group's end. @param noise_scale of the process noise, >= 1.
    void advance(const MeasureGroup& group, double noise_scale);
    /// Takes over an estimate at the present time: pose of the scan matching, everything else from
    /// the graph. Starts a new horizon of inputs.
    /// @param R_map_odometry turns the graph's axes into the map's: the rotation of all loops.
    /// @param matched whether the pose was measured; if it is the prediction itself, the pose's
    /// covariance goes on growing.
    void correct(const Pose& T_map_imu, const Mat3& R_map_odometry, const GraphState& graph,
                 bool matched);

    /// Takes over an estimate that contains the prediction (method noise_aware): velocity, biases
    /// and gravity follow by what they share with the pose, as in a Kalman filter.
    /// @param covariance of the estimate, absolute in the map; rotation (body), position (map).
    void fuse(const Pose& T_map_imu, const Mat6& covariance, const ScanSays& scan);
    /// See PoseUncertainty; empty unless start_filter() was called.
    PoseUncertainty& uncertainty() { return uncertainty_; }
    const PoseUncertainty& uncertainty() const { return uncertainty_; }
    /// Turns and moves everything with a pose that a loop has moved.
    void move(const Pose& correction);
    /// Keeps the covariance of the start (method noise_aware): the pose's grows from there on.
    /// @param rests whether the run may begin at rest.
    void start_filter(bool rests);
    void watch_rest(const std::vector<ImuSample>& samples) { rest_.watch(samples); }
    /// Where the run began at rest, and rests still, holds the pose; see RestStart.
    /// @param matched whether the estimate comes from the scan. @returns whether it is held.
    bool hold(const Pose& estimate, bool matched, const ScanDiagnostics& scan);
    const RestStart& rest() const { return rest_; }
    void end_rest() { rest_.end(); }

    const NavState& state() const { return x_; }
    /// 6x6 of the pose relative to the last matched one: rotation (right, body), position (map).
    Mat6 covariance() const;
    bool is_finite() const { return x_.is_finite() && P_.allFinite(); }
    /// Knots of the last advance() for de-skewing, offsets from the scan's begin.
    const std::vector<MotionKnot>& knots() const { return knots_; }
    /// Inputs since the last correct(), for the graph.
    const std::vector<ImuStep>& steps() const { return steps_; }
    double mean_period() const { return stepper_.mean_period(); }
    const std::string& note() const { return start_.note(); }
    /// R_world_imu of a 9-axis sensor, newest sample; nothing where there is none or it is not
    /// used.
    std::optional<Mat3> orientation() const;
    void reset();

  private:
    Mat12 noise_over(double dt, double scale) const;
    void correct_covariance(const Mat3& R_map_odometry, const GraphState& graph, bool matched);

    const HostConfig& config_;
    Pose extrinsic_;
    bool initialised_ = false;
    ImuStart start_;
    ImuStepper stepper_;
    NavState x_;
    Mat23x23 P_ = Mat23x23::Zero();
    std::vector<MotionKnot> knots_;
    std::vector<ImuStep> steps_;
    RestStart rest_;
    PoseUncertainty uncertainty_{PoseUncertainty::kMeans};
    double accel_scale_ = 1.0;  ///< readings to m/s^2
};

}  // namespace d2lio::liosam
