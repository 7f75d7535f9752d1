// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/preprocess/point_times.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "d2lio/config/params.hpp"

namespace d2lio {
namespace {

// A narrow field of view or a cropped cloud covers little of the period, a double sweep twice of
// it; a wrong unit is off by 1000, so the window stays narrower than that.
constexpr double kMinSpanRatio = 0.032;
constexpr double kMaxSpanRatio = 2.5;
constexpr double kMaxSpanSeconds = 2.1;         // offsets are 32-bit nanoseconds
constexpr std::size_t kFewPoints = 16;          // below this a span says nothing about the unit
constexpr double kStartSlack = 0.05;            // early returns before a start stamp, in periods
constexpr double kClockToleranceSeconds = 1.0;  // absolute values against the header stamp
constexpr double kMaxAbsoluteSeconds = 9.0e9;   // 64-bit nanoseconds
constexpr double kPlaceholderDistance = 5.0;    // spans between zero and all other values

std::int64_t nanoseconds_per(TimeUnit unit) {
    switch (unit) {
        case TimeUnit::kSeconds:
            return 1'000'000'000;
        case TimeUnit::kMilliseconds:
            return 1'000'000;
        case TimeUnit::kMicroseconds:
            return 1'000;
        default:
            return 1;
    }
}

double seconds_per(TimeUnit unit) { return static_cast<double>(nanoseconds_per(unit)) * 1e-9; }

template <typename T>
struct Extremes {
    T min = 0, max = 0;
    std::size_t usable = 0;
    bool zeros_are_gaps = false;  // zeros far from all other values: no packet, no time

    bool accepts(T value) const {
        return std::isfinite(static_cast<double>(value)) && !(zeros_are_gaps && value == T{0});
    }
    void add(T value, std::size_t times = 1) {
        min = usable == 0 ? value : std::min(min, value);
        max = usable == 0 ? value : std::max(max, value);
        usable += times;
    }
    double span() const { return static_cast<double>(max) - static_cast<double>(min); }
    double distance_from_zero() const {
        return std::max(static_cast<double>(min), -static_cast<double>(max));
    }
};

template <typename T>
Extremes<T> find_extremes(const T* raw, std::size_t count) {
    Extremes<T> found;
    std::size_t zeros = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (raw[i] == T{0}) {
            ++zeros;
        } else if (found.accepts(raw[i])) {
            found.add(raw[i]);
        }
    }
    // Two distinct values are needed: with one there is no span to compare with.
    found.zeros_are_gaps = zeros > 0 && found.span() > 0.0 &&
                           found.distance_from_zero() > kPlaceholderDistance * found.span();
    if (zeros > 0 && !found.zeros_are_gaps) found.add(T{0}, zeros);
    return found;
}

// The unit in which `span` comes nearest to the period, on a logarithmic scale.
TimeUnit nearest_unit(double span, double period_s) {
    TimeUnit best = TimeUnit::kSeconds;
    double best_error = kInf;
    for (const TimeUnit unit : {TimeUnit::kSeconds, TimeUnit::kMilliseconds,
                                TimeUnit::kMicroseconds, TimeUnit::kNanoseconds}) {
        const double error = std::abs(std::log(span * seconds_per(unit) / period_s));
        if (error < best_error) {
            best = unit;
            best_error = error;
        }
    }
    return best;
}

template <typename T>
PointTimeStatus find_unit(const Extremes<T>& found, const PointTimeHint& hint, TimeUnit& unit) {
    const bool few = found.usable < kFewPoints;
    const bool known = hint.unit != TimeUnit::kAuto;
    if (found.usable == 0) return PointTimeStatus::kNotFinite;
    if (found.span() <= 0.0 && !(few && known)) {
        return found.usable == 1 ? PointTimeStatus::kTooFew : PointTimeStatus::kAllEqual;
    }
    if (few && !known) return PointTimeStatus::kTooFew;
    unit = known ? hint.unit : nearest_unit(found.span(), hint.period_s);
    const double span_s = found.span() * seconds_per(unit);
    const double ratio = span_s / hint.period_s;
    const bool fits = ratio <= kMaxSpanRatio && (few || ratio >= kMinSpanRatio);
    const bool fine = fits && span_s <= kMaxSpanSeconds;
    return fine ? PointTimeStatus::kOk : PointTimeStatus::kInconsistentSpan;
}

PointTimeStatus check_absolute(double min_s, double max_s, Stamp header, bool trusted) {
    if (std::max(-min_s, max_s) > kMaxAbsoluteSeconds) {
        return PointTimeStatus::kInconsistentReference;
    }
    const double apart = std::abs(min_s - static_cast<double>(header) * kNanosecond);
    const bool mismatch = !trusted && header != 0 && apart > kClockToleranceSeconds;
    return mismatch ? PointTimeStatus::kClockMismatch : PointTimeStatus::kOk;
}

// Extremes in seconds, which is enough to tell the conventions apart.
PointTimeStatus find_reference(double min_s, double max_s, Stamp header, const PointTimeHint& hint,
                               TimeReference& reference) {
    const double reach = kMaxSpanRatio * hint.period_s;
    const bool relative = min_s >= -reach && max_s <= reach;
    reference = hint.reference;
    if (reference == TimeReference::kAuto) {
        const bool backwards = -min_s > max_s;
        reference = !relative   ? TimeReference::kAbsolute
                    : backwards ? TimeReference::kEnd
                                : TimeReference::kStart;
    }
    if (reference == TimeReference::kAbsolute) {
        return check_absolute(min_s, max_s, header, hint.reference == TimeReference::kAbsolute);
    }
    const bool early =
        hint.reference == TimeReference::kStart && min_s < -kStartSlack * hint.period_s;
    return relative && !early ? PointTimeStatus::kOk : PointTimeStatus::kInconsistentReference;
}

Stamp to_nanoseconds(std::int64_t value, TimeUnit unit) { return value * nanoseconds_per(unit); }

// Whole units apart from the fraction, so that absolute seconds lose nothing more.
Stamp to_nanoseconds(double value, TimeUnit unit) {
    const double whole = std::trunc(value);
    const std::int64_t scale = nanoseconds_per(unit);
    return static_cast<Stamp>(whole) * scale +
           std::llround((value - whole) * static_cast<double>(scale));
}

template <typename T>
Stamp earliest(const Extremes<T>& found, Stamp header, TimeUnit unit, TimeReference reference) {
    if (reference == TimeReference::kAbsolute) return to_nanoseconds(found.min, unit);
    // Times that count up although the stamp is the scan's end.
    const bool counts_up = reference == TimeReference::kEnd && found.min >= T{0};
    return header + (counts_up ? -to_nanoseconds(found.max - found.min, unit)
                               : to_nanoseconds(found.min, unit));
}

template <typename T>
void fill_offsets(const T* raw, std::size_t count, const Extremes<T>& found, PointTimes& times) {
    times.dt_ns.resize(count);
    std::int32_t previous = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (!found.accepts(raw[i])) {
            times.dt_ns[i] = kNoPointTime;
            ++times.invalid;
            continue;
        }
        const Stamp dt = to_nanoseconds(static_cast<T>(raw[i] - found.min), times.unit);
        times.dt_ns[i] = static_cast<std::int32_t>(dt);
        times.unsorted = times.unsorted || times.dt_ns[i] < previous;
        previous = times.dt_ns[i];
    }
}

template <typename T>
void read_field(const T* raw, std::size_t count, Stamp header, const PointTimeHint& hint,
                PointTimes& times) {
    const Extremes<T> found = find_extremes(raw, count);
    times.raw_min = static_cast<double>(found.min);
    times.raw_max = static_cast<double>(found.max);
    times.status = find_unit(found, hint, times.unit);
    if (!times.ok()) return;
    const double scale = seconds_per(times.unit);
    times.status =
        find_reference(times.raw_min * scale, times.raw_max * scale, header, hint, times.reference);
    if (!times.ok()) return;
    times.scan_stamp = earliest(found, header, times.unit, times.reference);
    fill_offsets(raw, count, found, times);
}

template <typename T>
PointTimes resolve(const T* raw, std::size_t count, Stamp header, const PointTimeHint& hint) {
    PointTimes times;
    times.scan_stamp = header;
    times.header_stamp = header;
    times.period_s = hint.period_s;
    if (count == 0) {
        times.status = PointTimeStatus::kEmpty;
    } else if (hint.synchronised) {
        times.status = PointTimeStatus::kOk;
        times.reference = TimeReference::kStart;
        times.dt_ns.assign(count, 0);
    } else if (raw != nullptr) {
        read_field(raw, count, header, hint, times);
    }
    times.use_pseudo = hint.pseudo_allowed && (times.status == PointTimeStatus::kAbsent ||
                                               times.status == PointTimeStatus::kAllEqual);
    return times;
}

}  // namespace

PointTimes resolve_point_times(const double* raw, std::size_t count, Stamp header_stamp,
                               const PointTimeHint& hint) {
    return resolve(raw, count, header_stamp, hint);
}

PointTimes resolve_point_times(const std::int64_t* raw, std::size_t count, Stamp header_stamp,
                               const PointTimeHint& hint) {
    return resolve(raw, count, header_stamp, hint);
}

PointTimeHint locked(const PointTimeHint& hint, const PointTimes& found) {
    PointTimeHint next = hint;
    if (!found.ok() || hint.synchronised) return next;
    next.unit = found.unit;
    next.reference = found.reference;
    return next;
}

void validate(const PointTimeHint& hint, const std::string& key_prefix) {
    if (!(hint.period_s > 0.0 && hint.period_s <= 2.0)) {
        throw ConfigError(key_prefix + "period_s", std::to_string(hint.period_s), "(0, 2] s");
    }
}

}  // namespace d2lio
