// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nanobind/nanobind.h>

namespace d2lio::python {

void bind_map(nanobind::module_& m);
void bind_rejection(nanobind::module_& m);
void bind_degeneracy(nanobind::module_& m);
void bind_preprocess(nanobind::module_& m);

}  // namespace d2lio::python
