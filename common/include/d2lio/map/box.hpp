// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace d2lio {

/// Axis-aligned box in the map frame, m. Half-open: it contains p where min <= p < max on every
/// axis, so boxes that share a face never share a point. Empty where max <= min on any axis.
struct Box {
    Eigen::Vector3f min = Eigen::Vector3f::Zero();
    Eigen::Vector3f max = Eigen::Vector3f::Zero();

    bool contains(const Eigen::Vector3f& p) const {
        return (p.array() >= min.array()).all() && (p.array() < max.array()).all();
    }
};

}  // namespace d2lio
