// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Stands in for the C header that OpenCV 4 no longer has.
#include <opencv2/opencv.hpp>
