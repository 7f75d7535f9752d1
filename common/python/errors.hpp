// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

#include "d2lio/config/params.hpp"

namespace d2lio::python {

/// Makes ConfigError arrive in Python as d2lio.errors.ConfigError (a ValueError with key, value and
/// allowed). Outside the package it is a plain ValueError.
inline void translate_config_error() {
    nanobind::register_exception_translator([](const std::exception_ptr& p, void*) {
        try {
            std::rethrow_exception(p);
        } catch (const ConfigError& e) {
            try {
                const auto type = nanobind::module_::import_("d2lio.errors").attr("ConfigError");
                const auto error = type(e.key().c_str(), e.value().c_str(), e.allowed().c_str());
                PyErr_SetObject(type.ptr(), error.ptr());
            } catch (nanobind::python_error&) {
                PyErr_SetString(PyExc_ValueError, e.what());
            }
        }
    });
}

}  // namespace d2lio::python
