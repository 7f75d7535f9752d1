// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Stands in for a header that LIO-SAM includes but does not use: GTSAM without its unstable part.
