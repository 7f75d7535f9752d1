// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <Eigen/Core>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio::python {

namespace nb = nanobind;

using Points = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Quaternions = nb::ndarray<const double, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;
using Matrix3 = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;
using Matrix4 = nb::ndarray<const double, nb::shape<4, 4>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array = nb::ndarray<const T, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Out = nb::ndarray<nb::numpy, T>;

inline std::vector<Eigen::Vector3f> to_points(const Points& a) {
    std::vector<Eigen::Vector3f> out(a.shape(0));
    for (std::size_t i = 0; i < out.size(); ++i) {
        out[i] = Eigen::Map<const Eigen::Vector3f>(a.data() + 3 * i);
    }
    return out;
}

inline Mat3 to_mat3(const Matrix3& a) {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(a.data());
}

inline Pose to_pose(const Matrix4& a) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> T(a.data());
    return {T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>()};
}

/// New numpy array that owns `count` values copied from `data`.
template <typename T>
Out<T> to_numpy(const T* data, std::size_t count, std::initializer_list<std::size_t> shape) {
    T* copy = new T[count > 0 ? count : 1];
    std::copy(data, data + count, copy);
    const nb::capsule owner(copy, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return Out<T>(copy, shape, owner);
}

/// Row-major copy of a dense Eigen object, 1-D for vectors.
template <typename Derived>
Out<typename Derived::Scalar> to_numpy(const Eigen::MatrixBase<Derived>& m) {
    using T = typename Derived::Scalar;
    const auto rows = static_cast<std::size_t>(m.rows()), cols = static_cast<std::size_t>(m.cols());
    std::vector<T> flat;
    for (Eigen::Index r = 0; r < m.rows(); ++r) {
        for (Eigen::Index c = 0; c < m.cols(); ++c) flat.push_back(m(r, c));
    }
    if (cols == 1) return to_numpy(flat.data(), flat.size(), {rows});
    return to_numpy(flat.data(), flat.size(), {rows, cols});
}

inline Out<float> to_numpy(const std::vector<Eigen::Vector3f>& points) {
    static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
    const float* first = points.empty() ? nullptr : points[0].data();
    return to_numpy(first, 3 * points.size(), {points.size(), 3});
}

}  // namespace d2lio::python
