// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <variant>

#include "d2lio/config/params.hpp"
#include "d2lio/rejection/policies.hpp"

namespace d2lio {

enum class RejectionMode { kOff, kNone, kFixed, kKiss, kPointAdaptive };

struct RejectionConfig {
    RejectionMode mode = RejectionMode::kOff;
    bool keep_host_gate = false;      ///< host's distance gates on top of the strategy
    double tau = 2.0;                 ///< m, mode fixed
    double sigma_0 = 2.0;             ///< m, mode kiss
    double delta_min = 0.1;           ///< m, mode kiss
    double r_max = 100.0;             ///< m, mode kiss
    std::optional<double> epsilon_0;  ///< m, mode point_adaptive; empty: the map's voxel size
    PointAdaptiveRejection::Motion motion = PointAdaptiveRejection::Motion::kPredicted;

    /// Binds the keys `rejection.*`.
    void bind(ParamTable& table);
    /// @throws ConfigError for values that only together make no sense.
    void validate() const;
};

/// The strategy chosen by a RejectionConfig, with its state from scan to scan.
class Rejector {
  public:
    /// @param map_voxel side of the map's voxels, m, > 0; stands in for an absent epsilon_0.
    Rejector(const RejectionConfig& config, double map_voxel);

    /// `off`: only the host's own gates decide.
    bool active() const { return active_; }
    /// Whether the host's own distance gates apply.
    bool host_gates() const { return host_gates_; }
    /// Largest accepted distance (m) for a point `range` metres from the IMU.
    double threshold(double range) const;
    /// sigma of the KISS strategy (m), NaN in other modes.
    double sigma() const;

    /// @param motion T_prev_pred, predicted motion since the last scan.
    void begin_scan(const Pose& motion);
    /// @param deviation T_pred_est, deviation of the estimate from the prediction.
    void end_scan(const Pose& deviation);

  private:
    std::variant<NoRejection, FixedRejection, KissRejection, PointAdaptiveRejection> policy_;
    bool active_;
    bool host_gates_;
};

}  // namespace d2lio
