// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "../../common/python/bind_host.hpp"
#include "d2lio/liosam/host.hpp"

namespace d2lio::python {
namespace {

/// One preset as a class of its own.
template <liosam::Preset preset>
class PresetHost : public liosam::Host {
  public:
    PresetHost(const ParamMap& params, int threads) : liosam::Host(preset, params, threads) {}
    static std::vector<ParamInfo> describe() { return liosam::Host::describe(preset); }
};

}  // namespace

NB_MODULE(_liosam, m) {
    m.doc() = "LIO-SAM-equivalent host of D2-LIO, and D2-LIO itself.";
    translate_config_error();
    using Result = ResultOf<liosam::Host>;
    bind_result<Result>(m);
    bind_host<PresetHost<liosam::Preset::kLioSam>, Result>(
        m, "LioSamHost",
        "LiDAR-inertial odometry that behaves like LIO-SAM. Calls from several threads take "
        "turns.");
    bind_host<PresetHost<liosam::Preset::kD2Lio>, Result>(
        m, "D2LioHost",
        "The paper's modified LIO-SAM: direct front end, point-adaptive rejection, directional "
        "prior. Calls from several threads take turns.");
}

}  // namespace d2lio::python
