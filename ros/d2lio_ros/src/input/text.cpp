// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/text.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace d2lio::ros1 {
namespace {

constexpr int kLeastExact = 15;  // decimal digits that always survive text -> double -> text
constexpr int kMostNeeded = 17;
constexpr int kFixedFrom = -4, kFixedTo = 16;  // exponents that Python writes without one

/// d.ddd...e+xx with the fewest digits that read back.
std::string scientific(double value) {
    char text[40];
    const bool tiny = std::fpclassify(value) == FP_SUBNORMAL;  // fewer digits are exact
    for (int digits = tiny ? 1 : kLeastExact; digits <= kMostNeeded; ++digits) {
        std::snprintf(text, sizeof text, "%.*e", digits - 1, value);
        if (std::strtod(text, nullptr) == value) break;
    }
    return text;
}

}  // namespace

std::string shortest(double value) {
    if (std::isnan(value)) return "nan";
    if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
    const std::string text = scientific(value);
    const std::string sign = text[0] == '-' ? "-" : "";
    const std::size_t e = text.find('e');
    std::string digits = text.substr(sign.size(), e - sign.size());
    digits.erase(std::remove(digits.begin(), digits.end(), '.'), digits.end());
    digits.erase(digits.find_last_not_of('0') + 1);
    if (digits.empty()) return sign + "0.0";
    const int exponent = std::atoi(text.c_str() + e + 1);
    if (exponent < kFixedFrom || exponent >= kFixedTo) {
        char tail[8];
        std::snprintf(tail, sizeof tail, "e%+03d", exponent);
        return sign + digits[0] + (digits.size() > 1 ? "." + digits.substr(1) : "") + tail;
    }
    if (exponent < 0) {
        return sign + "0." + std::string(static_cast<std::size_t>(-exponent - 1), '0') + digits;
    }
    const auto whole = static_cast<std::size_t>(exponent) + 1;
    if (digits.size() <= whole)
        return sign + digits + std::string(whole - digits.size(), '0') + ".0";
    return sign + digits.substr(0, whole) + "." + digits.substr(whole);
}

std::string figure(const std::string& column, double value) {
    const bool whole =
        std::abs(value) < 1e15 && value == std::floor(value) && column.rfind("time_", 0) != 0;
    return whole ? std::to_string(static_cast<long long>(value)) : shortest(value);
}

std::string seconds_text(Stamp stamp) {
    const bool negative = stamp < 0;
    const unsigned long long size = negative ? 0ULL - static_cast<unsigned long long>(stamp)
                                             : static_cast<unsigned long long>(stamp);
    char text[40];
    std::snprintf(text, sizeof text, "%s%llu.%09llu", negative ? "-" : "", size / 1'000'000'000ULL,
                  size % 1'000'000'000ULL);
    return text;
}

std::string csv_field(const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
}

std::string json_text(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) {
        const auto code = static_cast<unsigned char>(c);
        char escaped[8];
        if (code < 0x20) {
            std::snprintf(escaped, sizeof escaped, "\\u%04x", code);
            out += escaped;
        } else {
            if (c == '"' || c == '\\') out += '\\';
            out += c;
        }
    }
    return out + "\"";
}

}  // namespace d2lio::ros1
