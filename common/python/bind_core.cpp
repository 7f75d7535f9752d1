// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <nanobind/nanobind.h>

#include "errors.hpp"
#include "modules.hpp"

NB_MODULE(_core, m) {
    m.doc() = "Core of D2-LIO: ikd-tree, rejection strategies, degeneracy analysis, point times.";
    d2lio::python::translate_config_error();
    d2lio::python::bind_map(m);
    d2lio::python::bind_rejection(m);
    d2lio::python::bind_degeneracy(m);
    d2lio::python::bind_preprocess(m);
}
