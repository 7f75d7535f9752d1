// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/liosam/host.hpp"
#include "drive.hpp"

namespace d2lio::test {

/// LIO-SAM's indoor voxel sizes; the synthetic room has few points.
inline ParamMap indoor(ParamMap extra = {}) {
    ParamMap params = room_params({{"mappingCornerLeafSize", "0.1"},
                                   {"mappingSurfLeafSize", "0.2"},
                                   {"odometrySurfLeafSize", "0.2"},
                                   {"direct.leaf", "0.2"},
                                   {"direct.map_leaf", "0.2"},
                                   {"Horizon_SCAN", "180"},
                                   {"edgeFeatureMinValidNum", "4"}});
    for (auto& [key, value] : extra) params[key] = value;
    return params;
}

inline std::vector<ScanResult> run(liosam::Preset preset, const ParamMap& extra = {},
                                   int threads = 1, const Drive& drive = {}) {
    return run_host(liosam::Host(preset, indoor(extra), threads), drive);
}

}  // namespace d2lio::test
