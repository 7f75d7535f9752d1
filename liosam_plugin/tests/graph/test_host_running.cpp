// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "host_running.hpp"
#include "liosam_drive.hpp"

namespace d2lio::test {
namespace {

struct LioSam {
    static liosam::Host make(ParamMap params = {}) {
        params["mappingProcessInterval"] = "0";
        return liosam::Host(liosam::Preset::kLioSam, indoor(params));
    }
    static constexpr double kRoomError = 0.05;  // m, over 4 s with 1 cm range noise
    static constexpr std::size_t kWithoutPose = 2;
};

INSTANTIATE_TYPED_TEST_SUITE_P(LioSam, RunningHost, LioSam);

}  // namespace
}  // namespace d2lio::test
