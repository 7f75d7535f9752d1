// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <map>

#include "d2lio/plugin/verdict_book.hpp"

namespace d2lio {
namespace {

TEST(VerdictBook, CountsByRangeWhatWasOfferedAndAccepted) {
    VerdictBook book;
    book.begin_scan(7);
    const double ranges[] = {0.5, 4.999, 5.0, 39.0, 80.0, 200.0};
    for (std::size_t i = 0; i < 6; ++i) book.set_range(i, ranges[i]);  // the last never came
    for (const std::size_t i : {0U, 3U, 5U}) book.verdict(i) = Verdict::kAccepted;
    const RangeCounts c = book.counts_by_range();
    EXPECT_EQ(c.offered, (std::array<int, 6>{2, 1, 0, 1, 0, 2}));
    EXPECT_EQ(c.accepted, (std::array<int, 6>{1, 0, 0, 1, 0, 1}));
    book.begin_scan(7);
    EXPECT_EQ(book.counts_by_range().offered, (std::array<int, 6>{}));
}

TEST(VerdictBook, RangesAreColumnsOfTheRecord) {
    ScanDiagnostics record;
    record.by_range.offered = {6, 5, 4, 3, 2, 1};
    record.by_range.accepted = {5, 4, 3, 2, 1, 0};
    std::map<std::string, double> columns;
    for (const auto& [name, value] : record.columns()) columns[name] = value;
    EXPECT_EQ(columns.at("offered_to_5m"), 6.0);
    EXPECT_EQ(columns.at("accepted_to_80m"), 1.0);
    EXPECT_EQ(columns.at("offered_beyond_80m"), 1.0);
    EXPECT_EQ(columns.at("accepted_beyond_80m"), 0.0);
}

}  // namespace
}  // namespace d2lio
