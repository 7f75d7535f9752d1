// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "d2lio/ros1/source.hpp"
#include "d2lio/ros1/text.hpp"

/// What `d2lio run` derives from a source (ablation/d2lio/source_params.py), rule by rule.
namespace d2lio::ros1 {
namespace {

// Columns of LIO-SAM's range image by model; a Livox counts the points of a line in a scan.
const std::map<std::string, int> kColumns{
    {"vlp16", 1800},   {"hdl32e", 1800},  {"hdl64e", 1800},  {"os1_64", 1024},
    {"os0_64", 1024},  {"os1_128", 1024}, {"os0_128", 1024}, {"avia", 4000},
    {"horizon", 4000}, {"mid360", 5000},  {"livox", 5000},
};
constexpr int kDefaultColumns = 1800;
const std::set<std::string> kLivox{"avia", "horizon", "mid360", "livox"};
constexpr int kRingsUsed = 32;  // at most: LIO-SAM thins sensors of 64 rings and more

/// A stride that shares a factor with the ring count would remove whole rings.
int stride_for(int rings) { return rings <= 32 ? 1 : 3; }

std::string list_of(const std::vector<double>& values) {
    std::string out = "[";
    for (const double v : values) out += (out.size() > 1 ? ", " : "") + shortest(v);
    return out + "]";
}

ParamMap extrinsic(const Source& s) {
    const double* T = s.T_imu_lidar;
    return {
        {"mapping.extrinsic_T", list_of({T[3], T[7], T[11]})},
        {"mapping.extrinsic_R", list_of({T[0], T[1], T[2], T[4], T[5], T[6], T[8], T[9], T[10]})}};
}

ParamMap fastlio(const Source& s) {
    ParamMap out = extrinsic(s);
    out["preprocess.blind"] = shortest(s.min_range_m);
    out["point_filter_num"] = std::to_string(stride_for(s.rings));
    if (std::isfinite(s.max_range_m)) {
        out["preprocess.max_range"] = out["mapping.det_range"] = shortest(s.max_range_m);
    }
    return out;
}

void range_image(const Source& s, ParamMap& out) {
    const auto of_model = kColumns.find(s.model);
    const int guess = of_model == kColumns.end() ? kDefaultColumns : of_model->second;
    out["Horizon_SCAN"] = std::to_string(s.columns > 0 ? s.columns : guess);
    out["columnByOrder"] = kLivox.count(s.model) > 0 ? "true" : "false";
    if (s.rings == 0) return;
    out["N_SCAN"] = std::to_string(s.rings);
    out["downsampleRate"] = std::to_string(std::max(1, s.rings / kRingsUsed));
}

ParamMap liosam(const Source& s, const std::string& front_end) {
    ParamMap out = extrinsic(s);
    range_image(s, out);
    // A stride would tear the rings apart whose curvature the features come from.
    out["point_filter_num"] = std::to_string(front_end == "features" ? 1 : stride_for(s.rings));
    if (s.stated.count("lidar.min_range_m") > 0) out["preprocess.blind"] = shortest(s.min_range_m);
    if (s.stated.count("lidar.max_range_m") > 0 && std::isfinite(s.max_range_m)) {
        out["preprocess.max_range"] = shortest(s.max_range_m);
    }
    return out;
}

}  // namespace

ParamMap source_params(const Source& source, const std::string& host, const ParamMap& own) {
    ParamMap out;
    if (host == "fastlio") {
        out = fastlio(source);
    } else {
        const auto chosen = own.find("front_end");
        const std::string usual = host == "liosam" ? "features" : "direct";
        out = liosam(source, chosen == own.end() ? usual : chosen->second);
    }
    for (const auto& [key, value] : own) out[key] = value;
    return out;
}

}  // namespace d2lio::ros1
