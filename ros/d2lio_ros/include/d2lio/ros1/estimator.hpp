// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "d2lio/host/configure.hpp"
#include "d2lio/host/intake.hpp"
#include "d2lio/host/result.hpp"

namespace d2lio::ros1 {

/// Points of the last scan as the estimator used them, with what became of each.
struct ScanPoints {
    std::vector<Eigen::Vector3f> points;  ///< de-skewed and down-sampled, map frame, m
    std::vector<Verdict> verdicts;        ///< one per point, or none
};

/// What a node needs of any host.
class Estimator {
  public:
    virtual ~Estimator() = default;
    virtual PushStatus add_imu(const ImuSample& sample) = 0;
    virtual PushStatus add_scan(Scan scan) = 0;
    virtual void finish() = 0;
    virtual std::optional<ScanResult> step() = 0;
    virtual std::vector<Eigen::Vector3f> map_points() const = 0;
    virtual HostCounts counts() const = 0;
    virtual SyncReport sync_report() const = 0;
    /// False where the host cannot change a parameter while it runs.
    virtual bool can_reconfigure() const = 0;
    /// Between scans; the estimate goes on. @throws ConfigError, nothing changed then.
    virtual void reconfigure(const ParamMap& params) = 0;
    /// Nothing where the host does not tell.
    virtual std::optional<ScanPoints> scan_points() const = 0;
};

/// An estimator that a node can be started with.
struct EstimatorKind {
    std::string name;  ///< fastlio, liosam, d2lio: as `d2lio run --host`
    std::vector<ParamInfo> params;
    /// @throws ConfigError
    std::function<std::unique_ptr<Estimator>(const ParamMap&, int threads)> make;
};

namespace detail {
template <typename Host, typename = void>
struct Reconfigures : std::false_type {};
template <typename Host>
struct Reconfigures<
    Host, std::void_t<decltype(std::declval<Host&>().reconfigure(std::declval<ParamMap>()))>>
    : std::true_type {};

template <typename Host, typename = void>
struct TellsPoints : std::false_type {};
template <typename Host>
struct TellsPoints<Host, std::void_t<decltype(std::declval<const Host&>().scan_points()),
                                     decltype(std::declval<const Host&>().verdicts())>>
    : std::true_type {};
}  // namespace detail

/// Any class with the hosts' functions as an Estimator.
template <typename Host>
class HostEstimator : public Estimator {
  public:
    explicit HostEstimator(Host host) : host_(std::move(host)) {}

    PushStatus add_imu(const ImuSample& sample) override { return host_.add_imu(sample); }
    PushStatus add_scan(Scan scan) override { return host_.add_scan(std::move(scan)); }
    void finish() override { host_.finish(); }
    std::optional<ScanResult> step() override { return host_.step(); }
    std::vector<Eigen::Vector3f> map_points() const override { return host_.map_points(); }
    HostCounts counts() const override { return host_.counts(); }
    SyncReport sync_report() const override { return host_.sync_report(); }

    bool can_reconfigure() const override { return detail::Reconfigures<Host>::value; }
    void reconfigure(const ParamMap& params) override {
        if constexpr (detail::Reconfigures<Host>::value) {
            host_.reconfigure(params);
        } else {
            (void)params;
        }
    }
    std::optional<ScanPoints> scan_points() const override {
        if constexpr (detail::TellsPoints<Host>::value) {
            return ScanPoints{host_.scan_points(), host_.verdicts()};
        } else {
            return std::nullopt;
        }
    }

  private:
    Host host_;
};

/// Scans that a host holds and has not answered yet.
inline std::size_t pending_scans(const HostCounts& counts) {
    const SyncCounts& c = counts.sync;
    return c.scans_accepted - c.scans_overflow - c.scans_cleared - c.scans_uncovered - c.groups;
}

}  // namespace d2lio::ros1
