// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>

#include <map>
#include <string>

#include "d2lio/config/params.hpp"

namespace d2lio::python {

/// A configuration struct with its keys set from text. @throws ConfigError
template <typename Config>
Config configured(const std::map<std::string, std::string>& params) {
    Config config;
    ParamTable table;
    config.bind(table);
    for (const auto& [key, value] : params) table.set(key, value);
    return config;
}

}  // namespace d2lio::python
