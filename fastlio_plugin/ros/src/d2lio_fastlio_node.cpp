// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/host.hpp"
#include "d2lio/ros1/node.hpp"

int main(int argc, char** argv) {
    using d2lio::ParamMap;
    using d2lio::fastlio::Host;
    using FastLio = d2lio::ros1::HostEstimator<Host>;
    const auto make = [](const ParamMap& params, int threads) {
        return std::make_unique<FastLio>(Host(params, threads));
    };
    return d2lio::ros1::run_node(argc, argv, "d2lio_fastlio",
                                 {{"fastlio", Host::describe(), make}});
}
