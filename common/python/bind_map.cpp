// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/stl/tuple.h>

#include <limits>

#include "arrays.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"
#include "modules.hpp"

namespace d2lio::python {
namespace {

using namespace nb::literals;

Box to_box(const nb::ndarray<const float, nb::shape<3>, nb::c_contig>& lo,
           const nb::ndarray<const float, nb::shape<3>, nb::c_contig>& hi) {
    return {Eigen::Map<const Eigen::Vector3f>(lo.data()),
            Eigen::Map<const Eigen::Vector3f>(hi.data())};
}

/// (points [Q, k, 3], squared distances [Q, k]); missing neighbours are NaN and infinity.
std::tuple<Out<float>, Out<float>> knn(const IkdTree& tree, const Points& queries, int k,
                                       float max_distance) {
    const std::size_t n = queries.shape(0);
    const auto kk = static_cast<std::size_t>(std::max(1, std::min(k, Neighbours::kMax)));
    std::vector<float> xyz(n * kk * 3, std::numeric_limits<float>::quiet_NaN());
    std::vector<float> sq(n * kk, std::numeric_limits<float>::infinity());
    {
        nb::gil_scoped_release release;
        Neighbours found;
        for (std::size_t i = 0; i < n; ++i) {
            const Eigen::Vector3f q = Eigen::Map<const Eigen::Vector3f>(queries.data() + 3 * i);
            tree.knn(q, static_cast<int>(kk), max_distance * max_distance, found);
            for (int j = 0; j < found.count; ++j) {
                const std::size_t slot = i * kk + static_cast<std::size_t>(j);
                Eigen::Map<Eigen::Vector3f>{&xyz[3 * slot]} = found[j].point();
                sq[slot] = found[j].sq_dist;
            }
        }
    }
    return {to_numpy(xyz.data(), xyz.size(), {n, kk, 3}), to_numpy(sq.data(), sq.size(), {n, kk})};
}

}  // namespace

void bind_map(nb::module_& m) {
    nb::class_<IkdTree>(m, "IkdTree", "Incremental k-d tree with down-sampling on the tree.")
        .def(
            "__init__",
            [](IkdTree* self, float leaf, double delete_ratio, double balance_ratio,
               bool background) {
                IkdTreeOptions o;
                o.downsample_leaf = leaf;
                o.delete_ratio = delete_ratio;
                o.balance_ratio = balance_ratio;
                o.background_rebuild = background;
                new (self) IkdTree(o);
            },
            "downsample_leaf"_a = 0.5F, "delete_ratio"_a = 0.5, "balance_ratio"_a = 0.6,
            "background_rebuild"_a = false, "Lengths in m. Raises ConfigError out of range.")
        .def(
            "build",
            [](IkdTree& t, const Points& p) {
                const auto points = to_points(p);
                nb::gil_scoped_release release;
                return t.build(points);
            },
            "points"_a, "Replaces the content by float32 [N, 3] points, m; returns how many.")
        .def(
            "insert",
            [](IkdTree& t, const Points& p, bool downsample) {
                const auto points = to_points(p);
                InsertReport r;
                {
                    nb::gil_scoped_release release;
                    r = t.insert(points, downsample);
                }
                nb::dict out;
                out["added"] = r.added;
                out["removed"] = r.removed;
                out["not_nearer"] = r.not_nearer;
                out["non_finite"] = r.non_finite;
                return out;
            },
            "points"_a, "downsample"_a = true,
            "Adds points; with `downsample` each touched voxel keeps its most central point.")
        .def(
            "erase_box",
            [](IkdTree& t, const nb::ndarray<const float, nb::shape<3>, nb::c_contig>& lo,
               const nb::ndarray<const float, nb::shape<3>, nb::c_contig>& hi) {
                return t.erase_box(to_box(lo, hi));
            },
            "min"_a, "max"_a,
            "Removes the points of the half-open box [min, max); returns how many.")
        .def("knn", &knn, "queries"_a, "k"_a = 5,
             "max_distance"_a = std::numeric_limits<float>::infinity(),
             "k nearest of float32 [Q, 3] queries: (points [Q, k, 3], squared distances [Q, k]), "
             "ascending; missing ones are NaN and infinity.")
        .def(
            "points", [](const IkdTree& t) { return to_numpy(t.points()); }, "float32 [N, 3], m")
        .def("__len__", &IkdTree::size)
        .def_prop_ro("memory_bytes", &IkdTree::memory_bytes)
        .def_prop_ro("depth", &IkdTree::depth);

    m.def(
        "voxel_grid",
        [](const Points& p, float leaf) {
            std::vector<Eigen::Vector3f> out;
            const auto points = to_points(p);
            {
                nb::gil_scoped_release release;
                voxel_grid(points, leaf, out);
            }
            return to_numpy(out);
        },
        "points"_a, "leaf"_a, "One centroid per voxel of side `leaf` m: float32 [M, 3].");
}

}  // namespace d2lio::python
