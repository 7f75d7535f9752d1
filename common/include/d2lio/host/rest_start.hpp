// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/host/imu_intake.hpp"
#include "d2lio/imu/rest.hpp"
#include "d2lio/types.hpp"

/// What a host makes of a run that begins at rest (method noise_aware).
namespace d2lio {

/// Whether a run begins at rest, and what that teaches.
///
/// Nothing is believed for a second: the estimator runs as if the body moved. If by then neither
/// the IMU nor the scans, where they can see, have shown motion, that second is gone through once
/// more as one of rest, and the pose is held until the first motion. Constant speed that no scan
/// can see and that does not shake the IMU cannot be told from rest.
class RestStart {
  public:
    enum class Event {
        kNothing,
        kConfirmed,     ///< it was rest: replay() gives the state
        kContradicted,  ///< a pose that was held had been left: the estimate is on its own
    };

    /// The samples of the next scan, before it is predicted.
    void watch(const std::vector<ImuSample>& samples);
    /// The map begins with this state; what is not at rest by now will not be.
    void begin(const NavState& x, const Mat23x23& P);
    /// Inputs that the state was propagated with to the next scan's end.
    void record(const std::vector<ImuStep>& steps);
    /// What a scan that was matched says.
    Event judge(const Pose& estimate, const ScanDiagnostics& scan);
    /// The state now, with everything since begin() taken as rest.
    /// @param accel_scale readings to m/s^2. @param exact of propagate().
    void replay(double accel_scale, bool exact, NavState& x, Mat23x23& P);
    /// No rest, or none any more.
    void end() { phase_ = Phase::kOver; }

    bool watched() const { return phase_ == Phase::kWatched; }
    /// Confirmed, and not ended yet.
    bool held() const { return phase_ == Phase::kHeld; }
    const Pose& pose() const { return pose_; }  ///< T_map_imu of begin()
    /// Noise to expect in motion, once a rest was confirmed.
    std::optional<ProcessNoise> noise(double accel_scale) const;
    void reset() { *this = RestStart(); }

  private:
    enum class Phase { kAwaited, kWatched, kHeld, kOver };
    /// By 5 cm or 10 mrad, in a direction that the scan can see.
    bool left(const Pose& estimate, const ScanDiagnostics& scan) const;

    RestDetector detector_;
    Phase phase_ = Phase::kAwaited;
    bool confirmed_ = false;
    Pose pose_;
    NavState x_;
    Mat23x23 P_ = Mat23x23::Zero();
    std::vector<std::vector<ImuStep>> steps_;  ///< scan by scan, until confirmed
    double watched_ = 0.0;                     ///< s
};

/// Pose and velocity after a contradiction: what was held is no longer certain.
void reopen(Mat23x23& P);

/// Mean of the scans at rest, voxel by voxel. All later poses rest on the map of that place, and
/// the noise of a single scan tilts it by a milliradian.
class RestCloud {
  public:
    /// Nothing happens once 50 scans are in.
    void add(const std::vector<Eigen::Vector3f>& points);
    /// Whether the mean has become another since the last one that was taken: a quarter more scans.
    bool grown() const { return 4 * scans_ >= 5 * taken_ && scans_ > taken_; }
    std::vector<Eigen::Vector3f> mean(double leaf);  ///< @param leaf voxel, m
    void clear() { *this = RestCloud(); }            ///< frees the points

  private:
    std::vector<Eigen::Vector3f> points_;
    int scans_ = 0, taken_ = 0;
};

}  // namespace d2lio
