// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "d2lio/types.hpp"

namespace d2lio {

/// Unit in which a point-time field is stored.
enum class TimeUnit { kAuto, kSeconds, kMilliseconds, kMicroseconds, kNanoseconds };

/// What a point-time field counts from.
enum class TimeReference {
    kAuto,
    kStart,    ///< the header stamp, which is the time of the first return
    kEnd,      ///< the header stamp, which is the time of the last return
    kAbsolute  ///< the epoch of the clock itself
};

enum class PointTimeStatus {
    kOk,
    kEmpty,                  ///< a scan without points
    kAbsent,                 ///< the cloud has no time field
    kAllEqual,               ///< one value for all points: motion compensated, or an unfilled field
    kNotFinite,              ///< no usable value at all
    kTooFew,                 ///< too few points to tell the unit; name it in the hint
    kInconsistentSpan,       ///< span does not fit the sweep period in the given (or any) unit
    kInconsistentReference,  ///< values contradict the given reference
    kClockMismatch           ///< absolute values far from the header stamp: two clocks
};

/// What is known about a time field beforehand. The defaults find out.
struct PointTimeHint {
    TimeUnit unit = TimeUnit::kAuto;
    TimeReference reference = TimeReference::kAuto;
    double period_s = 0.1;        ///< nominal sweep period, s, > 0
    bool synchronised = false;    ///< motion compensated to the header stamp: all offsets are 0
    bool pseudo_allowed = false;  ///< permit `pseudo_times_by_azimuth` where times are missing
};

/// Offset of a point whose time field was unusable; `PointFilter` drops such points.
constexpr std::int32_t kNoPointTime = -1;

/// Outcome of reading one scan's time field.
struct PointTimes {
    PointTimeStatus status = PointTimeStatus::kAbsent;
    TimeUnit unit = TimeUnit::kAuto;
    TimeReference reference = TimeReference::kAuto;
    Stamp scan_stamp = 0;             ///< time of the earliest point; the header stamp unless ok
    std::vector<std::int32_t> dt_ns;  ///< per point, >= 0 or kNoPointTime; empty unless ok
    bool unsorted = false;            ///< not in order of time (ring by ring, for example)
    bool use_pseudo = false;          ///< times are missing and the hint permits pseudo times
    std::size_t invalid = 0;          ///< points with kNoPointTime
    double raw_min = 0.0, raw_max = 0.0;  ///< extremes of the usable values, as stored
    double period_s = 0.0;                ///< the hint's sweep period, s
    Stamp header_stamp = 0;               ///< as given

    bool ok() const { return status == PointTimeStatus::kOk; }
};

/// Reads a floating-point time field (float32 widened, or float64).
/// @param raw values as stored, in message order, `count` of them; null if the field is absent
/// @param header_stamp the message's stamp, ns; 0 if it carries none
/// Unit and reference are found from the span and the extremes: a span nearest to the nominal
/// period decides the unit; values near the header stamp are absolute; negative values count
/// back from a stamp at the scan end. Non-finite values, and zeros far from all others, mark
/// single points as invalid. Never throws on bad data.
PointTimes resolve_point_times(const double* raw, std::size_t count, Stamp header_stamp,
                               const PointTimeHint& hint);

/// The same for integer fields, exact also for absolute nanoseconds.
PointTimes resolve_point_times(const std::int64_t* raw, std::size_t count, Stamp header_stamp,
                               const PointTimeHint& hint);

/// The hint with the unit and reference that a good scan showed, so that all scans of a run are
/// read alike and scans with few points can be read at all.
PointTimeHint locked(const PointTimeHint& hint, const PointTimes& found);

/// Checks the hint. @throws ConfigError with `key_prefix` before the field's name.
void validate(const PointTimeHint& hint, const std::string& key_prefix = "lidar.time_");

std::string to_string(TimeUnit unit);
std::string to_string(TimeReference reference);
/// One line for the user: what was found or what is wrong, and what to set.
std::string to_string(const PointTimes& times);

}  // namespace d2lio
