// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/host/configure.hpp"
#include "d2lio/host/intake.hpp"
#include "d2lio/liosam/host.hpp"
#include "features.hpp"
#include "imu_graph.hpp"
#include "keyframe_map.hpp"
#include "loop_closer.hpp"
#include "projection.hpp"
#include "scan_to_map.hpp"

namespace d2lio::liosam {

enum class FrontEnd {
    kFeatures,  ///< LIO-SAM: corners and surfaces by curvature
    kDirect,    ///< voxel-down-sampled points
};
enum class Deskew {
    kRotation,  ///< LIO-SAM: turned only
    kFull,      ///< turned and moved
};

/// LIO-SAM's constants; keys without a dot are LIO-SAM's own names.
struct HostConfig {
    explicit HostConfig(Preset preset);

    IntakeConfig intake;
    FrontEnd front_end = FrontEnd::kFeatures;
    Deskew deskew = Deskew::kFull;
    ProjectionOptions projection;
    SubmapOptions submap;   ///< but for the fields that follow
    MatchOptions matching;  ///< but for what the front end decides
    ImuGraphOptions imu;
    LoopOptions loop;
    double edge_threshold = 1.0, surface_threshold = 0.1;  ///< m^2, curvature
    double odometry_leaf = 0.4;                            ///< m, voxel of a ring's surfaces
    double corner_leaf = 0.2, surface_leaf = 0.4;          ///< m, voxels of scan and submap
    int max_clouds = 1500;                                 ///< keyframe clouds kept
    double direct_leaf = 0.4;                  ///< m, voxel of the scan, front end direct
    double direct_map_leaf = 0.25;             ///< m, voxel of the submap, front end direct
    double kernel_scale = 0.1;                 ///< m, front end direct
    int min_corners = 10, min_surfaces = 100;  ///< features that matching needs
    double mapping_interval = 0.15;            ///< s
    double correction_rotation = 0.05, correction_translation = 0.1;  ///< rad, m
    double degenerate_rotation = 1.0, degenerate_translation = 1.0;   ///< rad, m
    double rpy_weight = 0.01;     ///< of a 9-axis orientation's roll and pitch
    bool use_orientation = true;  ///< where the IMU gives one
    int threads = 1;

    void bind(ParamTable& table);
    void validate() const;
    /// Voxels of surfaces with the front end that is chosen, m.
    double scan_leaf() const { return front_end == FrontEnd::kDirect ? direct_leaf : surface_leaf; }
    double map_leaf() const {
        return front_end == FrontEnd::kDirect ? direct_map_leaf : surface_leaf;
    }
    FeatureOptions feature_options() const;
    SubmapOptions submap_options() const;
    MatchOptions match_options() const;

  private:
    void bind_loop(ParamTable& table);
};

/// What the preset sets in the adapter.
ParamMap adapter_defaults(Preset preset);

}  // namespace d2lio::liosam
