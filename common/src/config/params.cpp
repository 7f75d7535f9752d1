// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/config/params.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <locale>
#include <sstream>
#include <system_error>
#include <utility>

namespace d2lio {
namespace {

std::string format_number(double v) {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(12);
    out << v;
    return out.str();
}

std::string format_range(const Range& r) {
    if (r.min == -kInf && r.max == kInf) return "any finite number";
    if (r.max == kInf) return ">= " + format_number(r.min);
    if (r.min == -kInf) return "<= " + format_number(r.max);
    return "[" + format_number(r.min) + ", " + format_number(r.max) + "]";
}

std::string trim(const std::string& s) {
    const auto is_space = [](unsigned char c) { return std::isspace(c) != 0; };
    const auto first = std::find_if_not(s.begin(), s.end(), is_space);
    const auto last = std::find_if_not(s.rbegin(), s.rend(), is_space).base();
    return first < last ? std::string(first, last) : std::string();
}

/// The same in every locale, and with GCC 9, whose from_chars knows integers only.
bool read_number(const std::string& s, double& out) {
    std::string lower = s;
    for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (lower == "inf" || lower == "infinity") {
        out = kInf;
        return true;
    }
    std::istringstream in(s);
    in.imbue(std::locale::classic());
    in >> out;
    return !in.fail() && in.peek() == std::istringstream::traits_type::eof();
}

/// Parses one number that fills the whole text; infinity only where the range is open there.
double parse_number(const std::string& key, const std::string& text, const Range& range) {
    double v = 0.0;
    const bool whole = read_number(trim(text), v);
    const bool open_end = std::isinf(v) && v > 0 && range.max == kInf;
    if (!whole || std::isnan(v) || (std::isinf(v) && !open_end) || v < range.min || v > range.max) {
        throw ConfigError(key, text, "a number, " + format_range(range));
    }
    return v;
}

std::string join(const std::vector<std::string>& names) {
    std::string out;
    for (const auto& n : names) out += (out.empty() ? "" : ", ") + n;
    return out;
}

std::vector<std::string> split_list(const std::string& text) {
    std::string s = text;
    for (char& c : s) {
        if (c == '[' || c == ']' || c == ',') c = ' ';
    }
    std::istringstream in(s);
    std::vector<std::string> parts;
    for (std::string part; in >> part;) parts.push_back(part);
    return parts;
}

}  // namespace

ConfigError::ConfigError(std::string key, std::string value, std::string allowed)
    : std::invalid_argument(key + ": '" + value + "' is not allowed; allowed: " + allowed),
      key_(std::move(key)),
      value_(std::move(value)),
      allowed_(std::move(allowed)) {}

void ParamTable::push(ParamInfo info, std::function<void(const std::string&)> set,
                      std::function<std::string()> get) {
    info.default_value = get();
    entries_.push_back({std::move(info), std::move(set), std::move(get)});
}

void ParamTable::add(const std::string& key, double& field, Range range, const std::string& unit,
                     const std::string& doc) {
    push(
        {key, "float", "", format_range(range), unit, doc},
        [&field, key, range](const std::string& v) { field = parse_number(key, v, range); },
        [&field] { return format_number(field); });
}

void ParamTable::add(const std::string& key, std::optional<double>& field, Range range,
                     const std::string& unit, const std::string& doc) {
    push(
        {key, "float or auto", "", format_range(range), unit, doc},
        [&field, key, range](const std::string& v) {
            field =
                trim(v) == "auto" ? std::nullopt : std::make_optional(parse_number(key, v, range));
        },
        [&field] { return field ? format_number(*field) : std::string("auto"); });
}

void ParamTable::add(const std::string& key, int& field, Range range, const std::string& unit,
                     const std::string& doc) {
    push(
        {key, "int", "", format_range(range), unit, doc},
        [&field, key, range](const std::string& v) {
            const double x = parse_number(key, v, range);
            if (x != std::floor(x) || std::abs(x) > 2e9) {
                throw ConfigError(key, v, "a whole number, " + format_range(range));
            }
            field = static_cast<int>(x);
        },
        [&field] { return std::to_string(field); });
}

void ParamTable::add(const std::string& key, bool& field, const std::string& doc) {
    push(
        {key, "bool", "", "true or false", "", doc},
        [&field, key](const std::string& v) {
            std::string s = trim(v);
            std::transform(s.begin(), s.end(), s.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
            if (s != "true" && s != "false" && s != "1" && s != "0") {
                throw ConfigError(key, v, "true or false");
            }
            field = s == "true" || s == "1";
        },
        [&field] { return std::string(field ? "true" : "false"); });
}

void ParamTable::add(const std::string& key, double* field, std::size_t count, Range range,
                     const std::string& unit, const std::string& doc) {
    const std::string shape = std::to_string(count) + " numbers, each " + format_range(range);
    push(
        {key, "list of " + std::to_string(count), "", format_range(range), unit, doc},
        [field, count, key, range, shape](const std::string& v) {
            const auto parts = split_list(v);
            if (parts.size() != count) throw ConfigError(key, v, shape);
            std::vector<double> numbers;
            for (const auto& p : parts) numbers.push_back(parse_number(key, p, range));
            std::copy(numbers.begin(), numbers.end(), field);
        },
        [field, count] {
            std::string out;
            for (std::size_t i = 0; i < count; ++i) {
                out += (i == 0 ? "" : ", ") + format_number(field[i]);
            }
            return "[" + out + "]";
        });
}

void ParamTable::add_choice(const std::string& key, const std::vector<std::string>& names,
                            std::function<std::size_t()> get, std::function<void(std::size_t)> set,
                            const std::string& doc) {
    push(
        {key, "choice", "", join(names), "", doc},
        [key, names, set = std::move(set)](const std::string& v) {
            const auto it = std::find(names.begin(), names.end(), trim(v));
            if (it == names.end()) throw ConfigError(key, v, "one of " + join(names));
            set(static_cast<std::size_t>(it - names.begin()));
        },
        [names, get = std::move(get)] { return names.at(get()); });
}

const ParamTable::Entry& ParamTable::find(const std::string& key, const std::string& value) const {
    const auto it = std::find_if(entries_.begin(), entries_.end(),
                                 [&](const Entry& e) { return e.info.key == key; });
    if (it != entries_.end()) return *it;
    std::vector<std::string> keys;
    for (const auto& e : entries_) keys.push_back(e.info.key);
    throw ConfigError(key, value, "known keys: " + join(keys));
}

bool ParamTable::has(const std::string& key) const {
    return std::any_of(entries_.begin(), entries_.end(),
                       [&](const Entry& e) { return e.info.key == key; });
}

void ParamTable::set(const std::string& key, const std::string& value) {
    find(key, value).set(value);
}

std::string ParamTable::get(const std::string& key) const { return find(key, "").get(); }

std::vector<ParamInfo> ParamTable::describe() const {
    std::vector<ParamInfo> out;
    for (const auto& e : entries_) out.push_back(e.info);
    return out;
}

}  // namespace d2lio
