// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/plugin/verdict_book.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace d2lio {

void VerdictBook::begin_scan(std::size_t points) {
    verdicts_.assign(points, Verdict::kFewNeighbours);
    thresholds_.assign(points, std::numeric_limits<float>::infinity());
    ranges_.assign(points, std::numeric_limits<float>::quiet_NaN());
}

CorrespondenceCounts VerdictBook::counts() const {
    CorrespondenceCounts c;
    int* const fields[] = {&c.accepted,       &c.few_neighbours, &c.far_neighbours, &c.threshold,
                           &c.singular_plane, &c.plane_fit,      &c.residual};
    for (const Verdict v : verdicts_) ++*fields[static_cast<std::size_t>(v)];
    c.offered = static_cast<int>(verdicts_.size());
    return c;
}

RangeCounts VerdictBook::counts_by_range() const {
    RangeCounts c;
    for (std::size_t i = 0; i < verdicts_.size(); ++i) {
        const auto range = static_cast<double>(ranges_[i]);
        if (std::isnan(range)) continue;
        std::size_t bin = 0;
        while (bin < kRangeEdges.size() && range >= kRangeEdges[bin]) ++bin;
        ++c.offered[bin];
        if (verdicts_[i] == Verdict::kAccepted) ++c.accepted[bin];
    }
    return c;
}

void VerdictBook::close(ScanDiagnostics& record) {
    record.counts = counts();
    record.by_range = counts_by_range();
    threshold_statistics(record);
}

void VerdictBook::threshold_statistics(ScanDiagnostics& out) {
    const auto finite_end = std::partition(thresholds_.begin(), thresholds_.end(),
                                           [](float t) { return std::isfinite(t); });
    if (finite_end == thresholds_.begin()) return;
    const auto middle = thresholds_.begin() + (finite_end - thresholds_.begin()) / 2;
    std::nth_element(thresholds_.begin(), middle, finite_end);
    const auto [low, high] = std::minmax_element(thresholds_.begin(), finite_end);
    out.epsilon_min = static_cast<double>(*low);
    out.epsilon_median = static_cast<double>(*middle);
    out.epsilon_max = static_cast<double>(*high);
}

}  // namespace d2lio
