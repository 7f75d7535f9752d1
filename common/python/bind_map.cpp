// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/stl/tuple.h>

#include <limits>
#include <string>

#include "arrays.hpp"
#include "d2lio/config/params.hpp"
#include "d2lio/map/ikd_tree.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"
#include "modules.hpp"
#include "shared.hpp"

namespace d2lio::python {
namespace {

using namespace nb::literals;

using Corner = nb::ndarray<const float, nb::shape<3>, nb::c_contig, nb::device::cpu>;

Box to_box(const Corner& lo, const Corner& hi) {
    return {Eigen::Map<const Eigen::Vector3f>(lo.data()),
            Eigen::Map<const Eigen::Vector3f>(hi.data())};
}

using SharedTree = Shared<IkdTree>;

void construct(SharedTree* self, float leaf, double delete_ratio, double balance_ratio,
               bool background) {
    IkdTreeOptions o;
    o.downsample_leaf = leaf;
    o.delete_ratio = delete_ratio;
    o.balance_ratio = balance_ratio;
    o.background_rebuild = background;
    new (self) SharedTree(o);
}

nb::dict insert(SharedTree& shared, const Points& p, bool downsample) {
    const auto points = to_points(p);
    const InsertReport r =
        shared.call([&](IkdTree& tree) { return tree.insert(points, downsample); });
    nb::dict out;
    out["added"] = r.added;
    out["removed"] = r.removed;
    out["not_nearer"] = r.not_nearer;
    out["non_finite"] = r.non_finite;
    return out;
}

/// (points [Q, k, 3], squared distances [Q, k]); missing neighbours are NaN and infinity.
std::tuple<Out<float>, Out<float>> knn(SharedTree& shared, const Points& queries, int k,
                                       float max_distance) {
    if (k < 1 || k > Neighbours::kMax) {
        throw ConfigError("k", std::to_string(k), "[1, " + std::to_string(Neighbours::kMax) + "]");
    }
    if (!(max_distance >= 0.F)) {
        throw ConfigError("max_distance", std::to_string(max_distance), ">= 0");
    }
    const std::size_t n = queries.shape(0), kk = static_cast<std::size_t>(k);
    std::vector<float> xyz(n * kk * 3, std::numeric_limits<float>::quiet_NaN());
    std::vector<float> sq(n * kk, std::numeric_limits<float>::infinity());
    shared.call([&](const IkdTree& tree) {
        Neighbours found;
        for (std::size_t i = 0; i < n; ++i) {
            const Eigen::Vector3f q = Eigen::Map<const Eigen::Vector3f>(queries.data() + 3 * i);
            tree.knn(q, k, max_distance * max_distance, found);
            for (int j = 0; j < found.count; ++j) {
                const std::size_t slot = i * kk + static_cast<std::size_t>(j);
                Eigen::Map<Eigen::Vector3f>{&xyz[3 * slot]} = found[j].point();
                sq[slot] = found[j].sq_dist;
            }
        }
    });
    return {to_numpy(xyz.data(), xyz.size(), {n, kk, 3}), to_numpy(sq.data(), sq.size(), {n, kk})};
}

void bind_tree(nb::module_& m) {
    nb::class_<SharedTree>(m, "IkdTree", "Incremental k-d tree with down-sampling on the tree.")
        .def("__init__", &construct, "downsample_leaf"_a = 0.5F, "delete_ratio"_a = 0.5,
             "balance_ratio"_a = 0.6, "background_rebuild"_a = false,
             "Lengths in m. Raises ConfigError out of range.")
        .def(
            "build",
            [](SharedTree& t, const Points& p) {
                const auto points = to_points(p);
                return t.call([&](IkdTree& tree) { return tree.build(points); });
            },
            "points"_a, "Replaces the content by float32 [N, 3] points, m; returns how many.")
        .def("insert", &insert, "points"_a, "downsample"_a = true,
             "Adds points; with `downsample` each touched voxel keeps its most central point.")
        .def(
            "erase_box",
            [](SharedTree& t, const Corner& lo, const Corner& hi) {
                const Box box = to_box(lo, hi);
                return t.call([&](IkdTree& tree) { return tree.erase_box(box); });
            },
            "min"_a, "max"_a,
            "Removes the points of the half-open box [min, max); returns how many.")
        .def("knn", &knn, "queries"_a, "k"_a = 5,
             "max_distance"_a = std::numeric_limits<float>::infinity(),
             "k nearest (1 to 32) of float32 [Q, 3] queries: (points [Q, k, 3], squared distances "
             "[Q, k]), ascending; missing ones are NaN and infinity.")
        .def(
            "points",
            [](SharedTree& t) {
                return to_numpy(t.call([](IkdTree& tree) { return tree.points(); }));
            },
            nb::rv_policy::automatic, "float32 [N, 3], m")
        .def("__len__",
             [](SharedTree& t) { return t.call([](IkdTree& tree) { return tree.size(); }); })
        .def_prop_ro(
            "memory_bytes",
            [](SharedTree& t) { return t.call([](IkdTree& tree) { return tree.memory_bytes(); }); })
        .def_prop_ro("depth", [](SharedTree& t) {
            return t.call([](IkdTree& tree) { return tree.depth(); });
        });
}

}  // namespace

void bind_map(nb::module_& m) {
    bind_tree(m);
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
