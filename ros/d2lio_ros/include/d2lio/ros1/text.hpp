// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "d2lio/types.hpp"

/// Numbers and texts as `d2lio run` writes them, so that its files and ours compare line by line.
namespace d2lio::ros1 {

/// Shortest text that reads back as the same number, laid out as Python does: 0.1, 1e-05, nan.
std::string shortest(double value);
/// A figure of a diagnostics row: whole numbers without a decimal point, unless a time.
std::string figure(const std::string& column, double value);
/// A stamp in seconds with all nine decimals, exactly.
std::string seconds_text(Stamp stamp);
/// A field of a CSV row, quoted where it must be.
std::string csv_field(const std::string& text);
/// A text in JSON, with its quotes.
std::string json_text(const std::string& text);

}  // namespace d2lio::ros1
