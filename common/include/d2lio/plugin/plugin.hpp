// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

/// What every adapter has in common. C++14, plain pointers only: an adapter and the upstream that
/// calls it may be built with different standards and Eigen alignments.
namespace d2lio {

struct ScanDiagnostics;
struct NoiseAwareConfig;
struct ScanError;
struct BlindDirections;
class SurfaceSums;

/// What became of one scan point; every value but kAccepted is a reason for rejection.
enum class Verdict : std::uint8_t {
    kAccepted,
    kFewNeighbours,
    kFarNeighbours,
    kThreshold,
    kSingularPlane,
    kPlaneFit,  ///< no plane (or line) passes near enough to the neighbours
    kResidual,
};

/// Rotation column-major, lengths in m.
struct PoseView {
    const double* rotation;  ///< 9 numbers
    const double* position;  ///< 3 numbers
};

enum class Status : std::uint8_t {
    kOk,
    kBadInput,  ///< NaN, infinity or a bad index: this scan runs on the host's own gates, no prior
    kNoScan,    ///< called outside begin_scan .. end_scan
    kSingular,  ///< a matrix could not be corrected and was left as it was
};

struct ParamDoc {
    const char *key, *type, *default_value, *range, *unit, *doc;
};

/// Parameters and diagnostics of an adapter. Nothing throws or exits but for lack of memory.
class Plugin {
  public:
    Plugin(const Plugin&) = delete;
    Plugin& operator=(const Plugin&) = delete;

    /// Sets one parameter before the first scan. False for an unknown key or a bad value: see
    /// error().
    bool set(const char* key, const char* value);
    /// Message of the last refused set(): key, value, allowed range. Empty if none.
    const char* error() const;
    std::size_t param_count() const;
    ParamDoc param(std::size_t i) const;  ///< null strings past the end
    /// Voxel size of the host's map (m, > 0), used where rejection.epsilon_0 is auto.
    bool set_map_voxel(double size);
    /// Whether the parameters fit together; if not, see error().
    bool check();

    /// True when a rejection mode other than off is set.
    bool rejects() const;
    /// True when the degeneracy method adds a prior or projects (paper, remap, tsvd, xicp).
    bool has_prior() const;
    /// True when the method counts the rows' contributions (xicp): without rows it does nothing.
    bool counts_rows() const;
    /// True when the method must see every correspondence, whatever the rejection mode
    /// (noise_aware).
    bool reads_surfaces() const;
    /// True when the host should hold the pose until the first motion (method noise_aware).
    bool starts_at_rest() const;
    /// Forgets everything learnt from scans; parameters stay.
    void reset();

    /// Diagnostics of the last ended scan, by column.
    std::size_t diagnostics_size() const;
    const char* diagnostics_name(std::size_t i) const;  ///< null past the end
    double diagnostics_value(std::size_t i) const;
    /// The same as a struct, for hosts built together with this library.
    const ScanDiagnostics& diagnostics() const;
    /// For hosts that keep the rows themselves, in a scan (method noise_aware): parameters, and
    /// what the sums over the rows say; `cleaned` rows go on record.
    const NoiseAwareConfig& noise_aware() const;
    BlindDirections find_blind(const SurfaceSums& sums);
    /// Of the scan being matched; nothing with another method.
    /// @param misfit mean square of its rows' residuals by the variance of a row.
    ScanError scan_error(double misfit) const;
    void note_cleaned(int rows);

  protected:
    struct Core;  ///< d2lio/plugin/core.hpp
    Plugin();
    ~Plugin();
    Core& core() { return *core_; }
    const Core& core() const { return *core_; }

  private:
    std::unique_ptr<Core> core_;
};

}  // namespace d2lio
