// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "d2lio/map/ikd_tree.hpp"

namespace d2lio::fastlio {

/// The five nearest map points of a scan point, FAST-LIO2's number: a search's result without the
/// room it keeps for more, which would push the map out of the cache.
struct Nearest {
    static constexpr int kMost = 5;
    int count = 0;
    std::array<Neighbour, kMost> items;

    const Neighbour& operator[](int i) const { return items[static_cast<std::size_t>(i)]; }
};

}  // namespace d2lio::fastlio
