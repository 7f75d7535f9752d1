// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <cmath>
#include <stdexcept>

#include "arrays.hpp"
#include "d2lio/host/configure.hpp"
#include "d2lio/host/intake.hpp"
#include "d2lio/host/result.hpp"
#include "errors.hpp"
#include "shared.hpp"

/// The Python side of a host, the same for every estimator.
namespace d2lio::python {

using namespace nb::literals;

/// A scan's result as the module of `Host` knows it: modules share a type domain, and a type may be
/// bound only once in it.
template <typename Host>
struct ResultOf : ScanResult {
    explicit ResultOf(ScanResult r) : ScanResult(std::move(r)) {}
};

[[noreturn]] inline void refuse_after_finish() {
    throw std::runtime_error("the host has been told that no more data will come (finish)");
}

template <typename Host>
std::size_t add_imu(Shared<Host>& shared, const Array<std::int64_t>& stamps, const Vectors& gyro,
                    const Vectors& accel, const std::optional<Quaternions>& orientation) {
    const std::size_t n = stamps.shape(0);
    if (gyro.shape(0) != n || accel.shape(0) != n || (orientation && orientation->shape(0) != n)) {
        throw nb::value_error("stamps, gyro, accel and orientation differ in length");
    }
    return shared.call([&](Host& host) {
        std::size_t count = 0;
        for (std::size_t i = 0; i < n; ++i) {
            ImuSample sample{stamps.data()[i], Eigen::Map<const Vec3>(gyro.data() + 3 * i),
                             Eigen::Map<const Vec3>(accel.data() + 3 * i)};
            if (orientation) {
                sample.orientation = Eigen::Map<const Eigen::Vector4d>(orientation->data() + 4 * i);
            }
            const PushStatus status = host.add_imu(sample);
            if (status == PushStatus::kFinished) refuse_after_finish();
            count += accepted(status) ? 1 : 0;
        }
        return count;
    });
}

inline const char* push_name(PushStatus status) {
    const char* const names[] = {"accepted",  "late_dropped", "duplicate_dropped",
                                 "bad_value", "new_epoch",    "queue_full_dropped",
                                 "finished"};
    return names[static_cast<std::size_t>(status)];
}

template <typename Host>
const char* add_scan(Shared<Host>& shared, Stamp stamp, const Points& xyz,
                     const Array<std::int32_t>& dt_ns, const std::optional<Array<float>>& intensity,
                     const std::optional<Array<std::uint16_t>>& ring) {
    const std::size_t n = xyz.shape(0);
    if (dt_ns.shape(0) != n || (intensity && intensity->shape(0) != n) ||
        (ring && ring->shape(0) != n)) {
        throw nb::value_error("xyz, dt_ns, intensity and ring differ in length");
    }
    return shared.call([&](Host& host) {
        Scan scan;
        scan.stamp = stamp;
        scan.points.resize(n);
        for (std::size_t i = 0; i < n; ++i) {
            LidarPoint& p = scan.points[i];
            const float* q = xyz.data() + 3 * i;
            p.x = q[0];
            p.y = q[1];
            p.z = q[2];
            p.dt_ns = dt_ns.data()[i];
            if (intensity) p.intensity = intensity->data()[i];
            if (ring) p.ring = ring->data()[i];
        }
        const PushStatus status = host.add_scan(std::move(scan));
        if (status == PushStatus::kFinished) refuse_after_finish();
        return push_name(status);
    });
}

inline nb::dict diagnostics(const ScanResult& r) {
    nb::dict out;
    out["stamp_ns"] = r.stamp;
    out["status"] = to_string(r.status);
    out["health"] = to_string(r.health);
    for (const auto& [name, value] : r.columns()) {
        const bool whole =
            std::abs(value) < 1e15 && value == std::floor(value) && name.rfind("time_", 0) != 0;
        if (whole) {
            out[name.c_str()] = static_cast<std::int64_t>(value);
        } else {
            out[name.c_str()] = value;
        }
    }
    out["message"] = r.message;
    return out;
}

inline Eigen::Matrix4d T_map_imu(const ScanResult& r) {
    Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
    T.topLeftCorner<3, 3>() = r.state.rot;
    T.topRightCorner<3, 1>() = r.state.pos;
    return T;
}

template <typename Host>
nb::dict counts(Shared<Host>& shared) {
    const auto c = shared.call([](Host& host) { return host.counts(); });
    nb::dict out;
    const std::pair<const char*, std::size_t> entries[] = {
        {"imu_accepted", c.sync.imu_accepted},
        {"imu_late", c.sync.imu_late},
        {"imu_duplicate", c.sync.imu_duplicate},
        {"imu_bad", c.sync.imu_bad},
        {"imu_overflow", c.sync.imu_overflow},
        {"imu_cleared", c.sync.imu_cleared},
        {"imu_gaps", c.sync.imu_gaps},
        {"scans_accepted", c.sync.scans_accepted},
        {"scans_late", c.sync.scans_late},
        {"scans_duplicate", c.sync.scans_duplicate},
        {"scans_bad", c.sync.scans_bad},
        {"scans_overflow", c.sync.scans_overflow},
        {"scans_uncovered", c.sync.scans_uncovered},
        {"scans_without_imu", c.sync.scans_without_imu},
        {"scans_cleared", c.sync.scans_cleared},
        {"lidar_gaps", c.sync.lidar_gaps},
        {"epochs", c.sync.epochs},
        {"resets", c.resets},
        {"points_offered", c.points.offered},
        {"points_not_finite", c.points.not_finite},
        {"points_zero", c.points.zero},
        {"points_bad_time", c.points.bad_time},
        {"points_too_near", c.points.too_near},
        {"points_too_far", c.points.too_far},
        {"points_kept", c.points.kept},
    };
    for (const auto& [name, value] : entries) out[name] = value;
    for (const auto& [name, value] : c.own) out[name] = value;
    return out;
}

template <typename Host>
nb::list describe() {
    nb::list out;
    for (const ParamInfo& p : Host::describe()) {
        nb::dict d;
        d["key"] = p.key;
        d["type"] = p.type;
        d["default"] = p.default_value;
        d["range"] = p.range;
        d["unit"] = p.unit;
        d["doc"] = p.doc;
        out.append(d);
    }
    return out;
}

template <typename Result>
void bind_result(nb::module_& m) {
    nb::class_<Result>(m, "ScanResult", "Pose, covariance and diagnostics of one scan.")
        .def_ro("stamp", &ScanResult::stamp, "scan end, ns")
        .def_prop_ro("status", [](const Result& r) { return to_string(r.status); })
        .def_prop_ro(
            "health", [](const Result& r) { return to_string(r.health); },
            "INIT, OK, DEGENERATE or LOST")
        .def_ro("message", &ScanResult::message, "one line where something is wrong")
        .def_ro("has_pose", &ScanResult::has_pose)
        .def_ro("new_epoch", &ScanResult::new_epoch)
        .def_prop_ro(
            "T_map_imu", [](const Result& r) { return to_numpy(T_map_imu(r)); },
            nb::rv_policy::automatic, "float64 [4, 4], m")
        .def_prop_ro(
            "velocity", [](const Result& r) { return to_numpy(r.state.vel); },
            nb::rv_policy::automatic, "float64 [3], map frame, m/s")
        .def_prop_ro(
            "gyro_bias", [](const Result& r) { return to_numpy(r.state.gyro_bias); },
            nb::rv_policy::automatic, "float64 [3], body, rad/s")
        .def_prop_ro(
            "accel_bias", [](const Result& r) { return to_numpy(r.state.accel_bias); },
            nb::rv_policy::automatic, "float64 [3], body, m/s^2")
        .def_prop_ro(
            "gravity", [](const Result& r) { return to_numpy(r.state.gravity); },
            nb::rv_policy::automatic, "float64 [3], map frame, m/s^2")
        .def_prop_ro(
            "correction", [](const Result& r) { return to_numpy(r.diagnostics.correction); },
            nb::rv_policy::automatic,
            "float64 [3], position after the match minus the predicted one, map frame, m; NaN "
            "where "
            "nothing was matched")
        .def_prop_ro(
            "covariance", [](const Result& r) { return to_numpy(r.covariance); },
            nb::rv_policy::automatic, "float64 [6, 6], x y z rx ry rz, map frame, m^2 and rad^2")
        .def_prop_ro(
            "diagnostics", [](const Result& r) { return diagnostics(r); },
            "every figure of the scan, by column");
}

/// Binds one host class, `Host` constructible from (ParamMap, int), with its results as `Result`.
template <typename Host, typename Result>
void bind_host(nb::module_& m, const char* name, const char* doc) {
    using SharedHost = Shared<Host>;
    nb::class_<SharedHost>(m, name, doc)
        .def(nb::init<const ParamMap&, int>(), "params"_a = ParamMap{}, "threads"_a = 1,
             "Raises ConfigError (key, value, allowed) for anything unusable.")
        .def_static("describe", &describe<Host>,
                    "Every parameter: key, type, default, range, unit, doc.")
        .def("add_imu", &add_imu<Host>, "stamps"_a.noconvert(), "gyro"_a, "accel"_a,
             "orientation"_a.none() = nb::none(),
             "int64 [N] ns; float64 [N, 3] rad/s; float64 [N, 3] m/s^2; float64 [N, 4] x y z w of "
             "R_world_imu, rows of zeros where there is none. Returns how many were "
             "accepted. Stamps of another type are refused, not converted.")
        .def("add_scan", &add_scan<Host>, "stamp"_a, "xyz"_a, "dt_ns"_a.noconvert(),
             "intensity"_a.none() = nb::none(), "ring"_a.none() = nb::none(),
             "stamp ns; float32 [N, 3] m, LiDAR frame; int32 [N] ns after stamp (not converted). "
             "Returns what became of it: accepted, late_dropped, ...")
        .def(
            "step",
            [](SharedHost& h) -> std::optional<Result> {
                auto r = h.call([](Host& host) { return host.step(); });
                return r ? std::make_optional<Result>(std::move(*r)) : std::nullopt;
            },
            "Processes the next complete scan; None when more data is needed.")
        .def(
            "finish", [](SharedHost& h) { h.call([](Host& host) { host.finish(); }); },
            "No more data will come.")
        .def(
            "map_points",
            [](SharedHost& h) {
                return to_numpy(h.call([](Host& host) { return host.map_points(); }));
            },
            nb::rv_policy::automatic, "float32 [N, 3], map frame, m")
        .def("counts", &counts<Host>, "What was refused or lost, by reason.")
        .def(
            "sync_message",
            [](SharedHost& h) {
                return to_string(h.call([](Host& host) { return host.sync_report(); }));
            },
            "Whether data flow, and if not, why.")
        .def_prop_ro("map_bytes", [](SharedHost& h) {
            return h.call([](Host& host) { return host.map_bytes(); });
        });
}

}  // namespace d2lio::python
