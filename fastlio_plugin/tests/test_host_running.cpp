// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "fastlio_drive.hpp"
#include "host_running.hpp"

namespace d2lio::test {
namespace {

struct FastLio {
    static fastlio::Host make(const ParamMap& params = {}) {
        return fastlio::Host(room_params(params));
    }
    static constexpr double kRoomError = 0.05;  // m, over 4 s with 1 cm range noise
    static constexpr std::size_t kWithoutPose = 3;
};

INSTANTIATE_TYPED_TEST_SUITE_P(FastLio, RunningHost, FastLio);

}  // namespace
}  // namespace d2lio::test
