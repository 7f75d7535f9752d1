// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "d2lio/degeneracy/patch.hpp"

namespace d2lio {

/// Half the mean squared distance, in the surface, of points from their mean in a voxel (m^2):
/// multiplied by the bend, how far the mean lies off the surface, inside the curve.
/// @param leaf side of the voxel, m.
constexpr double mean_spread(double leaf) { return leaf * leaf / 12.0; }

/// How far a surface lies from its plane at a point, along the plane's normal (m), and how that
/// changes from there.
struct Sag {
    float here = 0.F;
    Eigen::Vector3f slope = Eigen::Vector3f::Zero();
};

/// Mean curvature of what the sensor sees, by the direction the surface faces (1/m, positive where
/// it bends towards the sensor, as the vault of a tunnel does).
///
/// A plane through points of a bent surface cuts it: the points between its supports lie beyond it.
/// In a tunnel with a flat road that pushes the pose down scan after scan, and the map with it,
/// until the pitch is wrong by milliradians. One patch of five points cannot tell a bend from
/// noise; all patches that face the same way can. What is not significant (two sigma) counts as
/// flat.
class BendField {
  public:
    /// Bend of a facing as learnt from earlier scans.
    float at(int facing) const { return bend_[static_cast<std::size_t>(facing)]; }
    bool any() const { return any_; }  ///< whether at() is not zero everywhere
    void add(const Patch& patch) { add(patch.side.facing, patch.bend_rise, patch.bend_run); }
    /// @param rise, run as in Patch.
    void add(int facing, float rise, float run) {
        const auto i = static_cast<std::size_t>(facing);
        rise_[i] += static_cast<double>(rise);
        run_[i] += static_cast<double>(run);
    }
    /// How far the surface of a patch lies from its plane at p, along the plane's normal (m).
    /// @param spread of mean_spread(), where the neighbours are means.
    float sag(const Patch& patch, const Eigen::Vector3f& normal, const Eigen::Vector3f& p,
              float spread = 0.F) const {
        const float bend = at(patch.side.facing);
        return bend == 0.F ? 0.F : patch.side.sign * bend * (patch.sag(normal, p) - spread);
    }
    /// Closes a scan: older ones fade with a time constant of ten scans.
    void end_scan();
    void reset() { *this = BendField(); }

  private:
    std::array<double, kFacings> rise_{}, run_{};
    std::array<float, kFacings> bend_{};
    bool any_ = false;
};

}  // namespace d2lio
