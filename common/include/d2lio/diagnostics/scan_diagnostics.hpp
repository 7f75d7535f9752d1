// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

/// Trust in the pose of one scan.
enum class Health : std::uint8_t {
    kInit,        ///< no map or no gravity estimate yet
    kOk,          ///< every direction constrained
    kDegenerate,  ///< at least one weak direction
    kLost,        ///< no usable correspondence: the pose is the prediction
};
const char* to_string(Health health);

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// How many correspondences one scan offered and what became of them (last iteration).
struct CorrespondenceCounts {
    int offered = 0, accepted = 0;
    int few_neighbours = 0;  ///< fewer map points than the plane fit needs
    int far_neighbours = 0;  ///< host gate on the farthest neighbour
    int threshold = 0;       ///< the rejection strategy
    int singular_plane = 0;  ///< neighbours on a line or coincident
    int plane_fit = 0;       ///< a neighbour too far from the plane
    int residual = 0;        ///< host gate on the point-to-plane distance
};

/// The correspondences by the distance of their points from the body: bin i holds what is nearer
/// than kRangeEdges[i], the last one the rest.
constexpr std::array<double, 5> kRangeEdges{5.0, 10.0, 20.0, 40.0, 80.0};  ///< m
struct RangeCounts {
    std::array<int, kRangeEdges.size() + 1> offered{}, accepted{};
};

/// What a scan says about itself: correspondences, thresholds, spectrum, prior, correction.
struct ScanDiagnostics {
    CorrespondenceCounts counts;
    RangeCounts by_range;
    double epsilon_min = kNaN, epsilon_median = kNaN, epsilon_max = kNaN;  ///< thresholds, m
    double sigma = kNaN;                                                   ///< KISS, m
    Vec3 lambda_r = Vec3::Constant(kNaN);  ///< rotation eigenvalues, ascending, m^2
    Vec3 lambda_t = Vec3::Constant(kNaN);  ///< translation eigenvalues, ascending
    Mat3 v_r = Mat3::Constant(kNaN);       ///< columns: rotation directions, body frame
    Mat3 v_t = Mat3::Constant(kNaN);       ///< columns: translation directions, map frame
    Vec3 prior_r = Vec3::Zero();           ///< prior information along v_r, rad^-2
    Vec3 prior_t = Vec3::Zero();           ///< prior information along v_t, m^-2
    /// Of each direction's translation information, what noise alone may have given, descending;
    /// NaN but for method noise_aware.
    Vec3 noise_share = Vec3::Constant(kNaN);
    Mat3 noise_axes = Mat3::Identity();  ///< columns: the directions of noise_share, map frame
    int blind = 0;               ///< number of directions in which rows had to prove themselves
    int cleaned = 0;             ///< rows that lost a component there (last iteration)
    int weak_r = 0, weak_t = 0;  ///< number of weak directions (the first columns)
    double correction_r = kNaN, correction_t = kNaN;  ///< |posterior - prediction|, rad and m
    double correction_weak_r = kNaN, correction_weak_t = kNaN;  ///< its part along weak directions
    Vec3 correction = Vec3::Constant(kNaN);  ///< posterior - prediction, map frame, m; no column
    int iterations = 0;
    bool converged = false;

    /// Columns in a fixed order, for CSV files, messages and reports.
    std::vector<std::pair<std::string, double>> columns() const;
};

}  // namespace d2lio
