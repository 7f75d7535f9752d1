// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/geometry/state.hpp"
#include "d2lio/host/imu_intake.hpp"
#include "d2lio/imu/propagation.hpp"

namespace d2lio {

/// Covariance of the pose in the map that counts the map's own error (method noise_aware).
///
/// A filter that matches scans with a map takes the map for the truth and every scan's noise for
/// new: it is certain to a millimetre of a pose that has been off by centimetres since the map was
/// begun. Here the error of the filter's 23 states is followed together with the rigid error of the
/// map around the body. A match brings the first towards the second, by the gain the filter used;
/// what the scan adds to the map carries the first, and its own noise, into the second. The
/// estimate itself is not touched. This is the "consider" covariance of a Schmidt-Kalman filter
/// (S. F. Schmidt, 1966; Geneva, Maley, Huang, "An efficient Schmidt-EKF for 3D visual-inertial
/// SLAM", CVPR 2019) with the map reduced to six parameters. Where a number would not be finite it
/// ends, as by clear().
class PoseUncertainty {
  public:
    /// Variance of the map by that of a scan's row: its points have the noise of the scans they
    /// came from, and five of them are shared by many rows. A voxel that keeps one point has three
    /// times the variance of one that keeps a mean; found by the NEES of a room.
    static constexpr double kPoints = 3.0, kMeans = 1.0;
    explicit PoseUncertainty(double map_noise = kPoints) : map_noise_(map_noise) {}

    /// How a match moved the state.
    struct Match {
        /// K H: of its 23 columns the first 12, the others are zero.
        Eigen::Matrix<double, 23, 12> gain = Eigen::Matrix<double, 23, 12>::Zero();
        Mat23x23 noise = Mat23x23::Zero();  ///< K R K^T, what the rows' white noise does to it
        /// Of the scan's own rows about position and rotation, as in the state; 1/m^2, 1/rad^2.
        Mat6 information = Mat6::Zero();
        /// Mean square of the rows' residuals by the variance they were given; below 1 it counts
        /// as 1.
        double misfit = 1.0;
    };

    /// The body rests where the map begins: its pose is known to 1 mm and 0.1 mrad, the rest of the
    /// state as in P.
    void begin(const Mat23x23& P);
    /// Goes on from what the filter thinks, with a map that is taken for the truth.
    void take(const Mat23x23& P);
    /// The state moved from one to the other under these inputs.
    /// @param noise covariance of the integrated readings, sum of dt^2 Q over the steps.
    void predict(const NavState& from, const NavState& to, const std::vector<ImuStep>& steps,
                 const Mat12& noise);
    /// @param x the corrected state.
    void update(const NavState& x, const Match& match);
    /// The scan of the last update() entered the map. @param share of the map around the body that
    /// is new by it, 0 to 1.
    void grow(const NavState& x, double share);
    /// Position and rotation about the map's axes, as poses are published; m^2, m rad, rad^2.
    Mat6 covariance(const NavState& x) const;

    bool begun() const { return begun_; }
    void clear() { *this = PoseUncertainty(map_noise_); }

  private:
    /// The filter's error, then that of the map: position, rotation, both in the map frame.
    static constexpr int kMap = StateIndex::kSize, kSize = kMap + 6;
    using Joint = Eigen::Matrix<double, kSize, kSize>;

    /// C = F C F^T for the F that `rows` applies to the rows of a matrix.
    template <typename Rows>
    void transform(const Rows& rows);

    Joint C_ = Joint::Zero();
    Mat6 scan_noise_ = Mat6::Zero();  ///< of the last scan as a rigid body, map frame
    double map_noise_;
    bool begun_ = false;
    bool matched_ = false;  ///< since the map began
};

}  // namespace d2lio
