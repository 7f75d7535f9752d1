// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "config.hpp"
#include "d2lio/host/stop_watch.hpp"
#include "d2lio/liosam/host.hpp"
#include "front_end.hpp"
#include "keyframe_graph.hpp"
#include "loop_closer.hpp"
#include "predictor.hpp"
#include "scan_to_map.hpp"

namespace d2lio::liosam {

/// The estimator behind Host: host.cpp has its life cycle, host_match.cpp the estimate of a scan.
class Host::Impl {
  public:
    Impl(Preset preset, const ParamMap& params, int threads);

    std::optional<ScanResult> step();
    HostCounts counts() const;
    std::vector<Eigen::Vector3f> scan_points() const;

    ParamMap params_;
    Adapter adapter_;
    HostConfig config_;
    Intake intake_;
    Predictor predictor_;
    FeatureFrontEnd features_;
    DirectFrontEnd direct_;
    ScanToMap matcher_;
    KeyframeMap map_;
    KeyframeGraph keyframes_;
    ImuGraph imu_graph_;
    LoopCloser loops_;
    bool judged_ = false;  ///< the last scan met the adapter

  private:
    void process(MeasureGroup& group, ScanResult& r);
    bool start_up(const MeasureGroup& group, ScanResult& r);
    bool predict(const MeasureGroup& group, ScanResult& r);
    bool due(const MeasureGroup& group) const;
    void prepare(MeasureGroup& group, ScanResult& r);
    void start_map(const MeasureGroup& group, ScanResult& r);
    bool enough_features() const;
    Pose match(ScanResult& r);
    bool matched() const { return report_.status == MatchStatus::kOk; }
    void judge(const MatchReport& report, ScanResult& r);
    void correct(const Pose& estimate, ScanResult& r);
    /// Method noise_aware: pose, velocity and biases are one filter's, and the inertial graph
    /// rests.
    bool filters() const { return adapter_.reads_surfaces(); }
    void fuse(const Pose& estimate, ScanResult& r);
    void collect_rest(const MeasureGroup& group, ScanResult& r);
    void grow_map(const MeasureGroup& group, ScanResult& r);
    double new_share() const;
    void close_loop(ScanResult& r);
    void begin_epoch();
    void start_anew(const std::string& why, ScanResult& r);
    void finish(ScanResult& r) const;

    MatchCloud cloud_;
    std::vector<LidarPoint> raw_;
    RestCloud rest_corners_, rest_surfaces_;  ///< IMU frame
    Pose previous_;                           ///< last estimate, T_map_imu
    Pose loop_correction_;  ///< of all loops: T_map_odometry; the inertial graph lives in odometry
    std::optional<Stamp> last_processed_;
    MatchReport report_;
    int processed_ = 0;              ///< scans since the start
    int failures_ = 0;               ///< refused matches in a row
    Health health_ = Health::kInit;  ///< of the last scan that was not skipped
    std::size_t resets_ = 0, degenerate_ = 0, lost_ = 0, graph_events_ = 0, loops_closed_ = 0;
    Mat6 covariance_ = Mat6::Zero();  ///< of the last estimate: rotation (body), position (map)
    Mat6 matched_covariance_ = Mat6::Zero();  ///< of the last one that came from a match
    StopWatch watch_;
};

}  // namespace d2lio::liosam
