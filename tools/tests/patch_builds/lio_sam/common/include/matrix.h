// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "standin/solve.h"

/// A matrix of floats, row by row, with the functions of OpenCV's that the hooks call.
namespace standin {

class Mat {
  public:
    Mat() = default;
    Mat(int rows, int cols)
        : rows(rows), cols(cols), data_(static_cast<std::size_t>(rows * cols), 0.F) {}

    template <class T>
    T& at(int r, int c) {
        return data_[static_cast<std::size_t>(r * cols + c)];
    }
    template <class T>
    T at(int r, int c) const {
        return data_[static_cast<std::size_t>(r * cols + c)];
    }
    void copyTo(Mat& other) const { other = *this; }
    std::vector<double> entries() const { return {data_.begin(), data_.end()}; }

    int rows = 0, cols = 0;

  private:
    std::vector<float> data_;
};

inline Mat operator*(const Mat& a, const Mat& b) {
    Mat out(a.rows, b.cols);
    for (int r = 0; r < a.rows; ++r) {
        for (int c = 0; c < b.cols; ++c) {
            double sum = 0.0;
            for (int k = 0; k < a.cols; ++k) {
                sum += static_cast<double>(a.at<float>(r, k)) * b.at<float>(k, c);
            }
            out.at<float>(r, c) = static_cast<float>(sum);
        }
    }
    return out;
}

inline Mat transposed(const Mat& a) {
    Mat out(a.cols, a.rows);
    for (int r = 0; r < a.rows; ++r) {
        for (int c = 0; c < a.cols; ++c) out.at<float>(c, r) = a.at<float>(r, c);
    }
    return out;
}

inline void solve(const Mat& A, const Mat& b, Mat& x) {
    const std::vector<double> solution = solve_dense(A.entries(), b.entries());
    x = Mat(b.rows, 1);
    for (int i = 0; i < b.rows; ++i) {
        x.at<float>(i, 0) = static_cast<float>(solution[static_cast<std::size_t>(i)]);
    }
}

}  // namespace standin
