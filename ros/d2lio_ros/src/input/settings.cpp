// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/settings.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <numeric>

#include "d2lio/ros1/text.hpp"

namespace d2lio::ros1 {
namespace {

constexpr std::size_t kNear = 3;  // letters in which a mistyped key may differ

std::size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t corner = row[0]++;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t replace = corner + (a[i] == b[j] ? 0 : 1);
            corner = row[j + 1];
            row[j + 1] = std::min({replace, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
}

std::string list_text(const YAML::Node& node) {
    std::string out = "[";
    for (const YAML::Node& item : node) {
        if (out.size() > 1) out += ", ";
        out += item.IsSequence() ? list_text(item) : item.IsScalar() ? item.Scalar() : "?";
    }
    return out + "]";
}

Setting scalar(const YAML::Node& node) {
    bool truth = false;
    // Quoted texts carry the tag "!"; a bare off is a truth value in YAML 1.1.
    if (node.Tag() != "!" && YAML::convert<bool>::decode(node, truth)) {
        return {truth ? "true" : "false", node.Scalar()};
    }
    return Setting::of(node.Scalar());
}

void flatten(const YAML::Node& node, const std::string& prefix, Settings& out) {
    for (const auto& item : node) {
        const std::string key = prefix + (prefix.empty() ? "" : ".") + item.first.as<std::string>();
        const YAML::Node& value = item.second;
        if (value.IsMap()) {
            flatten(value, key, out);
        } else if (value.IsSequence()) {
            out[key] = Setting::of(list_text(value));
        } else if (value.IsScalar()) {
            out[key] = scalar(value);
        } else {
            out[key] = Setting::of(std::string());  // null
        }
    }
}

}  // namespace

Setting Setting::of(bool value) { return value ? Setting{"true", "on"} : Setting{"false", "off"}; }
Setting Setting::of(double value) { return of(shortest(value)); }

void Problems::add(const std::string& key, const std::string& value, const std::string& why) {
    lines_.push_back(key + " = " + (value.empty() ? "''" : value) + ": " + why);
}

std::string Problems::text() const {
    std::string out;
    for (const std::string& line : lines_) out += "\n  " + line;
    return out;
}

std::string nearest(const std::string& key, const std::set<std::string>& known) {
    std::string best;
    std::size_t least = kNear + 1;
    for (const std::string& name : known) {
        const std::size_t distance = edit_distance(key, name);
        if (distance < least) {
            least = distance;
            best = name;
        }
    }
    return best;
}

Settings settings_from_yaml(const std::string& path, Problems& problems) {
    Settings out;
    try {
        const YAML::Node root = YAML::LoadFile(path);
        if (root.IsMap()) {
            flatten(root, "", out);
        } else {
            problems.add("sequence_config", path, "not a YAML mapping");
        }
    } catch (const YAML::Exception& e) {
        problems.add("sequence_config", path, std::string("cannot be read: ") + e.what());
    }
    return out;
}

}  // namespace d2lio::ros1
