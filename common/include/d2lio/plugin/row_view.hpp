// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace d2lio {

/// Jacobian rows of one linearisation, for methods that look at them one by one. C++14, plain
/// pointers; entry (row, column) of a block lies at data[row * row_step + column * column_step].
struct RowView {
    struct Block {
        const double* data;
        int count;
        std::ptrdiff_t row_step, column_step;
    };
    Block rotation;     ///< p x n in the tangent of the body, m
    Block translation;  ///< n, map frame, unit length
};

}  // namespace d2lio
