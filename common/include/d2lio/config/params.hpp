// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace d2lio {

/// A configuration that cannot be used; names the key, the value and what is allowed.
class ConfigError : public std::invalid_argument {
  public:
    ConfigError(std::string key, std::string value, std::string allowed);
    const std::string& key() const { return key_; }
    const std::string& value() const { return value_; }
    const std::string& allowed() const { return allowed_; }

  private:
    std::string key_, value_, allowed_;
};

/// Closed interval of allowed values.
struct Range {
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
};

constexpr double kInf = std::numeric_limits<double>::infinity();

/// What the parameter page shows of one key.
struct ParamInfo {
    std::string key, type, default_value, range, unit, doc;
};

/// Binds dotted keys to the fields of a configuration struct. The table holds references: it must
/// not outlive the struct. All setters parse strictly and throw ConfigError.
class ParamTable {
  public:
    void add(const std::string& key, double& field, Range range, const std::string& unit,
             const std::string& doc);
    /// A number that may be left to the program, written "auto".
    void add(const std::string& key, std::optional<double>& field, Range range,
             const std::string& unit, const std::string& doc);
    void add(const std::string& key, int& field, Range range, const std::string& unit,
             const std::string& doc);
    void add(const std::string& key, bool& field, const std::string& doc);
    /// A field with named values; `Enum` must be an enum class whose values count up from 0.
    template <typename Enum>
    void add(const std::string& key, Enum& field, const std::vector<std::string>& names,
             const std::string& doc) {
        add_choice(
            key, names, [&field] { return static_cast<std::size_t>(field); },
            [&field](std::size_t i) { field = static_cast<Enum>(i); }, doc);
    }
    /// A fixed-length list of numbers, written "[a, b, c]" or "a, b, c" or "a b c".
    void add(const std::string& key, double* field, std::size_t count, Range range,
             const std::string& unit, const std::string& doc);

    /// Sets one key from text. @throws ConfigError for an unknown key or a value outside its range.
    void set(const std::string& key, const std::string& value);
    bool has(const std::string& key) const;
    /// Current value of a key as text. @throws ConfigError for an unknown key.
    std::string get(const std::string& key) const;
    /// Every key with its type, current value, range, unit and text, in order of binding.
    std::vector<ParamInfo> describe() const;

  private:
    struct Entry {
        ParamInfo info;
        std::function<void(const std::string&)> set;
        std::function<std::string()> get;
    };
    void add_choice(const std::string& key, const std::vector<std::string>& names,
                    std::function<std::size_t()> get, std::function<void(std::size_t)> set,
                    const std::string& doc);
    void push(ParamInfo info, std::function<void(const std::string&)> set,
              std::function<std::string()> get);
    const Entry& find(const std::string& key, const std::string& value) const;

    std::vector<Entry> entries_;
};

}  // namespace d2lio
