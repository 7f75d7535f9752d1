// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "d2lio/degeneracy/prior.hpp"
#include "d2lio/degeneracy/scan_error.hpp"
#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/plugin/plugin.hpp"
#include "d2lio/rejection/rejector.hpp"

namespace d2lio {

/// The copied pose of a view.
Pose to_pose(const PoseView& view);
inline bool is_finite(const Pose& p) { return p.R.allFinite() && p.t.allFinite(); }

/// What stands behind every adapter: configuration, policies, and the record of the current scan.
struct Plugin::Core {
    RejectionConfig rejection;
    DegeneracyConfig degeneracy;
    ParamTable table;
    std::vector<ParamInfo> docs;
    double map_voxel = 0.5;  ///< m
    std::string error;

    Rejector rejector{rejection, map_voxel};
    const Rejector host_gates{RejectionConfig{}, map_voxel};  ///< mode off
    DirectionalPrior prior{degeneracy};
    ScanDiagnostics current, last;
    std::vector<std::pair<std::string, double>> columns = last.columns();

    BlindDirections blind_before, blind_now;  ///< of the last scan and of this one
    bool in_scan = false;
    Pose predicted;                                       ///< T_map_imu
    Mat3 P_r = Mat3::Identity(), P_t = Mat3::Identity();  ///< of the prediction, rad^2, m^2

    Core();
    void rebuild();
    /// The rejector that decides on this scan's points.
    const Rejector& gates() const { return in_scan ? rejector : host_gates; }
    /// Starts a record. @param usable false: the scan runs on the host's own gates, without prior.
    Status begin(bool usable, const Pose& previous);
    /// Notes the spectrum of the accepted rows and the prior that follows from it.
    /// @param rows behind the blocks, null where the host has none to show.
    PriorTerm analyse(const Mat3& AtA_r, const Mat3& AtA_t, const RowView* rows);
    /// Directions that noise may dominate, noted in the record (method noise_aware).
    BlindDirections find_blind(const SurfaceSums& sums);
    /// Takes the finding back.
    void forget_blind();
    /// Learns from the estimate. The scan stays open for the record until publish().
    Status end(const Pose& posterior, bool converged);
    /// Makes the current record the last one.
    void publish();

  private:
    void keep_spectrum(const Spectrum& s, const PriorTerm& term);
    void keep_corrections(const Pose& posterior);
};

}  // namespace d2lio
