// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/liosam/host.hpp"
#include "d2lio/ros1/node.hpp"

namespace {

using d2lio::liosam::Host;
using d2lio::liosam::Preset;

d2lio::ros1::EstimatorKind kind(const char* name, Preset preset) {
    const auto make = [preset](const d2lio::ParamMap& params, int threads) {
        return std::make_unique<d2lio::ros1::HostEstimator<Host>>(Host(preset, params, threads));
    };
    return {name, Host::describe(preset), make};
}

}  // namespace

int main(int argc, char** argv) {
    return d2lio::ros1::run_node(argc, argv, "d2lio_liosam",
                                 {kind("liosam", Preset::kLioSam), kind("d2lio", Preset::kD2Lio)});
}
