// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace d2lio::liosam {

/// When a scan becomes a keyframe and which keyframes make up the submap. Defaults are LIO-SAM's.
struct SubmapOptions {
    double search_radius = 50.0;       ///< of key positions around the newest, m, [1, 3000]
    double density = 2.0;              ///< cell that keeps one old keyframe, m, [0.1, 1000]
    double recent_s = 10.0;            ///< younger keyframes all count, s, >= 0
    float corner_leaf = 0.2F;          ///< voxel of the corner submap, m, [0.01, 100]
    float surface_leaf = 0.4F;         ///< voxel of the surface submap, m, [0.01, 100]
    double keyframe_distance = 1.0;    ///< motion that makes a keyframe, m, >= 0
    double keyframe_angle = 0.2;       ///< roll, pitch or yaw that makes one, rad, >= 0
    double keyframe_interval_s = 0.0;  ///< a pause that makes one, s; 0: none (LIO-SAM, Livox: 1)
    std::size_t max_clouds = 1500;     ///< keyframes whose clouds stay in memory, >= 1
};

/// @throws ConfigError with key, value and allowed range for the first option outside its range.
void validate(const SubmapOptions& options);

}  // namespace d2lio::liosam
