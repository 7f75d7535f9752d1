// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "d2lio/fastlio/host.hpp"
#include "drive.hpp"

namespace d2lio::test {

inline std::vector<ScanResult> run(const ParamMap& extra = {}, int threads = 1,
                                   const Drive& drive = {}) {
    return run_host(fastlio::Host(room_params(extra), threads), drive);
}

}  // namespace d2lio::test
