// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace d2lio::ros1 {

/// A parameter as text. YAML takes a bare off, no, on for truth values: `word` is what the user may
/// have meant by one.
struct Setting {
    std::string text, word;

    static Setting of(bool value);
    static Setting of(double value);
    static Setting of(const std::string& text) { return {text, text}; }
};

/// By dotted key, "rejection.mode"; a list is one setting, "[1, 2]".
using Settings = std::map<std::string, Setting>;

/// Everything wrong with a configuration, told at once.
class Problems {
  public:
    /// @param key as the user wrote it
    void add(const std::string& key, const std::string& value, const std::string& why);
    void add(const std::string& line) { lines_.push_back(line); }
    bool empty() const { return lines_.empty(); }
    const std::vector<std::string>& lines() const { return lines_; }
    /// One message, a line per problem.
    std::string text() const;

  private:
    std::vector<std::string> lines_;
};

/// The known key nearest to a mistyped one; empty if none is near.
std::string nearest(const std::string& key, const std::set<std::string>& known);

/// A YAML file's nested mappings as dotted keys; what cannot be read is added to the problems.
Settings settings_from_yaml(const std::string& path, Problems& problems);

}  // namespace d2lio::ros1
