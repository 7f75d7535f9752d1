// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
// The extractor against the rules written down plainly, on scans of any kind.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <set>

#include "d2lio/preprocess/voxel_grid.hpp"
#include "features.hpp"
#include "scan_patterns.hpp"

namespace d2lio::liosam {
namespace {

/// One ring, every rule in turn and nothing left out.
class PlainRing {
  public:
    PlainRing(const OrderedScan& scan, std::size_t ring, const FeatureOptions& options)
        : scan_(scan),
          options_(options),
          begin_(scan.ring_begin[ring]),
          end_(scan.ring_end[ring] + 1),
          first_(begin_ - kRingMargin),
          past_(end_ + kRingMargin) {}

    void run(Features& out) {
        if (begin_ >= end_) return;
        for (int i = begin_; i < end_; ++i) judge(i);
        for (int s = 0; s < options_.sectors; ++s) run_sector(border(s), border(s + 1), out);
        std::vector<Eigen::Vector3f> others, sparse;
        for (int i = begin_; i < end_; ++i) {
            if (corners_.count(i) == 0) others.push_back(scan_.points[at(i)]);
        }
        voxel_grid(others, options_.surface_leaf, sparse);
        out.surfaces.insert(out.surfaces.end(), sparse.begin(), sparse.end());
    }

  private:
    static std::size_t at(int i) { return static_cast<std::size_t>(i); }
    float range(int i) const { return scan_.ranges[at(i)]; }
    int gap(int a, int b) const { return std::abs(scan_.columns[at(a)] - scan_.columns[at(b)]); }
    int border(int s) const { return begin_ + (end_ - begin_) * s / options_.sectors; }

    float curvature(int i) const {
        float sum = 0.F;
        for (int k = -5; k < 0; ++k) sum += range(i + k);
        sum -= 10.F * range(i);
        for (int k = 1; k <= 5; ++k) sum += range(i + k);
        return sum * sum;
    }

    /// Hidden by a step up to five points away, or grazing.
    void judge(int i) {
        bool out = false;
        for (int a = std::max(first_, i - 6); a + 1 < std::min(past_, i + 7); ++a) {
            if (gap(a, a + 1) >= options_.occlusion_columns) continue;
            const bool falls = range(a) - range(a + 1) > options_.occlusion_step;
            const bool rises = range(a + 1) - range(a) > options_.occlusion_step;
            out |= falls && i <= a && i >= a - 5;
            out |= rises && i >= a + 1 && i <= a + 6;
        }
        const float least = options_.parallel_ratio * range(i);
        out |=
            std::abs(range(i - 1) - range(i)) > least && std::abs(range(i + 1) - range(i)) > least;
        if (out) taken_.insert(i);
    }

    void take(int i) {
        taken_.insert(i);
        for (const int side : {1, -1}) {
            for (int k = 1; k <= 5; ++k) {
                if (gap(i + side * k, i + side * (k - 1)) > options_.gap_columns) break;
                taken_.insert(i + side * k);
            }
        }
    }

    void run_sector(int from, int to, Features& out) {
        std::vector<std::pair<float, int>> order;
        for (int i = from; i < to; ++i) order.emplace_back(curvature(i), i);
        std::sort(order.begin(), order.end());
        int left = options_.corners_per_sector;
        for (auto it = order.rbegin(); it != order.rend() && left > 0; ++it) {
            if (!(it->first > options_.edge_threshold) || taken_.count(it->second) > 0) continue;
            corners_.insert(it->second);
            out.corners.push_back(scan_.points[at(it->second)]);
            take(it->second);
            --left;
        }
        for (const auto& [value, i] : order) {
            if (value < options_.surface_threshold && taken_.count(i) == 0) take(i);
        }
    }

    const OrderedScan& scan_;
    const FeatureOptions& options_;
    int begin_, end_, first_, past_;
    std::set<int> taken_, corners_;
};

Features plain(const OrderedScan& scan, const FeatureOptions& options) {
    Features out;
    for (std::size_t r = 0; r < scan.ring_begin.size(); ++r) PlainRing(scan, r, options).run(out);
    return out;
}

/// Rings of walls, steps, slopes, noise and holes.
OrderedScan random_scan(std::mt19937& random, int rings, int columns) {
    std::normal_distribution<double> noise(0.0, 1.0);
    std::uniform_real_distribution<double> u(0.0, 1.0);
    const SpinningSensor sensor{rings, columns};
    std::vector<LidarPoint> raw;
    for (int ring = 0; ring < rings; ++ring) {
        const double sigma = 0.2 * std::pow(u(random), 3.0), holes = 0.3 * u(random);
        double range = 10.0, slope = 0.0;
        for (int column = 0; column < columns; ++column) {
            if (random() % 16 == 0) range = 2.0 + 30.0 * u(random);
            if (random() % 16 == 0) slope = 0.1 * noise(random);
            if (random() % 64 == 0) column += static_cast<int>(random() % 15);
            range = std::clamp(range + slope, 2.0, 40.0);
            if (u(random) < holes || column >= columns) continue;
            const double measured = std::max(range + sigma * noise(random), 1.5);
            const Eigen::Vector3f p = (measured * sensor.direction(ring, column)).cast<float>();
            raw.push_back({p.x(), p.y(), p.z(), 0.F, 0, static_cast<std::uint16_t>(ring)});
        }
    }
    OrderedScan scan;
    Projection({rings, columns}).project(raw, raw, scan);
    return scan;
}

TEST(FeaturesReference, EqualsThePlainRulesToTheBit) {
    std::mt19937 random(7);
    std::size_t corners = 0;
    for (int round = 0; round < 60; ++round) {
        FeatureOptions options;
        options.sectors = 1 + static_cast<int>(random() % 8);
        options.corners_per_sector = static_cast<int>(random() % 30);
        const int columns = round % 3 == 0 ? 30 : 600;  // short rings: sectors below five points
        const OrderedScan scan = random_scan(random, 6, columns);
        Features features;
        FeatureExtractor(options).extract(scan, features);
        const Features expected = plain(scan, options);
        ASSERT_EQ(features.corners, expected.corners) << "round " << round;
        ASSERT_EQ(features.surfaces, expected.surfaces) << "round " << round;
        corners += features.corners.size();
    }
    EXPECT_GT(corners, 1000U);  // the scans are rough enough to decide something
}

}  // namespace
}  // namespace d2lio::liosam
