// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

#include "d2lio/types.hpp"

/// One small struct per rejection strategy. Each answers one question: how far from its nearest map
/// point may a scan point lie? A correspondence is accepted when distance <= threshold(range).
namespace d2lio {

/// Magnitude of a rigid motion, as the strategies see it.
struct MotionMagnitude {
    double translation = 0.0;  ///< ||t||, m
    double rotation = 0.0;     ///< ||Log R||, rad in [0, pi]

    static MotionMagnitude of(const Pose& motion);
    /// Largest displacement of a point `range` metres away: ||t|| + 2 range sin(angle / 2), m.
    double displacement(double range) const;
};

/// Paper mode (1): every correspondence with a plane is accepted.
struct NoRejection {
    double threshold(double /*range*/) const { return std::numeric_limits<double>::infinity(); }
    void begin_scan(const MotionMagnitude& /*predicted*/) {}
    void end_scan(const MotionMagnitude& /*deviation*/) {}
};

/// Paper mode (2): one constant distance.
struct FixedRejection {
    double tau = 2.0;  ///< m

    double threshold(double /*range*/) const { return tau; }
    void begin_scan(const MotionMagnitude& /*predicted*/) {}
    void end_scan(const MotionMagnitude& /*deviation*/) {}
};

/// Paper mode (3): 3 sigma_k with sigma_k^2 the running mean of delta^2 over the scans whose
/// deviation from the prediction exceeds delta_min (Vizzo et al., KISS-ICP, 2023, eq. 7-9).
struct KissRejection {
    double sigma_0 = 2.0;    ///< m, first sample of the mean
    double delta_min = 0.1;  ///< m
    double r_max = 100.0;    ///< m, range at which a rotation is turned into a distance

    double sigma() const;  ///< m
    double threshold(double /*range*/) const { return 3.0 * sigma(); }
    void begin_scan(const MotionMagnitude& /*predicted*/) {}
    void end_scan(const MotionMagnitude& deviation);

    double sum_of_squares = 0.0;  ///< of the deviations counted so far, m^2
    int samples = 0;              ///< deviations counted so far
};

/// Paper mode (4), eq. of section III-D: epsilon_j = ||t|| + 2 ||p_j|| sin(||Log R|| / 2), plus the
/// floor epsilon_0 (ours: at standstill the paper's value is 0 and would reject every point).
struct PointAdaptiveRejection {
    enum class Motion {
        kPredicted,  ///< motion predicted for this scan (the paper)
        kDeviation,  ///< last scan's deviation of the estimate from its prediction (as KISS-ICP)
    };
    double epsilon_0 = 0.5;  ///< m
    Motion motion = Motion::kPredicted;

    double threshold(double range) const { return current.displacement(range) + epsilon_0; }
    void begin_scan(const MotionMagnitude& predicted) {
        if (motion == Motion::kPredicted) current = predicted;
    }
    void end_scan(const MotionMagnitude& deviation) {
        if (motion == Motion::kDeviation) current = deviation;
    }

    MotionMagnitude current;
};

}  // namespace d2lio
