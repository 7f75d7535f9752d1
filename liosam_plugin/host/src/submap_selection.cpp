// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "submap_selection.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace d2lio::liosam {

namespace {

/// Cell of a position as one number. Cells are fixed in the map (a keyframe does not change its
/// cell as the centre moves) but numbered from the centre's, so that 21 bits an axis are enough
/// anywhere.
std::uint64_t cell_of(const Vec3& position, const Vec3& centre, double side) {
    constexpr double kMiddle = 1 << 20;
    std::uint64_t cell = 0;
    for (Eigen::Index a = 0; a < 3; ++a) {
        const double step = std::floor(position[a] / side) - std::floor(centre[a] / side);
        cell = (cell << 21U) | static_cast<std::uint64_t>(step + kMiddle);
    }
    return cell;
}

}  // namespace

bool SubmapSelector::in_reach(const Vec3& position, const Vec3& centre) const {
    return (position - centre).squaredNorm() <= options_.search_radius * options_.search_radius;
}

const std::vector<std::uint32_t>& SubmapSelector::select(const std::vector<KeyPosition>& keys,
                                                         const Vec3& centre, Stamp now) {
    chosen_.clear();
    collect_near(keys, centre);
    take_one_per_cell();
    take_recent(keys, centre, now);
    std::sort(chosen_.begin(), chosen_.end());
    chosen_.erase(std::unique(chosen_.begin(), chosen_.end()), chosen_.end());
    return chosen_;
}

void SubmapSelector::collect_near(const std::vector<KeyPosition>& keys, const Vec3& centre) {
    near_.clear();
    for (const KeyPosition& key : keys) {
        if (!in_reach(key.position, centre)) continue;
        near_.push_back({cell_of(key.position, centre, options_.density), &key});
    }
    std::sort(near_.begin(), near_.end(), [](const Near& a, const Near& b) {
        return std::tie(a.cell, a.key->index) < std::tie(b.cell, b.key->index);
    });
}

void SubmapSelector::take_one_per_cell() {
    for (auto first = near_.begin(); first != near_.end();) {
        const auto last = std::find_if(first, near_.end(),
                                       [&first](const Near& n) { return n.cell != first->cell; });
        Vec3 sum = Vec3::Zero();
        for (auto n = first; n != last; ++n) sum += n->key->position;
        const Vec3 centroid = sum / static_cast<double>(last - first);
        const auto millimetres = [&centroid](const Near& n) {
            return std::round((n.key->position - centroid).norm() * 1e3);
        };
        const auto nearest =
            std::min_element(first, last, [&millimetres](const Near& a, const Near& b) {
                return millimetres(a) < millimetres(b);
            });
        chosen_.push_back(nearest->key->index);
        first = last;
    }
}

void SubmapSelector::take_recent(const std::vector<KeyPosition>& keys, const Vec3& centre,
                                 Stamp now) {
    for (auto key = keys.rbegin(); key != keys.rend(); ++key) {
        if (!(std::abs(seconds_between(now, key->stamp)) < options_.recent_s)) break;
        if (in_reach(key->position, centre)) chosen_.push_back(key->index);
    }
}

}  // namespace d2lio::liosam
