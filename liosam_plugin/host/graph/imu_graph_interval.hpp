// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtsam/navigation/ImuFactor.h>

#include <optional>
#include <vector>

#include "imu_graph.hpp"
#include "imu_graph_state.hpp"

namespace d2lio::liosam {

/// Turns the inputs between two scans into one preintegrated measurement, whatever their faults.
class IntervalIntegrator {
  public:
    explicit IntervalIntegrator(const ImuGraphOptions& options);

    struct Interval {
        gtsam::PreintegratedImuMeasurements measurement;
        bool bridged;  ///< no usable input: constant velocity and attitude, loose
    };

    /// Preintegrates from the state `from` on. Faulty steps are counted in `counts`.
    Interval integrate(const GraphEstimate& from, const std::vector<ImuStep>& steps,
                       GraphCounts& counts);
    /// Forgets the length of the last interval.
    void clear() { last_duration_ = kDefaultDuration; }

  private:
    static constexpr double kDefaultDuration = 0.1;  // s: one turn of the common LiDARs

    std::optional<gtsam::PreintegratedImuMeasurements> measured(const GraphEstimate& from,
                                                                const std::vector<ImuStep>& steps,
                                                                GraphCounts& counts) const;
    gtsam::PreintegratedImuMeasurements bridge(const GraphEstimate& from, double duration) const;

    double max_step_;
    boost::shared_ptr<gtsam::PreintegrationParams> params_, bridge_params_;
    double last_duration_ = kDefaultDuration;
};

}  // namespace d2lio::liosam
