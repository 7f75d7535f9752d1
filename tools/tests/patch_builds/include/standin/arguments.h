// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>
#include <string>

/// Parameters as words of the command line: d2lio/rejection/mode=kiss.
namespace standin {

/// Gives each key and its value, typed as a YAML reader would type it, to `set`.
template <class Value, class Set>
void read_arguments(int argc, char** argv, Set set) {
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        const std::size_t cut = argument.find('=');
        const std::string key = argument.substr(0, cut), text = argument.substr(cut + 1);
        char* end = nullptr;
        const double number = std::strtod(text.c_str(), &end);
        if (text == "true" || text == "false") {
            set(key, Value(text == "true"));
        } else if (*end == '\0' && end != text.c_str()) {
            set(key, Value(number));
        } else {
            set(key, Value(text.c_str()));
        }
    }
}

}  // namespace standin
