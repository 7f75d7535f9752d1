// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/liosam/host.hpp"

#include "correction.hpp"
#include "d2lio/preprocess/deskew.hpp"
#include "host_impl.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kStartScans = 5;    ///< processed whatever the mapping interval
constexpr int kMaxFailures = 10;  ///< refused matches in a row before starting anew

HostConfig load(Preset preset, const ParamMap& params, int threads, Adapter& adapter) {
    HostConfig config(preset);
    ParamTable table;
    config.bind(table);
    configure(adapter_defaults(preset), table, adapter);
    configure(params, table, adapter);
    config.threads = threads;
    config.validate();
    finish_configuration(adapter, config.map_leaf());
    return config;
}

}  // namespace

Host::Impl::Impl(Preset preset, const ParamMap& params, int threads)
    : params_(adapter_defaults(preset)),
      config_(load(preset, params, threads, adapter_)),
      intake_(config_.intake),
      predictor_(config_),
      features_(config_.projection, config_.feature_options(),
                static_cast<float>(config_.corner_leaf), static_cast<float>(config_.surface_leaf)),
      direct_(static_cast<float>(config_.direct_leaf)),
      matcher_(adapter_, config_.match_options(), config_.threads),
      map_(config_.submap_options()),
      imu_graph_(config_.imu),
      loops_(config_.loop, config_.threads) {
    for (const auto& [key, value] : params) params_[key] = value;
}

void Host::Impl::begin_epoch() {
    predictor_.reset();
    rest_corners_.clear();
    rest_surfaces_.clear();
    matcher_.reset();
    map_.clear();
    keyframes_.clear();
    imu_graph_.clear();
    loops_.reset();
    loop_correction_ = Pose{};
    adapter_.reset();
    last_processed_.reset();
    processed_ = 0;
    failures_ = 0;
    health_ = Health::kInit;
}

/// Begins an epoch, and counts it unless the data did so, which the intake counts.
void Host::Impl::start_anew(const std::string& why, ScanResult& r) {
    begin_epoch();
    if (!r.new_epoch) ++resets_;
    r.status = ScanStatus::kReset;
    r.new_epoch = true;
    say(r, why + ": starting anew");
}

std::optional<ScanResult> Host::Impl::step() {
    ScanResult r;
    std::optional<MeasureGroup> group = intake_.next(r);
    if (!group) return std::nullopt;
    StopWatch total;
    judged_ = false;
    watch_.lap();
    process(*group, r);
    r.times.total = total.lap();
    finish(r);
    return r;
}

void Host::Impl::process(MeasureGroup& group, ScanResult& r) {
    if (start_up(group, r)) return;
    if (adapter_.starts_at_rest()) predictor_.watch_rest(group.imu);
    if (!predict(group, r)) return;
    if (!due(group)) {
        r.status = ScanStatus::kSkipped;
        return;
    }
    last_processed_ = group.begin;
    ++processed_;
    prepare(group, r);
    if (map_.empty()) {
        start_map(group, r);
        return;
    }
    r.has_pose = true;
    const RestStart& rest = predictor_.rest();
    matcher_.set_resting(rest.held() || rest.watched());
    const Pose estimate = match(r);
    if (filters()) {
        fuse(estimate, r);
        collect_rest(group, r);
        if (predictor_.rest().held()) return;
    } else {
        correct(estimate, r);
    }
    if (r.status != ScanStatus::kNumericalFailure) grow_map(group, r);
}

/// Scans before the estimator runs. True if this one was of them.
bool Host::Impl::start_up(const MeasureGroup& group, ScanResult& r) {
    r.new_epoch = group.new_epoch;
    const std::string reason = failures_ >= kMaxFailures
                                   ? std::to_string(failures_) + " matches refused in a row"
                                   : intake_.reset_reason(group, predictor_.initialised());
    if (!reason.empty()) start_anew(reason, r);
    if (predictor_.initialised()) return false;
    const bool fine = predictor_.initialise(group.imu);
    r.status = !fine         ? ScanStatus::kImuFault
               : r.new_epoch ? ScanStatus::kReset
                             : ScanStatus::kInitialising;
    say(r, predictor_.note());
    return true;
}

bool Host::Impl::predict(const MeasureGroup& group, ScanResult& r) {
    predictor_.advance(group, intake_.loosen(group, predictor_.mean_period(), r));
    if (predictor_.is_finite()) return true;
    start_anew("prediction is not finite", r);
    return false;
}

/// LIO-SAM's mapping interval, counted between scan begins. The first scans are all processed: with
/// them the graph learns the speed of a vehicle that was moving already.
bool Host::Impl::due(const MeasureGroup& group) const {
    return !last_processed_ || processed_ < kStartScans ||
           seconds_between(group.begin, *last_processed_) >= config_.mapping_interval;
}

/// De-skews to the scan's end and runs the front end.
void Host::Impl::prepare(MeasureGroup& group, ScanResult& r) {
    const NavState& x = predictor_.state();
    std::vector<MotionKnot> knots = predictor_.knots();
    Pose end = x.T_map_imu();
    if (config_.deskew == Deskew::kRotation) {
        end.t.setZero();
        for (MotionKnot& k : knots) k.pos = k.vel = k.accel = Vec3::Zero();
    }
    const bool features = config_.front_end == FrontEnd::kFeatures;
    if (features) {
        say(r, features_.find_rings(group.scan.points));
        raw_ = group.scan.points;
    }
    deskew(group.scan.points, knots, end, x.T_imu_lidar());
    r.times.deskew = watch_.lap();
    if (features) {
        features_.run(raw_, group.scan.points, x.T_imu_lidar(), cloud_);
    } else {
        direct_.run(group.scan.points, x.T_imu_lidar(), cloud_);
    }
    r.points_downsampled = cloud_.corners.size() + cloud_.surfaces.size();
    r.times.downsample = watch_.lap();
}

bool Host::Impl::enough_features() const {
    const bool corners = config_.front_end == FrontEnd::kDirect ||
                         static_cast<int>(cloud_.corners.size()) > config_.min_corners;
    return corners && static_cast<int>(cloud_.surfaces.size()) > config_.min_surfaces;
}

void Host::Impl::start_map(const MeasureGroup& group, ScanResult& r) {
    if (cloud_.surfaces.empty()) {
        r.status = ScanStatus::kTooFewPoints;
        last_processed_.reset();
        return;
    }
    const NavState& x = predictor_.state();
    previous_ = x.T_map_imu();
    if (filters()) {
        predictor_.start_filter(adapter_.starts_at_rest());
        collect_rest(group, r);
        covariance_ = matched_covariance_ = start_covariance();
        r.has_pose = true;
        health_ = Health::kOk;
        r.status = ScanStatus::kMapInitialised;
        grow_map(group, r);
        return;
    }
    if (imu_graph_.start(previous_, x.vel, x.gyro_bias, x.accel_bias) != GraphStatus::kOk) {
        start_anew("the inertial graph cannot start from this state", r);
        return;
    }
    predictor_.correct(previous_, loop_correction_.R, imu_graph_.state(), true);
    covariance_ = matched_covariance_ = start_covariance();
    r.has_pose = true;
    health_ = Health::kOk;
    r.status = ScanStatus::kMapInitialised;
    grow_map(group, r);
}

void Host::Impl::finish(ScanResult& r) const {
    r.health = health_;
    r.map_points = map_.corners().size() + map_.surfaces().size();
    if (!r.has_pose) return;
    r.state = predictor_.state();
    r.covariance = predictor_.uncertainty().begun() ? predictor_.uncertainty().covariance(r.state)
                                                    : ros_order(previous_, covariance_);
}

/// Corners, then surfaces, as the adapter counts them.
std::vector<Eigen::Vector3f> Host::Impl::scan_points() const {
    std::vector<Eigen::Vector3f> out;
    if (!judged_) return out;
    for (const auto* part : {&cloud_.corners, &cloud_.surfaces}) {
        for (const Eigen::Vector3f& p : *part) {
            out.push_back((previous_ * p.cast<double>()).cast<float>());
        }
    }
    return out;
}

HostCounts Host::Impl::counts() const {
    const GraphCounts& g = imu_graph_.counts();
    return {intake_.sync_counts(),
            intake_.filter_counts(),
            resets_,
            {{"scans_degenerate", degenerate_},
             {"scans_lost", lost_},
             {"graph_events", graph_events_},
             {"graph_speed_resets", g.speed_resets},
             {"graph_bias_resets", g.bias_resets},
             {"graph_jump_resets", g.jump_resets},
             {"graph_solver_failures", g.solver_failures + g.non_finite_results},
             {"graph_bridged_intervals", g.bridged_intervals},
             {"loops", loops_closed_},
             {"keyframes", map_.size()}}};
}

Host::Host(Preset preset, const ParamMap& params, int threads)
    : impl_(std::make_unique<Impl>(preset, params, threads)) {}
Host::~Host() = default;
Host::Host(Host&&) noexcept = default;
Host& Host::operator=(Host&&) noexcept = default;

std::vector<ParamInfo> Host::describe(Preset preset) {
    HostConfig config(preset);
    ParamTable table;
    config.bind(table);
    std::vector<ParamInfo> out = d2lio::describe(table, Adapter());
    const ParamMap preset_values = adapter_defaults(preset);
    for (ParamInfo& info : out) {
        const auto it = preset_values.find(info.key);
        if (it != preset_values.end()) info.default_value = it->second;
    }
    return out;
}

PushStatus Host::add_imu(const ImuSample& sample) { return impl_->intake_.add_imu(sample); }
PushStatus Host::add_scan(Scan scan) { return impl_->intake_.add_scan(std::move(scan)); }
void Host::finish() { impl_->intake_.finish(); }
std::optional<ScanResult> Host::step() { return impl_->step(); }
HostCounts Host::counts() const { return impl_->counts(); }
SyncReport Host::sync_report() const { return impl_->intake_.report(); }
std::size_t Host::map_bytes() const { return impl_->map_.memory_bytes(); }

void Host::reconfigure(const ParamMap& changes) {
    const auto method = changes.find("degeneracy.method");
    const bool filters = impl_->adapter_.reads_surfaces();
    if (method != changes.end() && (method->second == "noise_aware") != filters) {
        throw ConfigError(method->first, method->second,
                          "no change to or from noise_aware while running");
    }
    Adapter scratch;
    d2lio::reconfigure(changes, scratch, impl_->adapter_, impl_->params_);
    if (!impl_->adapter_.starts_at_rest()) impl_->predictor_.end_rest();
}

std::vector<Eigen::Vector3f> Host::scan_points() const { return impl_->scan_points(); }

std::vector<Verdict> Host::verdicts() const {
    std::vector<Verdict> out;
    if (!impl_->judged_) return out;
    for (std::size_t i = 0; i < impl_->adapter_.verdict_count(); ++i) {
        out.push_back(impl_->adapter_.verdict(i));
    }
    return out;
}

std::vector<Eigen::Vector3f> Host::map_points() const {
    std::vector<Eigen::Vector3f> out = impl_->map_.corners().points();
    const std::vector<Eigen::Vector3f> surfaces = impl_->map_.surfaces().points();
    out.insert(out.end(), surfaces.begin(), surfaces.end());
    return out;
}

}  // namespace d2lio::liosam
