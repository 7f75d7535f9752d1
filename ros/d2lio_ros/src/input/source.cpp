// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/source.hpp"

#include <cmath>

namespace d2lio::ros1 {
namespace {

constexpr double kStandardGravity = 9.80665;  // m/s^2 per g
constexpr double kTiny = 1e-9;                // stands for "more than 0"

// Keys of a sequence.yaml that a node has no use for.
const std::set<std::string> kIdle{
    "bag",           "ground_truth",  "stamps", "imu.gyro_noise", "imu.accel_noise",
    "imu.gyro_walk", "imu.accel_walk"};

std::string path_of(const std::string& where, std::string key) {
    if (where.empty()) {
        for (char& c : key) c = c == '.' ? '/' : c;
        return "~" + key;
    }
    return where + ": " + key;
}

void set_number(ParamTable& table, const std::string& key, const Setting& value,
                const std::string& where, Problems& problems) {
    try {
        table.set(key, value.text);
    } catch (const ConfigError& e) {
        problems.add(path_of(where, key), value.text, "allowed: " + e.allowed());
    }
}

/// The keys under `host.` and `hosts.NAME.`; the latter win.
Settings take_host_sections(Settings& settings, const std::string& host) {
    Settings out;
    for (const std::string& prefix : {std::string("host."), "hosts." + host + "."}) {
        for (auto it = settings.lower_bound(prefix);
             it != settings.end() && it->first.compare(0, prefix.size(), prefix) == 0;
             it = settings.erase(it)) {
            out[it->first.substr(prefix.size())] = it->second;
        }
    }
    for (auto it = settings.lower_bound("hosts."); it != settings.end();) {
        it = it->first.compare(0, 6, "hosts.") == 0 ? settings.erase(it) : settings.end();
    }
    return out;
}

}  // namespace

void Source::bind(ParamTable& t) {
    t.add("T_imu_lidar", T_imu_lidar, 16, {-1e6, 1e6}, "m", "maps LiDAR points to the IMU frame");
    t.add("lidar.rings", rings, {0, 1024}, "", "rings of the LiDAR, 0: unknown");
    t.add("lidar.columns", columns, {0, 16384}, "", "firings of a ring in a turn, 0: the model's");
    t.add("lidar.rate_hz", rate_hz, {0.5, 1000.0}, "Hz", "sweeps per second");
    t.add("lidar.min_range_m", min_range_m, {0.0, kInf}, "m", "nearer returns are dropped");
    t.add("lidar.max_range_m", max_range_m, {kTiny, kInf}, "m", "farther returns are dropped");
    t.add("lidar.time_unit", time_unit, {"auto", "s", "ms", "us", "ns"}, "of the point times");
    t.add("lidar.time_reference", time_reference, {"auto", "start", "end", "absolute"},
          "what the point times count from");
    t.add("lidar.synchronised", synchronised, "points are motion compensated to the stamp");
    t.add("lidar.pseudo_times", pseudo_times, "estimate missing times from the azimuth");
    t.add("imu.rate_hz", imu_rate_hz, {kTiny, kInf}, "Hz", "samples per second");
    t.add("imu.accel_unit", accel_unit, {"m/s^2", "g"}, "of the accelerations");
    t.add("imu.orientation", orientation, "hand on the attitude of a 9-axis IMU");
}

const std::set<std::string>& Source::text_keys() {
    static const std::set<std::string> keys{"name", "lidar.topic", "lidar.model",
                                            "lidar.time_field", "imu.topic"};
    return keys;
}

void Source::set_text(const std::string& key, const std::string& value) {
    if (key == "name") name = value;
    if (key == "lidar.topic") lidar_topic = value;
    if (key == "imu.topic") imu_topic = value;
    if (key == "lidar.time_field") time_field = value;
    if (key == "lidar.model") {
        model = value;
        for (char& c : model) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
}

void Source::complete(bool is_sequence) {
    if (!is_sequence || !time_field.empty()) return;
    // A sequence without a time field holds points that are motion compensated.
    synchronised = true;
    time_unit = TimeUnit::kAuto;
}

PointTimeHint Source::time_hint() const {
    return {time_unit, time_reference, 1.0 / rate_hz, synchronised, pseudo_times};
}

double Source::accel_scale() const { return accel_unit == AccelUnit::kG ? kStandardGravity : 1.0; }

void take_source(Settings& settings, Source& source, const std::string& where, Problems& problems) {
    ParamTable table;
    source.bind(table);
    for (auto it = settings.begin(); it != settings.end();) {
        const std::string& key = it->first;
        const bool text = Source::text_keys().count(key) > 0;
        if (!text && !table.has(key)) {
            ++it;
            continue;
        }
        // An orientation left open in a file is a yes.
        const bool open = key == "imu.orientation" && it->second.text.empty();
        if (text) {
            source.set_text(key, it->second.word);
        } else if (!open) {
            set_number(table, key, it->second, where, problems);
        }
        source.stated.insert(key);
        it = settings.erase(it);
    }
}

void read_source_file(const std::string& path, const std::string& host, Source& source,
                      Problems& problems) {
    Settings settings = settings_from_yaml(path, problems);
    const bool is_sequence = settings.count("bag") > 0;
    if (settings.count("stamps") > 0 && settings["stamps"].text != "header") {
        problems.add(path + ": stamps", settings["stamps"].text,
                     "allowed: header (a node has no recorder's stamps)");
    }
    for (const std::string& key : kIdle) settings.erase(key);
    source.host = take_host_sections(settings, host);
    take_source(settings, source, path, problems);
    std::set<std::string> known = Source::text_keys();
    ParamTable table;
    source.bind(table);
    for (const ParamInfo& info : table.describe()) known.insert(info.key);
    for (const auto& [key, value] : settings) {
        const std::string near = nearest(key, known);
        problems.add(path + ": " + key, value.text,
                     "unknown key" + (near.empty() ? "" : "; did you mean " + near + "?"));
    }
    source.complete(is_sequence);
}

}  // namespace d2lio::ros1
