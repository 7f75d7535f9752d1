// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "../../common/python/bind_host.hpp"
#include "d2lio/fastlio/host.hpp"

namespace d2lio::python {

NB_MODULE(_fastlio, m) {
    m.doc() = "FAST-LIO2-equivalent host of D2-LIO.";
    translate_config_error();
    using Result = ResultOf<fastlio::Host>;
    bind_result<Result>(m);
    bind_host<fastlio::Host, Result>(
        m, "FastLioHost",
        "LiDAR-inertial odometry that behaves like FAST-LIO2. Calls from several threads take "
        "turns.");
}

}  // namespace d2lio::python
