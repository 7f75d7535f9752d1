// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/liosam/host.hpp"

#include <algorithm>

#include "config.hpp"
#include "correction.hpp"
#include "d2lio/host/stop_watch.hpp"
#include "d2lio/preprocess/deskew.hpp"
#include "front_end.hpp"
#include "keyframe_graph.hpp"
#include "predictor.hpp"

namespace d2lio::liosam {
namespace {

constexpr int kStartScans = 5;               ///< processed whatever the mapping interval
constexpr double kLeastLoopVariance = 1e-6;  ///< rad^2 and m^2
constexpr int kMaxFailures = 10;             ///< refused matches in a row before starting anew

HostConfig load(Preset preset, const ParamMap& params, int threads, Adapter& adapter) {
    HostConfig config(preset);
    ParamTable table;
    config.bind(table);
    configure(adapter_defaults(preset), table, adapter);
    configure(params, table, adapter);
    config.threads = threads;
    config.validate();
    finish_configuration(adapter, config.surface_leaf);
    return config;
}

}  // namespace

class Host::Impl {
  public:
    Impl(Preset preset, const ParamMap& params, int threads)
        : config_(load(preset, params, threads, adapter_)),
          intake_(config_.intake),
          predictor_(config_),
          features_(config_.projection, config_.feature_options(),
                    static_cast<float>(config_.corner_leaf),
                    static_cast<float>(config_.surface_leaf)),
          direct_(static_cast<float>(config_.direct_leaf)),
          matcher_(adapter_, config_.match_options(), config_.threads),
          map_(config_.submap_options()),
          imu_graph_(config_.imu),
          loops_(config_.loop, config_.threads) {}

    std::optional<ScanResult> step();
    HostCounts counts() const;

    Adapter adapter_;
    HostConfig config_;
    Intake intake_;
    Predictor predictor_;
    FeatureFrontEnd features_;
    DirectFrontEnd direct_;
    ScanToMap matcher_;
    KeyframeMap map_;
    KeyframeGraph keyframes_;
    ImuGraph imu_graph_;
    LoopCloser loops_;

  private:
    void process(MeasureGroup& group, ScanResult& r);
    bool start_up(const MeasureGroup& group, ScanResult& r);
    bool predict(const MeasureGroup& group, ScanResult& r);
    bool due(const MeasureGroup& group) const;
    void prepare(MeasureGroup& group, ScanResult& r);
    void start_map(const MeasureGroup& group, ScanResult& r);
    bool enough_features() const;
    Pose match(ScanResult& r);
    bool matched() const { return report_.status == MatchStatus::kOk; }
    void judge(const MatchReport& report, ScanResult& r);
    void correct(const Pose& estimate, ScanResult& r);
    void grow_map(const MeasureGroup& group, ScanResult& r);
    void close_loop(ScanResult& r);
    void begin_epoch();
    void start_anew(const std::string& why, ScanResult& r);
    void finish(ScanResult& r) const;

    MatchCloud cloud_;
    std::vector<LidarPoint> raw_;
    Pose previous_;         ///< last estimate, T_map_imu
    Pose loop_correction_;  ///< of all loops: T_map_odometry; the inertial graph lives in odometry
    std::optional<Stamp> last_processed_;
    MatchReport report_;
    int processed_ = 0;              ///< scans since the start
    int failures_ = 0;               ///< refused matches in a row
    Health health_ = Health::kInit;  ///< of the last scan that was not skipped
    std::size_t resets_ = 0, degenerate_ = 0, lost_ = 0, graph_events_ = 0, loops_closed_ = 0;
    Mat6 covariance_ = Mat6::Zero();  ///< of the last estimate: rotation (body), position (map)
    Mat6 matched_covariance_ = Mat6::Zero();  ///< of the last one that came from a match
    StopWatch watch_;
};

void Host::Impl::begin_epoch() {
    predictor_.reset();
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
    watch_.lap();
    process(*group, r);
    r.times.total = total.lap();
    finish(r);
    return r;
}

void Host::Impl::process(MeasureGroup& group, ScanResult& r) {
    if (start_up(group, r)) return;
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
    const Pose estimate = match(r);
    correct(estimate, r);
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

/// Scan-to-map estimate of the pose; the prediction where that cannot be had.
Pose Host::Impl::match(ScanResult& r) {
    map_.refresh(r.stamp);
    r.times.map = watch_.lap();
    const Pose predicted = predictor_.state().T_map_imu();
    const Mat6 P = predictor_.covariance();
    adapter_.begin_scan({{previous_.R.data(), previous_.t.data()},
                         {predicted.R.data(), predicted.t.data()},
                         P.data(),
                         cloud_.corners.size(),
                         cloud_.surfaces.size()});
    Pose estimate = predicted;
    report_ = MatchReport{};
    const bool enough = enough_features();
    if (enough) {
        report_ = matcher_.align({cloud_.corners, cloud_.surfaces, map_.corners(), map_.surfaces()},
                                 estimate);
    }
    if (matched()) {
        if (const std::optional<Mat3> world = predictor_.orientation()) {
            estimate.R = blend_tilt(estimate.R, *world, config_.rpy_weight);
        }
        covariance_ = pose_covariance(P, report_.information, config_.matching.variance);
        matched_covariance_ = covariance_;
    } else {
        estimate = predicted;
        covariance_ = matched_covariance_ + P;
    }
    adapter_.end_scan({estimate.R.data(), estimate.t.data()}, report_.converged);
    r.diagnostics = adapter_.diagnostics();
    r.diagnostics.iterations = report_.iterations;
    judge(report_, r);
    if (!enough) r.status = ScanStatus::kTooFewPoints;
    r.times.search = report_.search_ms;
    r.times.update = watch_.lap() - report_.search_ms;
    return estimate;
}

void Host::Impl::judge(const MatchReport& report, ScanResult& r) {
    failures_ = report.status == MatchStatus::kNumericalFailure ? failures_ + 1 : 0;
    switch (report.status) {
        case MatchStatus::kOk:
            r.status = ScanStatus::kOk;
            health_ = report.degenerate ? Health::kDegenerate : Health::kOk;
            degenerate_ += report.degenerate ? 1 : 0;
            return;
        case MatchStatus::kFewRows:
            r.status = ScanStatus::kNoCorrespondence;
            break;
        case MatchStatus::kNumericalFailure:
            r.status = ScanStatus::kNumericalFailure;
            break;
    }
    ++lost_;
    health_ = Health::kLost;
}

/// Hands the estimate to the inertial graph and takes back what it knows of velocity and biases.
void Host::Impl::correct(const Pose& estimate, ScanResult& r) {
    CorrectionNoise noise{config_.correction_rotation, config_.correction_translation,
                          config_.degenerate_rotation, config_.degenerate_translation};
    const bool own_remedy = !adapter_.has_prior();
    const Mat6 C = !matched()   ? lost_covariance(noise)
                   : own_remedy ? upstream_correction(noise, report_.remapped)
                                : weak_correction(noise, r.diagnostics);
    const GraphStatus status =
        imu_graph_.correct(loop_correction_.inverse() * estimate,
                           turn_position(loop_correction_.R.transpose(), C), predictor_.steps());
    if (status != GraphStatus::kOk) {
        ++graph_events_;
        say(r, status == GraphStatus::kReset ? "speed or bias out of bounds: inertial graph reset"
                                             : "inertial graph recovered");
    }
    predictor_.correct(estimate, loop_correction_.R, imu_graph_.state(), matched());
    previous_ = estimate;
}

void Host::Impl::grow_map(const MeasureGroup& group, ScanResult& r) {
    if (map_.due(previous_, group.end)) {
        map_.add(previous_, group.end, cloud_.corners, cloud_.surfaces);
        keyframes_.add(previous_);
        close_loop(r);
    }
    r.times.map += watch_.lap();
}

/// Where the newest keyframe closes a loop: all keyframes move, and the estimate with the newest,
/// which is matched thereby if it was not before.
void Host::Impl::close_loop(ScanResult& r) {
    const std::optional<Loop> loop = loops_.find(map_);
    if (!loop) return;
    const double variance = std::max(loop->fitness, kLeastLoopVariance);
    const GraphStatus status = keyframes_.add_loop(loop->from, loop->to, loop->T_from_to, variance);
    if (status != GraphStatus::kOk || !keyframes_.moved()) return;
    for (std::size_t i = 0; i < map_.size(); ++i) map_.set_pose(i, keyframes_.pose(i));
    const Pose moved = keyframes_.pose(loop->to) * previous_.inverse();
    loop_correction_ = moved * loop_correction_;
    previous_ = keyframes_.pose(loop->to);
    predictor_.correct(previous_, loop_correction_.R, imu_graph_.state(), true);
    matched_covariance_ = covariance_;
    ++loops_closed_;
    say(r, "loop closed with keyframe " + std::to_string(loop->from));
}

void Host::Impl::finish(ScanResult& r) const {
    r.health = health_;
    r.map_points = map_.corners().size() + map_.surfaces().size();
    if (!r.has_pose) return;
    r.state = predictor_.state();
    r.covariance = ros_order(previous_, covariance_);
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

std::vector<Eigen::Vector3f> Host::map_points() const {
    std::vector<Eigen::Vector3f> out = impl_->map_.corners().points();
    const std::vector<Eigen::Vector3f> surfaces = impl_->map_.surfaces().points();
    out.insert(out.end(), surfaces.begin(), surfaces.end());
    return out;
}

}  // namespace d2lio::liosam
