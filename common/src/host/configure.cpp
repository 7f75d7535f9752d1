// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/host/configure.hpp"

namespace d2lio {
namespace {

/// Hands one key to the adapter. @throws ConfigError where it refuses the value.
void set_adapter(Plugin& adapter, const ParamDoc& doc, const std::string& value) {
    if (!adapter.set(doc.key, value.c_str())) throw ConfigError(doc.key, value, doc.range);
}

}  // namespace

void configure(const ParamMap& params, ParamTable& table, Plugin& adapter) {
    std::map<std::string, std::size_t> adapter_keys;
    std::string known;
    for (const ParamInfo& info : table.describe()) known += info.key + ", ";
    for (std::size_t i = 0; i < adapter.param_count(); ++i) {
        adapter_keys[adapter.param(i).key] = i;
        known += adapter.param(i).key + std::string(i + 1 < adapter.param_count() ? ", " : "");
    }
    for (const auto& [key, value] : params) {
        const auto it = adapter_keys.find(key);
        if (it != adapter_keys.end()) {
            set_adapter(adapter, adapter.param(it->second), value);
        } else if (table.has(key)) {
            table.set(key, value);
        } else {
            throw ConfigError(key, value, "known keys: " + known);
        }
    }
}

void reconfigure(const ParamMap& changes, Plugin& scratch, Plugin& adapter, ParamMap& params) {
    std::map<std::string, ParamDoc> docs;
    for (std::size_t i = 0; i < scratch.param_count(); ++i) {
        docs[scratch.param(i).key] = scratch.param(i);
    }
    ParamMap next = params;
    for (const auto& [key, value] : changes) {
        if (docs.count(key) == 0) throw ConfigError(key, value, "no change while running");
        next[key] = value;
    }
    for (const auto& [key, value] : next) {
        if (docs.count(key) > 0) set_adapter(scratch, docs[key], value);
    }
    if (!scratch.check()) throw ConfigError("parameters", "their combination", scratch.error());
    for (const auto& [key, value] : changes) set_adapter(adapter, docs[key], value);
    params = std::move(next);
}

void check_threads(int threads) {
    if (threads < 1 || threads > 256) {
        throw ConfigError("threads", std::to_string(threads), "[1, 256]");
    }
}

void finish_configuration(Plugin& adapter, double map_voxel) {
    adapter.set_map_voxel(map_voxel);
    if (!adapter.check()) throw ConfigError("parameters", "their combination", adapter.error());
}

std::vector<ParamInfo> describe(const ParamTable& table, const Plugin& adapter) {
    std::vector<ParamInfo> out = table.describe();
    for (std::size_t i = 0; i < adapter.param_count(); ++i) {
        const ParamDoc d = adapter.param(i);
        out.push_back({d.key, d.type, d.default_value, d.range, d.unit, d.doc});
    }
    return out;
}

}  // namespace d2lio
