// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/host.hpp"

#include <algorithm>
#include <chrono>
#include <deque>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"
#include "ieskf.hpp"
#include "imu_processor.hpp"
#include "local_map.hpp"
#include "scan_matcher.hpp"

namespace d2lio::fastlio {
namespace {

constexpr double kPointVariance = 0.001;  ///< m^2, FAST-LIO2's LASER_POINT_COV
constexpr double kInitTime = 0.1;         ///< s, until then every point enters the map
constexpr std::size_t kMinPoints = 5;     ///< down-sampled points a scan needs
constexpr int kMaxFailures = 10;          ///< refused updates in a row before starting anew
constexpr double kGapPeriods = 3.0;       ///< IMU periods that are no gap yet

using Clock = std::chrono::steady_clock;

/// Milliseconds since the last call (or construction).
class StopWatch {
  public:
    double lap() {
        const auto now = Clock::now();
        const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
        last_ = now;
        return ms;
    }

  private:
    Clock::time_point last_ = Clock::now();
};

/// Hands one key to the adapter. @throws ConfigError where it refuses the value.
void set_adapter(Adapter& adapter, const ParamDoc& doc, const std::string& value) {
    if (!adapter.set(doc.key, value.c_str())) throw ConfigError(doc.key, value, doc.range);
}

/// Splits the parameters between host and adapter; unknown keys are refused with all known ones.
HostConfig configure(const ParamMap& params, int threads, Adapter& adapter) {
    HostConfig config;
    ParamTable table;
    config.bind(table);
    std::map<std::string, std::size_t> adapter_keys;
    std::string known;
    for (const ParamInfo& info : table.describe()) known += info.key + ", ";
    for (std::size_t i = 0; i < adapter.param_count(); ++i) {
        adapter_keys[adapter.param(i).key] = i;
        known += adapter.param(i).key + std::string(i + 1 < adapter.param_count() ? ", " : "");
    }
    for (const auto& [key, value] : params) {
        const auto it = adapter_keys.find(key);
        if (it != adapter_keys.end()) {
            set_adapter(adapter, adapter.param(it->second), value);
        } else if (table.has(key)) {
            table.set(key, value);
        } else {
            throw ConfigError(key, value, "known keys: " + known);
        }
    }
    config.threads = threads;
    if (config.live) {
        const SynchronizerOptions online = SynchronizerOptions::online();
        config.sync.max_scans = online.max_scans;
        config.sync.max_imu = online.max_imu;
    }
    config.validate();
    adapter.set_map_voxel(config.filter_size_map);
    if (!adapter.check()) throw ConfigError("parameters", "their combination", adapter.error());
    return config;
}

IeskfOptions filter_options(const HostConfig& c) {
    IeskfOptions o;
    o.max_iteration = c.max_iteration;
    o.variance = kPointVariance;
    o.exact_jacobians = c.exact_jacobians;
    return o;
}

std::string gap_message(const char* sensor, double seconds) {
    return std::string(sensor) + " gap of " + std::to_string(seconds) + " s";
}

void say(ScanResult& r, const std::string& text) {
    if (!text.empty()) r.message += (r.message.empty() ? "" : "; ") + text;
}

}  // namespace

class Host::Impl {
  public:
    Impl(const ParamMap& params, int threads)
        : config_(configure(params, threads, adapter_)),
          filter_(config_.filter, "preprocess."),
          sync_(config_.sync),
          imu_(config_),
          map_(config_),
          ieskf_(filter_options(config_)),
          matcher_(adapter_, config_.extrinsic_est, kPointVariance, config_.threads) {}

    PushStatus add_scan(Scan scan);
    std::optional<ScanResult> step();

    Adapter adapter_;
    HostConfig config_;
    PointFilter filter_;
    Synchronizer sync_;
    ImuProcessor imu_;
    LocalMap map_;
    Ieskf ieskf_;
    ScanMatcher matcher_;
    VoxelGrid voxel_grid_{static_cast<float>(config_.filter_size_surf)};
    FilterCounts filtered_;
    std::size_t resets_ = 0;
    NavState x_;
    Mat23x23 P_ = Mat23x23::Identity();

  private:
    struct Arrival {
        Stamp stamp;
        std::size_t points;
        double ms;
    };
    void recall_arrival(const MeasureGroup& group, ScanResult& r);
    void process(MeasureGroup& group, ScanResult& r);
    bool start_up(const MeasureGroup& group, ScanResult& r);
    void begin_epoch();
    std::string reset_reason(const MeasureGroup& group) const;
    double loosen(const MeasureGroup& group, ScanResult& r) const;
    void judge(UpdateStatus status, ScanResult& r);
    bool predict(MeasureGroup& group, ScanResult& r);
    void start_map(ScanResult& r);
    void update(const Pose& previous, ScanResult& r);
    void grow_map(const MeasureGroup& group, ScanResult& r);
    void finish(ScanResult& r) const;

    std::deque<Arrival> arrivals_;
    bool first_scan_ = true;
    int failures_ = 0;  ///< refused updates in a row
    Stamp first_begin_ = 0;
    std::vector<Eigen::Vector3f> cloud_, downsampled_;
    StopWatch watch_;
};

PushStatus Host::Impl::add_scan(Scan scan) {
    StopWatch watch;
    const std::size_t raw = scan.points.size();
    const Stamp stamp = scan.stamp;
    filtered_ += filter_.apply(scan.points);
    const PushStatus status = sync_.push_scan(std::move(scan));
    if (accepted(status)) arrivals_.push_back({stamp, raw, watch.lap()});
    while (arrivals_.size() > sync_.pending_scans()) arrivals_.pop_front();
    return status;
}

/// Finds what add_scan noted of this scan; scans dropped in between leave their notes behind.
void Host::Impl::recall_arrival(const MeasureGroup& group, ScanResult& r) {
    while (!arrivals_.empty()) {
        const Arrival a = arrivals_.front();
        arrivals_.pop_front();
        if (a.stamp != group.scan.stamp) continue;
        r.points_raw = a.points;
        r.times.preprocess = a.ms;
        return;
    }
}

void Host::Impl::begin_epoch() {
    first_scan_ = true;
    failures_ = 0;
    imu_.reset();
    map_.clear();
    adapter_.reset();
}

std::optional<ScanResult> Host::Impl::step() {
    std::optional<MeasureGroup> group = sync_.pop();
    if (!group) return std::nullopt;
    ScanResult r;
    r.stamp = group->end;
    r.imu_gap_s = group->imu_gap_s;
    r.lidar_gap_s = group->lidar_gap_s;
    r.points_valid = group->scan.points.size();
    recall_arrival(*group, r);
    StopWatch total;
    watch_.lap();
    process(*group, r);
    r.times.total = total.lap();
    finish(r);
    return r;
}

void Host::Impl::process(MeasureGroup& group, ScanResult& r) {
    if (start_up(group, r)) return;
    const Pose previous = x_.T_map_imu();
    if (!predict(group, r)) return;
    map_.follow(x_.T_map_lidar().t);
    voxel_grid_.filter(cloud_, downsampled_);
    r.points_downsampled = downsampled_.size();
    r.times.downsample = watch_.lap();
    r.has_pose = true;
    if (map_.empty()) {
        start_map(r);
        return;
    }
    if (downsampled_.size() < kMinPoints) {
        r.status = ScanStatus::kTooFewPoints;
        r.health = Health::kLost;
        return;
    }
    update(previous, r);
    if (r.status != ScanStatus::kNumericalFailure) grow_map(group, r);
}

/// Why the estimate cannot be carried over to this scan; empty if it can.
std::string Host::Impl::reset_reason(const MeasureGroup& group) const {
    if (group.new_epoch) return "stamps jumped back";
    if (!imu_.initialised()) return {};
    if (group.imu_gap_s > config_.imu_gap_reset) return gap_message("IMU", group.imu_gap_s);
    if (group.lidar_gap_s > config_.lidar_gap_reset) return gap_message("LiDAR", group.lidar_gap_s);
    if (failures_ >= kMaxFailures) return std::to_string(failures_) + " updates refused in a row";
    return {};
}

/// Scans before the filter runs: the first is dropped, the next ones initialise gravity and bias.
bool Host::Impl::start_up(const MeasureGroup& group, ScanResult& r) {
    const std::string reason = reset_reason(group);
    if (!reason.empty()) {
        begin_epoch();
        if (!group.new_epoch) ++resets_;
        r.new_epoch = true;
        say(r, reason + ": starting anew");
    }
    if (first_scan_) {
        first_scan_ = false;
        first_begin_ = group.begin;
        r.status = r.new_epoch ? ScanStatus::kReset : ScanStatus::kDropped;
        return true;
    }
    if (imu_.initialised()) return false;
    r.status =
        imu_.initialise(group.imu, x_, P_) ? ScanStatus::kInitialising : ScanStatus::kImuFault;
    say(r, imu_.note());
    return true;
}

/// Tells gaps; factor (>= 1) on the process noise, growing with the length of an IMU gap.
double Host::Impl::loosen(const MeasureGroup& group, ScanResult& r) const {
    const double bound = std::max(config_.sync.imu_gap_warn_s, kGapPeriods * imu_.mean_period());
    if (group.imu_gap_s > bound) say(r, gap_message("IMU", group.imu_gap_s));
    if (group.lidar_gap_s > config_.sync.lidar_gap_warn_s) {
        say(r, gap_message("LiDAR", group.lidar_gap_s));
    }
    return std::max(1.0, group.imu_gap_s / bound);
}

bool Host::Impl::predict(MeasureGroup& group, ScanResult& r) {
    const auto& knots = imu_.propagate(group, loosen(group, r), x_, P_);
    if (!x_.is_finite() || !P_.allFinite()) {
        begin_epoch();
        ++resets_;
        r.status = ScanStatus::kReset;
        r.new_epoch = true;
        say(r, "prediction is not finite: starting anew");
        return false;
    }
    deskew(group.scan.points, knots, x_.T_map_imu(), x_.T_imu_lidar());
    cloud_.clear();
    for (const LidarPoint& p : group.scan.points) cloud_.push_back(p.xyz());
    r.times.deskew = watch_.lap();
    return true;
}

void Host::Impl::start_map(ScanResult& r) {
    if (downsampled_.size() <= kMinPoints) {
        r.status = ScanStatus::kTooFewPoints;
        r.has_pose = false;
        return;
    }
    matcher_.begin(downsampled_, map_.tree());
    map_.build(matcher_.to_map(x_));
    r.status = ScanStatus::kMapInitialised;
    r.times.map = watch_.lap();
}

void Host::Impl::update(const Pose& previous, ScanResult& r) {
    const Pose predicted = x_.T_map_imu();
    const ScanInput input{{previous.R.data(), previous.t.data()},
                          {predicted.R.data(), predicted.t.data()},
                          P_.data(),
                          StateIndex::kSize,
                          StateIndex::kPos,
                          StateIndex::kRot,
                          downsampled_.size()};
    adapter_.begin_scan(input);
    matcher_.begin(downsampled_, map_.tree());
    const UpdateReport report =
        ieskf_.update(x_, P_, [this](const NavState& x, bool search, Linearisation& out) {
            return matcher_.measure(x, search, out);
        });
    const bool updated = report.status == UpdateStatus::kOk;
    const Status kept = adapter_.end_scan({x_.rot.data(), x_.pos.data()}, report.converged,
                                          updated ? P_.data() : nullptr, StateIndex::kSize);
    if (kept == Status::kSingular) say(r, "the covariance still claims the prior");
    r.diagnostics = adapter_.diagnostics();
    r.diagnostics.iterations = report.iterations;
    judge(report.status, r);
    r.times.search = matcher_.search_ms();
    r.times.update = watch_.lap() - r.times.search;
}

void Host::Impl::judge(UpdateStatus status, ScanResult& r) {
    failures_ = status == UpdateStatus::kNumericalFailure ? failures_ + 1 : 0;
    const bool weak = r.diagnostics.weak_r + r.diagnostics.weak_t > 0;
    switch (status) {
        case UpdateStatus::kOk:
            r.status = ScanStatus::kOk;
            r.health = weak ? Health::kDegenerate : Health::kOk;
            return;
        case UpdateStatus::kNoMeasurement:
            r.status = ScanStatus::kNoCorrespondence;
            break;
        case UpdateStatus::kNumericalFailure:
            r.status = ScanStatus::kNumericalFailure;
            break;
    }
    r.health = Health::kLost;
}

void Host::Impl::grow_map(const MeasureGroup& group, ScanResult& r) {
    static const std::vector<Neighbours> kNoNeighbours;
    const bool settled = seconds_between(group.begin, first_begin_) >= kInitTime;
    map_.insert(matcher_.to_map(x_), settled ? matcher_.neighbours() : kNoNeighbours);
    r.times.map = watch_.lap();
}

void Host::Impl::finish(ScanResult& r) const {
    r.map_points = map_.tree().size();
    if (!r.has_pose) return;
    r.state = x_;
    r.covariance = pose_covariance(x_, P_);
}

Host::Host(const ParamMap& params, int threads) : impl_(std::make_unique<Impl>(params, threads)) {}
Host::~Host() = default;
Host::Host(Host&&) noexcept = default;
Host& Host::operator=(Host&&) noexcept = default;

std::vector<ParamInfo> Host::describe() {
    HostConfig config;
    ParamTable table;
    config.bind(table);
    std::vector<ParamInfo> out = table.describe();
    const Adapter adapter;
    for (std::size_t i = 0; i < adapter.param_count(); ++i) {
        const ParamDoc d = adapter.param(i);
        out.push_back({d.key, d.type, d.default_value, d.range, d.unit, d.doc});
    }
    return out;
}

PushStatus Host::add_imu(const ImuSample& sample) { return impl_->sync_.push_imu(sample); }
PushStatus Host::add_scan(Scan scan) { return impl_->add_scan(std::move(scan)); }
void Host::finish() { impl_->sync_.finish(); }
std::optional<ScanResult> Host::step() { return impl_->step(); }
std::vector<Eigen::Vector3f> Host::map_points() const { return impl_->map_.tree().points(); }
HostCounts Host::counts() const {
    return {impl_->sync_.counts(), impl_->filtered_, impl_->resets_};
}
SyncReport Host::sync_report() const { return impl_->sync_.report(); }
std::size_t Host::map_bytes() const { return impl_->map_.tree().memory_bytes(); }
const Mat23x23& Host::covariance() const { return impl_->P_; }

}  // namespace d2lio::fastlio
