// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>

#include "d2lio/preprocess/point_times.hpp"

namespace d2lio {
namespace {

std::string found_text(const PointTimes& times) {
    char text[256];
    std::snprintf(text, sizeof text, "point times in %s, relative to %s, %s; %zu points without",
                  to_string(times.unit).c_str(), to_string(times.reference).c_str(),
                  times.unsorted ? "unsorted" : "in order", times.invalid);
    return text;
}

std::string span_text(const PointTimes& times) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "point times span %.9g to %.9g (as stored), which %s %s does not fit a sweep "
                  "period of %g s; set the unit or the period",
                  times.raw_min, times.raw_max, times.unit == TimeUnit::kAuto ? "in" : "taken in",
                  to_string(times.unit).c_str(), times.period_s);
    return text;
}

std::string reference_text(const PointTimes& times) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "point times span %.9g to %.9g %s, which cannot be relative to %s", times.raw_min,
                  times.raw_max, to_string(times.unit).c_str(), to_string(times.reference).c_str());
    return text;
}

std::string clock_text(const PointTimes& times) {
    char text[256];
    std::snprintf(text, sizeof text,
                  "point times start at %.9g %s but the header stamp is %.6f s: two clocks; set "
                  "the reference to absolute if the IMU runs on the points' clock",
                  times.raw_min, to_string(times.unit).c_str(),
                  static_cast<double>(times.header_stamp) * kNanosecond);
    return text;
}

}  // namespace

std::string to_string(TimeUnit unit) {
    switch (unit) {
        case TimeUnit::kAuto:
            return "auto";
        case TimeUnit::kSeconds:
            return "s";
        case TimeUnit::kMilliseconds:
            return "ms";
        case TimeUnit::kMicroseconds:
            return "us";
        case TimeUnit::kNanoseconds:
            return "ns";
    }
    return "?";
}

std::string to_string(TimeReference reference) {
    switch (reference) {
        case TimeReference::kAuto:
            return "auto";
        case TimeReference::kStart:
            return "a stamp at the scan start";
        case TimeReference::kEnd:
            return "a stamp at the scan end";
        case TimeReference::kAbsolute:
            return "the clock's epoch";
    }
    return "?";
}

std::string to_string(const PointTimes& times) {
    const char* pseudo = times.use_pseudo ? "; estimated from the azimuth" : "";
    const char* advice = times.use_pseudo ? ""
                                          : "; allow pseudo times, or declare the cloud "
                                            "synchronised if it is motion compensated";
    switch (times.status) {
        case PointTimeStatus::kOk:
            if (times.unit == TimeUnit::kAuto) return "points synchronised to the header stamp";
            return found_text(times);
        case PointTimeStatus::kEmpty:
            return "the scan holds no points";
        case PointTimeStatus::kAbsent:
            return std::string("the cloud has no point-time field") + pseudo + advice;
        case PointTimeStatus::kAllEqual:
            return std::string("all points carry the same time") + pseudo + advice;
        case PointTimeStatus::kNotFinite:
            return "no point time is a finite number";
        case PointTimeStatus::kTooFew:
            return "too few points to tell the unit of their times; set the unit";
        case PointTimeStatus::kInconsistentSpan:
            return span_text(times);
        case PointTimeStatus::kInconsistentReference:
            return reference_text(times);
        case PointTimeStatus::kClockMismatch:
            return clock_text(times);
    }
    return "?";
}

}  // namespace d2lio
