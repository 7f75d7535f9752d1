// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/diagnostics/scan_diagnostics.hpp"

namespace d2lio {
namespace {

using Columns = std::vector<std::pair<std::string, double>>;

void add_counts(const CorrespondenceCounts& c, Columns& out) {
    out.emplace_back("offered", c.offered);
    out.emplace_back("accepted", c.accepted);
    out.emplace_back("rejected_few_neighbours", c.few_neighbours);
    out.emplace_back("rejected_far_neighbours", c.far_neighbours);
    out.emplace_back("rejected_threshold", c.threshold);
    out.emplace_back("rejected_singular_plane", c.singular_plane);
    out.emplace_back("rejected_plane_fit", c.plane_fit);
    out.emplace_back("rejected_residual", c.residual);
}

/// offered_to_5m, accepted_to_5m, ... offered_beyond_80m, accepted_beyond_80m.
void add_ranges(const RangeCounts& c, Columns& out) {
    for (std::size_t i = 0; i < c.offered.size(); ++i) {
        const bool last = i == kRangeEdges.size();
        const int edge = static_cast<int>(last ? kRangeEdges.back() : kRangeEdges[i]);
        const std::string bin = (last ? "_beyond_" : "_to_") + std::to_string(edge) + "m";
        out.emplace_back("offered" + bin, c.offered[i]);
        out.emplace_back("accepted" + bin, c.accepted[i]);
    }
}

void add_vector(const std::string& name, const Vec3& v, Columns& out) {
    for (int i = 0; i < 3; ++i) out.emplace_back(name + "_" + std::to_string(i + 1), v[i]);
}

void add_axis(const std::string& name, const Vec3& v, Columns& out) {
    out.emplace_back(name + "_x", v.x());
    out.emplace_back(name + "_y", v.y());
    out.emplace_back(name + "_z", v.z());
}

}  // namespace

const char* to_string(Health health) {
    switch (health) {
        case Health::kInit:
            return "INIT";
        case Health::kOk:
            return "OK";
        case Health::kDegenerate:
            return "DEGENERATE";
        case Health::kLost:
            break;
    }
    return "LOST";
}

Columns ScanDiagnostics::columns() const {
    Columns out;
    add_counts(counts, out);
    out.emplace_back("epsilon_min", epsilon_min);
    out.emplace_back("epsilon_median", epsilon_median);
    out.emplace_back("epsilon_max", epsilon_max);
    out.emplace_back("sigma", sigma);
    add_vector("lambda_r", lambda_r, out);
    add_vector("lambda_t", lambda_t, out);
    add_axis("v_r_1", v_r.col(0), out);
    add_axis("v_t_1", v_t.col(0), out);
    add_axis("v_r_2", v_r.col(1), out);
    add_axis("v_t_2", v_t.col(1), out);
    add_vector("prior_r", prior_r, out);
    add_vector("prior_t", prior_t, out);
    out.emplace_back("weak_r", weak_r);
    out.emplace_back("weak_t", weak_t);
    out.emplace_back("correction_r", correction_r);
    out.emplace_back("correction_t", correction_t);
    out.emplace_back("correction_weak_r", correction_weak_r);
    out.emplace_back("correction_weak_t", correction_weak_t);
    out.emplace_back("iterations", iterations);
    out.emplace_back("converged", converged ? 1.0 : 0.0);
    add_ranges(by_range, out);
    add_vector("noise_share", noise_share, out);
    out.emplace_back("blind", blind);
    out.emplace_back("cleaned", cleaned);
    return out;
}

}  // namespace d2lio
