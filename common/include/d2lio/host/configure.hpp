// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "d2lio/config/params.hpp"
#include "d2lio/plugin/plugin.hpp"

namespace d2lio {

/// Parameters of a host as text, by key.
using ParamMap = std::map<std::string, std::string>;

/// Splits the parameters between a host's table and its adapter.
/// @throws ConfigError for a refused value, and for an unknown key with all known ones.
void configure(const ParamMap& params, ParamTable& table, Plugin& adapter);

/// Changes a running adapter's parameters. What its strategies have learnt is forgotten.
/// @param scratch a fresh adapter, on which everything is tried before
/// @param params of the host so far; takes up the changes
/// @throws ConfigError for a refused value, and for a key that is not the adapter's; nothing has
/// changed then.
void reconfigure(const ParamMap& changes, Plugin& scratch, Plugin& adapter, ParamMap& params);

/// @throws ConfigError unless 1 to 256.
void check_threads(int threads);

/// Tells the adapter the map's voxel size and checks that its parameters fit together.
/// @throws ConfigError
void finish_configuration(Plugin& adapter, double map_voxel);

/// Every parameter of host and adapter, with default, range, unit and meaning.
std::vector<ParamInfo> describe(const ParamTable& table, const Plugin& adapter);

}  // namespace d2lio
