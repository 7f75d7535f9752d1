// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "d2lio/types.hpp"
#include "submap_options.hpp"

namespace d2lio::liosam {

/// What the selection looks at; a flat list of these is quick to scan.
struct KeyPosition {
    std::uint32_t index = 0;       ///< of the keyframe
    Stamp stamp = 0;               ///< ns
    Vec3 position = Vec3::Zero();  ///< in map, m
};

/// LIO-SAM's choice of the keyframes around the newest one: one per cell of a grid of `density`,
/// plus all of the last `recent_s` seconds, none beyond `search_radius`. It differs from upstream
/// where that is left to chance:
///  - Upstream replaces a cell's key positions by their centroid and takes the nearest keyframe of
///    all, which may belong to the next cell and so be taken twice. Here it is the nearest of the
///    same cell, and every cell has exactly one.
///  - Two keyframes are equally far from their centroid; upstream lets rounding choose. Here
///    distances count to the millimetre and the older one wins, so that what was mapped first
///    stays.
///  - A recent keyframe that also stands for its cell enters upstream's voxel filter twice, and its
///    points weigh double. Here each enters once.
class SubmapSelector {
  public:
    explicit SubmapSelector(const SubmapOptions& options) : options_(options) {}

    /// Indices of the chosen keyframes, rising, without repetition; valid until the next call.
    /// @param keys by rising index, positions finite
    /// @param centre position of the newest keyframe, m
    /// @param now of the scan to match, ns; a keyframe is recent if its stamp is within `recent_s`
    ///        to either side, so a clock that jumps back does not make all of them recent
    const std::vector<std::uint32_t>& select(const std::vector<KeyPosition>& keys,
                                             const Vec3& centre, Stamp now);

  private:
    struct Near {
        std::uint64_t cell;
        const KeyPosition* key;
    };

    void collect_near(const std::vector<KeyPosition>& keys, const Vec3& centre);
    void take_one_per_cell();
    void take_recent(const std::vector<KeyPosition>& keys, const Vec3& centre, Stamp now);
    bool in_reach(const Vec3& position, const Vec3& centre) const;

    SubmapOptions options_;
    std::vector<Near> near_;
    std::vector<std::uint32_t> chosen_;
};

}  // namespace d2lio::liosam
