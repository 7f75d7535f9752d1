// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "d2lio/diagnostics/scan_diagnostics.hpp"
#include "d2lio/plugin/plugin.hpp"

namespace d2lio {

/// Verdict, threshold and range of every point of one scan. Threads may write different points at a
/// time.
class VerdictBook {
  public:
    void begin_scan(std::size_t points);
    std::size_t size() const { return verdicts_.size(); }
    int accepted() const {
        return static_cast<int>(std::count(verdicts_.begin(), verdicts_.end(), Verdict::kAccepted));
    }
    Verdict& verdict(std::size_t i) { return verdicts_[i]; }
    const std::vector<Verdict>& verdicts() const { return verdicts_; }
    void set_threshold(std::size_t i, double threshold) {
        thresholds_[i] = static_cast<float>(threshold);
    }

    /// @param range of the point from the body, m.
    void set_range(std::size_t i, double range) { ranges_[i] = static_cast<float>(range); }

    CorrespondenceCounts counts() const;
    /// The points whose range was set.
    RangeCounts counts_by_range() const;
    /// Puts the counts, and minimum, median and maximum of the thresholds used (NaN where none was
    /// finite), into a record. Ends the scan: the thresholds are in another order afterwards.
    void close(ScanDiagnostics& record);

  private:
    void threshold_statistics(ScanDiagnostics& out);

    std::vector<Verdict> verdicts_;
    std::vector<float> thresholds_, ranges_;
};

}  // namespace d2lio
