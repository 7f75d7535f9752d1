// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "d2lio/degeneracy/bend.hpp"
#include "d2lio/degeneracy/blind.hpp"
#include "d2lio/geometry/plane.hpp"

namespace d2lio {

/// Surfaces of which most are only wanted as sums, what is noise and what bends, and for their sag.
/// They are kept as they are found and looked at together, four at a time, as the vector unit likes
/// it, in a third of the time of as many patches. Calls for different rows may run at a time.
class SurfaceSample {
  public:
    /// Makes room; every row has to be set or left out.
    void resize(std::size_t rows);
    /// @param xyz, stride of Patch::kCount neighbours, see make_patch(). @param p the point that is
    /// matched with them.
    void set(std::size_t row, const float* xyz, int stride, const PlaneMoments& moments,
             const Eigen::Vector3f& normal, const SurfaceSide& side, const Eigen::Vector3f& p);
    void leave_out(std::size_t row);
    /// The patch of a row, its centroid the origin.
    void get(std::size_t row, Patch& patch) const;
    /// As of patches of all rows, to rounding. @param bends learns from them.
    /// @param sags of the rows by what `bends` knew before, padded() of them; null: not wanted.
    SurfaceSums survey(BendField& bends, Sag* sags = nullptr) const;
    static std::size_t padded(std::size_t rows) { return (rows + kWidth - 1) / kWidth * kWidth; }

  private:
    static constexpr std::size_t kWidth = 4;
    /// Of a row: normal, scatter, from the centroid the neighbours and p.
    static constexpr std::size_t kNormal = 0, kScatter = 3, kOffsets = 9, kPoint = 24, kFloats = 27;
    static std::size_t begin(std::size_t row) {
        return row / kWidth * (kWidth * kFloats) + row % kWidth;
    }

    std::vector<float> floats_;  ///< blocks of kWidth rows, in each one entry of all after another
    std::vector<SurfaceSide> sides_;
};

}  // namespace d2lio
