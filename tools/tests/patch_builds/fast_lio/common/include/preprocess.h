// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "standin/grid_map.h"

namespace standin {

struct Point {
    float x = 0.F, y = 0.F, z = 0.F, intensity = 0.F;
};
using Points = std::vector<Point>;

struct Cloud {
    Points points;
};

}  // namespace standin
