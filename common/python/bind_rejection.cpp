// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/stl/string.h>

#include <cmath>

#include "arrays.hpp"
#include "d2lio/rejection/rejector.hpp"
#include "modules.hpp"
#include "params_from_dict.hpp"

namespace d2lio::python {
namespace {

using namespace nb::literals;

void positive(const char* key, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) {
        throw ConfigError(key, std::to_string(value), "a finite number > 0");
    }
}

Rejector make_rejector(const std::map<std::string, std::string>& params, double map_voxel) {
    positive("map_voxel", map_voxel);
    const auto config = configured<RejectionConfig>(params);
    config.validate();
    return {config, map_voxel};
}

}  // namespace

void bind_rejection(nb::module_& m) {
    nb::class_<KissRejection>(m, "KissThreshold",
                              "sigma of KISS-ICP (Vizzo et al. 2023, eq. 7-9), m.")
        .def(
            "__init__",
            [](KissRejection* self, double sigma_0, double delta_min, double r_max) {
                positive("sigma_0", sigma_0);
                positive("r_max", r_max);
                if (!(delta_min >= 0.0)) {
                    throw ConfigError("delta_min", std::to_string(delta_min), ">= 0");
                }
                new (self) KissRejection{sigma_0, delta_min, r_max};
            },
            "sigma_0"_a = 2.0, "delta_min"_a = 0.1, "r_max"_a = 100.0)
        .def(
            "update",
            [](KissRejection& k, const Matrix4& T) { k.end_scan(MotionMagnitude::of(to_pose(T))); },
            "deviation"_a,
            "Takes one scan's deviation of the estimate from the prediction, [4, 4].")
        .def_prop_ro("sigma", &KissRejection::sigma);

    nb::class_<Rejector>(m, "Rejector", "A rejection strategy with its state from scan to scan.")
        .def(
            "__init__",
            [](Rejector* self, const std::map<std::string, std::string>& params, double voxel) {
                new (self) Rejector(make_rejector(params, voxel));
            },
            "params"_a, "map_voxel"_a = 0.5,
            "params: keys rejection.* as text. Raises ConfigError for unknown keys and bad values.")
        .def(
            "begin_scan", [](Rejector& r, const Matrix4& T) { r.begin_scan(to_pose(T)); },
            "motion"_a, "Predicted motion since the last scan, T_prev_pred [4, 4].")
        .def(
            "end_scan", [](Rejector& r, const Matrix4& T) { r.end_scan(to_pose(T)); },
            "deviation"_a, "Deviation of the estimate from the prediction, T_pred_est [4, 4].")
        .def(
            "threshold",
            [](const Rejector& r, const Array<double>& ranges) {
                Eigen::VectorXd out(static_cast<Eigen::Index>(ranges.shape(0)));
                for (Eigen::Index i = 0; i < out.size(); ++i)
                    out[i] = r.threshold(ranges.data()[i]);
                return to_numpy(out);
            },
            "ranges"_a, "Largest accepted distance (m) for points at float64 [N] ranges (m).")
        .def_prop_ro("sigma", &Rejector::sigma)
        .def_prop_ro("active", &Rejector::active);
}

}  // namespace d2lio::python
