// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>

#include <array>
#include <optional>
#include <variant>

#include "arrays.hpp"
#include "d2lio/config/params.hpp"
#include "d2lio/preprocess/point_times.hpp"
#include "d2lio/preprocess/pseudo_times.hpp"
#include "modules.hpp"

namespace d2lio::python {
namespace {

using namespace nb::literals;
using RawTimes = std::optional<std::variant<Array<double>, Array<std::int64_t>>>;

constexpr std::array<const char*, 5> kUnits{"auto", "s", "ms", "us", "ns"};
constexpr std::array<const char*, 4> kReferences{"auto", "start", "end", "absolute"};

/// The enumerator whose name stands at its place in `names`. @throws ConfigError
template <typename Enum, std::size_t N>
Enum named(const char* key, const std::string& name, const std::array<const char*, N>& names) {
    std::string allowed;
    for (std::size_t i = 0; i < N; ++i) {
        if (name == names[i]) return static_cast<Enum>(i);
        allowed += (i > 0 ? ", " : "") + std::string(names[i]);
    }
    throw ConfigError(key, name, allowed);
}

const char* status_name(PointTimeStatus s) {
    const char* const names[] = {"ok",
                                 "empty",
                                 "absent",
                                 "all_equal",
                                 "not_finite",
                                 "too_few",
                                 "inconsistent_span",
                                 "inconsistent_reference",
                                 "clock_mismatch"};
    return names[static_cast<std::size_t>(s)];
}

PointTimes resolve(const RawTimes& raw, Stamp stamp, const PointTimeHint& hint) {
    if (!raw) return resolve_point_times(static_cast<const double*>(nullptr), 1, stamp, hint);
    return std::visit(
        [&](const auto& a) { return resolve_point_times(a.data(), a.shape(0), stamp, hint); },
        *raw);
}

}  // namespace

void bind_preprocess(nb::module_& m) {
    m.def(
        "resolve_point_times",
        [](const RawTimes& raw, Stamp header_stamp, const std::string& unit,
           const std::string& reference, double period_s, bool synchronised, bool pseudo) {
            PointTimeHint hint{named<TimeUnit>("unit", unit, kUnits),
                               named<TimeReference>("reference", reference, kReferences), period_s,
                               synchronised, pseudo};
            validate(hint);
            const PointTimes t = resolve(raw, header_stamp, hint);
            nb::dict out;
            out["status"] = status_name(t.status);
            out["message"] = to_string(t);
            out["stamp"] = t.scan_stamp;
            out["dt_ns"] = to_numpy(t.dt_ns.data(), t.dt_ns.size(), {t.dt_ns.size()});
            out["unit"] = kUnits[static_cast<std::size_t>(t.unit)];
            out["reference"] = kReferences[static_cast<std::size_t>(t.reference)];
            out["sorted"] = !t.unsorted;
            return out;
        },
        "raw"_a.none(), "header_stamp"_a, "unit"_a = "auto", "reference"_a = "auto",
        "period_s"_a = 0.1, "synchronised"_a = false, "pseudo"_a = false,
        "Reads one scan's time field (float64 or int64 [N], None if absent): status, message, scan "
        "stamp (ns), offsets dt_ns int32 [N], unit and reference found, whether sorted.");
    m.def(
        "pseudo_times_by_azimuth",
        [](const Points& xyz, const Array<std::uint16_t>& ring, double period_s) {
            std::vector<LidarPoint> points(xyz.shape(0));
            if (ring.shape(0) != points.size()) {
                throw nb::value_error("xyz and ring differ in length");
            }
            for (std::size_t i = 0; i < points.size(); ++i) {
                points[i].x = xyz.data()[3 * i];
                points[i].y = xyz.data()[3 * i + 1];
                points[i].z = xyz.data()[3 * i + 2];
                points[i].ring = ring.data()[i];
            }
            std::vector<std::int32_t> dt;
            pseudo_times_by_azimuth(points, period_s, dt);
            return to_numpy(dt.data(), dt.size(), {dt.size()});
        },
        "xyz"_a, "ring"_a, "period_s"_a,
        "Offsets (ns, int32 [N]) of a spinning sensor's points estimated from their azimuth.");
}

}  // namespace d2lio::python
