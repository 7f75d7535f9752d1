// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "d2lio/degeneracy/bend.hpp"
#include "d2lio/degeneracy/clean_rows.hpp"
#include "d2lio/host/point_loop.hpp"
#include "d2lio/liosam/adapter.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "d2lio/types.hpp"

namespace d2lio::liosam {

struct MatchOptions {
    int max_iterations = 30;
    double rotation_epsilon = 0.05;     ///< deg, a smaller step ends the iterations
    double translation_epsilon = 0.05;  ///< cm, likewise
    int min_rows = 50;                  ///< accepted features that a step needs
    double eigenvalue_threshold =
        100.0;               ///< of A^T A, for the host's own solution remapping; 0: off
    double variance = 1e-3;  ///< m^2, of a row of unit weight
    /// Scale of the Cauchy kernel, m. 0: LIO-SAM's weight, which falls with the distance and rises
    /// with the square root of the range.
    double kernel_scale = 0.0;
    /// Of PlaneFitOptions; 0: neighbours on a line have a plane too, as in LIO-SAM.
    double min_spread_ratio = 0.0;
    double map_leaf = 0.0;  ///< m, voxel whose means the map of surfaces holds; 0: single points
};

enum class MatchStatus {
    kOk,
    kFewRows,  ///< fewer accepted features than a step needs: the pose stays as it was then
    kNumericalFailure,  ///< a step was not finite: the pose is the initial guess
};

struct MatchReport {
    MatchStatus status = MatchStatus::kFewRows;
    int iterations = 0;
    bool converged = false;
    bool degenerate = false;  ///< some direction is weak, judged on the scan's own rows
    bool remapped = false;    ///< the host's own remapping held back some direction
    Mat6 information =
        Mat6::Zero();             ///< A^T A of the scan's rows at the last iterate; tangent order
    Mat6 limited = Mat6::Zero();  ///< the same as the estimate took it; see ScanError
    double mean_square = 0.0;     ///< of the rows' residuals at the last iterate, m^2 (noise_aware)
    double search_ms = 0.0;
};

/// One scan's features in the body frame and the maps they are matched with (map frame).
struct MatchInput {
    const std::vector<Eigen::Vector3f>& corners;
    const std::vector<Eigen::Vector3f>& surfaces;
    const IkdTree& corner_map;
    const IkdTree& surface_map;
};

/// LIO-SAM's scan-to-map Gauss-Newton: point-to-line for corners, point-to-plane for surfaces, with
/// the adapter deciding on every correspondence and conditioning the normal equations. The step is
/// taken in the right tangent of the rotation and in map axes, so that no pitch is singular.
class ScanToMap {
  public:
    ScanToMap(Adapter& adapter, const MatchOptions& options, int threads);

    /// @param T_map_imu the initial guess, replaced by the estimate. Call between the adapter's
    /// begin_scan and end_scan.
    /// @param prior information of the guess (rotation in the body's right tangent, position in the
    /// map), which the estimate then contains; null: the scan alone decides.
    MatchReport align(const MatchInput& input, Pose& T_map_imu, const Mat6* prior = nullptr);
    /// At rest the rows are only looked at (method noise_aware): also while rest is watched for,
    /// when the noise that holds a blind direction does no harm and its absence would.
    void set_resting(bool resting) { resting_ = resting; }
    void reset() {
        bends_.reset();
        kernel_scale_ = options_.kernel_scale;
    }

  private:
    struct Row {
        Vec6 jacobian;  ///< rotation (right tangent), translation (map)
        double residual;
        bool used;
        double weight = 1.0;     ///< contained in both
        bool has_patch = false;  ///< a plane's row; lines have none
        Vec3 p = Vec3::Zero();   ///< the point, body frame, m

        Vec3 normal() const { return jacobian.tail<3>() / weight; }  ///< map frame
    };
    /// The last search of a feature: the next one need look no farther than its neighbours are now.
    struct Memory {
        Eigen::Vector3f query;
        float reach;  ///< distance of the 5th neighbour, m; infinity before the first search
    };
    struct Match {
        Eigen::Vector3f normal;
        double distance;
        Patch* patch;  ///< where to put a plane's, or null
    };

    class UsedRows;

    void search(const Eigen::Vector3f& query, const IkdTree& map, Memory& memory,
                Neighbours& near) const;
    bool admit(Feature feature, std::size_t index, double range, const Neighbours& near,
               const IkdTree& map);
    bool fit(Feature feature, std::size_t index, const Neighbours& near,
             const Eigen::Vector3f& query, Match& match);
    Row match(Feature feature, std::size_t index, const Eigen::Vector3f& p, const IkdTree& map,
              const Pose& T, Memory& memory, Patch* patch);
    int linearise(const MatchInput& input, const Pose& T, Mat6& AtA, Vec6& Atb);
    void find_remapping(const Mat6& AtA, MatchReport& report);
    bool step(const MatchInput& input, Pose& T, MatchReport& report);
    RowView view_rows();
    double mean_square() const;
    void clean(const Pose& T);
    void limit(Mat6& AtA, Vec6& Atb) const;
    void add_prior(const Pose& T, Mat6& AtA, Vec6& Atb) const;
    void learn_bends();
    void learn_kernel();

    Adapter& adapter_;
    MatchOptions options_;
    PointLoop loop_;
    double kernel_scale_;  ///< m; learnt from the last iteration, of whatever scan (noise_aware)
    std::vector<double> distances_;
    bool bounded_search_ = true;
    std::vector<Row> rows_;
    std::vector<Vec6> unweighted_;
    std::vector<Memory> memory_;
    Mat6 keep_ = Mat6::Identity();
    bool resting_ = false;
    std::vector<Patch> patches_;  ///< of the rows; only while the adapter reads surfaces
    RowCleaner cleaner_;
    float spread_;  ///< of the means in the map of surfaces, m^2
    BendField bends_;
    Eigen::Vector3f sensor_ = Eigen::Vector3f::Zero();  ///< map frame
    const Mat6* prior_ = nullptr;                       ///< of the scan being aligned
    Pose guess_;
};

}  // namespace d2lio::liosam
