// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "d2lio/degeneracy/blind.hpp"

namespace d2lio {

/// Takes what noise may have put into the rows of one linearisation out of them; see cleaned_row().
///
/// `Rows` gives `size()`; `normal(k)`, map frame; `patch(k)`, null where there is none, as of a
/// line, which cannot prove anything: of its neighbours nothing is known but the line;
/// `trusted(k, normal, blind)`, see trust(); and `replace(k, cleaned, lost)`, called where
/// something changes, `lost` telling whether the normal does.
class RowCleaner {
  public:
    template <typename Rows>
    SurfaceSums sums(const Rows& rows) const {
        SurfaceSums out;
        for (std::size_t k = 0; k < rows.size(); ++k) {
            if (const Patch* patch = rows.patch(k)) out.add(rows.normal(k), *patch);
        }
        return out;
    }

    /// @returns how many rows lost something of their normal.
    template <typename Rows>
    int clean(const BlindDirections& blind, const NoiseAwareConfig& config, Rows& rows) {
        speaking_.clear();
        ProvenSum sum;
        int lost = 0;
        const ProofTest test(blind, config);
        for (std::size_t k = 0; k < rows.size(); ++k) {
            const Vec3 n = rows.normal(k);
            const Eigen::Vector3f single = n.cast<float>();
            const Patch* patch = test.may_pass(single) ? rows.patch(k) : nullptr;
            if (patch != nullptr && test.may_pass(single, *patch)) {
                const Vec3 share = proven_share(n, *patch, blind, config);
                sum.add(n, share, blind);
                speaking_.push_back({k, share});
                continue;
            }
            const Vec3 kept = without(n, blind);
            if (kept == n) continue;
            rows.replace(k, {kept, 1.0}, true);
            ++lost;
        }
        for (const Speaking& row : speaking_) {  // their weight hangs on how many they are
            const Vec3 n = rows.normal(row.index);
            const double trusted = rows.trusted(row.index, n, blind);
            const CleanedRow cleaned = cleaned_row(n, row.share, blind, sum, trusted);
            const bool loses = cleaned.normal != n;
            if (!loses && cleaned.weight == 1.0) continue;
            rows.replace(row.index, cleaned, loses);
            if (loses) ++lost;
        }
        return lost;
    }

  private:
    struct Speaking {
        std::size_t index;
        Vec3 share;  ///< of proven_share()
    };
    std::vector<Speaking> speaking_;
};

}  // namespace d2lio
