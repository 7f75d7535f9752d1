// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/configuration.hpp"

#include <algorithm>

namespace d2lio::ros1 {
namespace {

/// Members that are texts, by key.
std::map<std::string, std::string*> text_members(NodeOptions& n) {
    return {{"lidar_topic", &n.lidar_topic}, {"imu_topic", &n.imu_topic},
            {"map_frame", &n.map_frame},     {"body_frame", &n.body_frame},
            {"save_dir", &n.save_dir},       {"results_name", &n.results_name},
            {"estimator", &n.estimator},     {"sequence_config", &n.sequence_config}};
}

std::string as_path(std::string key) {
    for (char& c : key) c = c == '.' ? '/' : c;
    return "~" + key;
}

void take_node_options(Settings& settings, NodeOptions& node, Problems& problems) {
    ParamTable table;
    node.bind(table);
    const auto texts = text_members(node);
    for (auto it = settings.begin(); it != settings.end();) {
        const auto& [key, value] = *it;
        const auto text = texts.find(key);
        if (text == texts.end() && !table.has(key)) {
            ++it;
            continue;
        }
        if (text != texts.end()) {
            *text->second = value.word;
        } else {
            try {
                table.set(key, value.text);
            } catch (const ConfigError& e) {
                problems.add(as_path(key), value.text, "allowed: " + e.allowed());
            }
        }
        it = settings.erase(it);
    }
}

const EstimatorKind* choose(const std::vector<EstimatorKind>& kinds, const std::string& name,
                            Problems& problems) {
    if (name.empty()) return &kinds.front();
    std::string names;
    for (const EstimatorKind& kind : kinds) {
        if (kind.name == name) return &kind;
        names += (names.empty() ? "" : ", ") + kind.name;
    }
    problems.add("~estimator", name, "allowed: " + names);
    return &kinds.front();
}

bool has_param(const EstimatorKind& kind, const std::string& key) {
    return std::any_of(kind.params.begin(), kind.params.end(),
                       [&](const ParamInfo& p) { return p.key == key; });
}

/// Removes what no one knows, with a word about each.
void refuse_unknown(Settings& settings, const EstimatorKind& kind, const std::string& where,
                    Problems& problems) {
    std::set<std::string> known;
    for (const ParamInfo& p : kind.params) known.insert(p.key);
    if (where.empty()) {
        NodeOptions node;
        Source source;
        ParamTable table;
        node.bind(table);
        source.bind(table);
        for (const ParamInfo& p : table.describe()) known.insert(p.key);
        for (const auto& member : text_members(node)) known.insert(member.first);
        known.insert(Source::text_keys().begin(), Source::text_keys().end());
    }
    for (auto it = settings.begin(); it != settings.end();) {
        if (has_param(kind, it->first)) {
            ++it;
            continue;
        }
        const std::string name = where.empty() ? as_path(it->first) : where + it->first;
        const std::string near = nearest(it->first, known);
        const std::string hint = where.empty() && !near.empty() ? as_path(near) : near;
        problems.add(name, it->second.text,
                     "unknown key" + (hint.empty() ? "" : "; did you mean " + hint + "?"));
        it = settings.erase(it);
    }
}

void settle_topics(Configuration& c) {
    if (c.node.lidar_topic.empty()) c.node.lidar_topic = c.source.lidar_topic;
    if (c.node.imu_topic.empty()) c.node.imu_topic = c.source.imu_topic;
    if (c.node.lidar_topic.empty()) c.problems.add("~lidar_topic", "", "a topic must be named");
    if (c.node.imu_topic.empty()) c.problems.add("~imu_topic", "", "a topic must be named");
}

void check_last_row(Configuration& c) {
    const double* row = c.source.T_imu_lidar + 12;
    if (row[0] == 0.0 && row[1] == 0.0 && row[2] == 0.0 && row[3] == 1.0) return;
    c.problems.add("~T_imu_lidar", "16 numbers", "the last four must be 0, 0, 0, 1");
}

/// Makes the estimator; every value it refuses is told, not only the first.
void make_estimator(Configuration& c) {
    ParamMap params = c.params;
    while (c.estimator == nullptr) {
        try {
            c.estimator = c.kind->make(params, c.node.threads);
        } catch (const ConfigError& e) {
            const auto bad = params.find(e.key());
            const std::string key = has_param(*c.kind, e.key()) ? as_path(e.key()) : e.key();
            c.problems.add(key, e.value(), "allowed: " + e.allowed());
            if (bad == params.end()) return;
            params.erase(bad);
        }
    }
}

}  // namespace

void NodeOptions::bind(ParamTable& t) {
    t.add("lidar_type", lidar_type, lidar_type_names(), "message type of the LiDAR topic");
    t.add("publish_tf", publish_tf, "publish the transform from map to body");
    t.add("queue_scans", queue_scans, {0, 100000}, "", "scans that wait, 0: all of them");
    t.add("threads", threads, {1, 256}, "", "of the estimator");
    t.add("map_period", map_period, {0.0, 1e6}, "s", "time between maps, 0: only when asked");
}

ParamMap as_params(const Settings& settings, const EstimatorKind& kind) {
    ParamMap out;
    for (const auto& [key, value] : settings) {
        const auto info = std::find_if(kind.params.begin(), kind.params.end(),
                                       [&k = key](const ParamInfo& p) { return p.key == k; });
        const bool choice = info != kind.params.end() && info->type == "choice";
        out[key] = choice ? value.word : value.text;
    }
    return out;
}

Configuration configure(Settings settings, const std::vector<EstimatorKind>& kinds) {
    Configuration c;
    take_node_options(settings, c.node, c.problems);
    c.kind = choose(kinds, c.node.estimator, c.problems);
    if (!c.node.sequence_config.empty()) {
        read_source_file(c.node.sequence_config, c.kind->name, c.source, c.problems);
    }
    take_source(settings, c.source, "", c.problems);
    settle_topics(c);
    check_last_row(c);
    refuse_unknown(c.source.host, *c.kind, c.node.sequence_config + ": host.", c.problems);
    refuse_unknown(settings, *c.kind, "", c.problems);
    ParamMap own = as_params(c.source.host, *c.kind);
    for (auto& [key, value] : as_params(settings, *c.kind)) own[key] = value;
    // Bounded memory where one sensor falls silent; the node never lets the host's queue fill.
    own.emplace("live", "true");
    c.params = source_params(c.source, c.kind->name, own);
    make_estimator(c);
    return c;
}

}  // namespace d2lio::ros1
