// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/fastlio/host.hpp"

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/host/pose_uncertainty.hpp"
#include "d2lio/host/rest_start.hpp"
#include "d2lio/host/stop_watch.hpp"
#include "d2lio/imu/hold.hpp"
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

HostConfig load(const ParamMap& params, int threads, Adapter& adapter) {
    HostConfig config;
    ParamTable table;
    config.bind(table);
    configure(params, table, adapter);
    config.threads = threads;
    config.validate();
    finish_configuration(adapter, config.filter_size_map);
    return config;
}

struct Prediction {
    NavState x;
    Mat23x23 P;
};

IeskfOptions filter_options(const HostConfig& c, bool noise_aware) {
    IeskfOptions o;
    o.max_iteration = c.max_iteration;
    o.variance = kPointVariance;
    o.exact_jacobians = c.exact_jacobians;
    o.searches_once = noise_aware;
    return o;
}

}  // namespace

class Host::Impl {
  public:
    Impl(const ParamMap& params, int threads)
        : params_(params),
          config_(load(params, threads, adapter_)),
          intake_(config_.intake),
          imu_(config_),
          map_(config_),
          ieskf_(filter_options(config_, adapter_.reads_surfaces())),
          matcher_(adapter_, config_.extrinsic_est, kPointVariance, config_.threads) {}

    std::optional<ScanResult> step();

    ParamMap params_;
    Adapter adapter_;
    HostConfig config_;
    Intake intake_;
    ImuProcessor imu_;
    LocalMap map_;
    Ieskf ieskf_;
    ScanMatcher matcher_;
    VoxelGrid voxel_grid_{static_cast<float>(config_.filter_size_surf)};
    RestStart rest_;
    std::size_t resets_ = 0;
    bool matched_ = false;                      ///< the last scan met the adapter
    std::vector<Eigen::Vector3f> downsampled_;  ///< LiDAR frame at scan end
    NavState x_;
    Mat23x23 P_ = Mat23x23::Identity();

  private:
    void process(MeasureGroup& group, ScanResult& r);
    bool start_up(const MeasureGroup& group, ScanResult& r);
    void begin_epoch();
    std::string reset_reason(const MeasureGroup& group) const;
    void judge(UpdateStatus status, ScanResult& r);
    bool predict(MeasureGroup& group, ScanResult& r);
    void start_map(ScanResult& r);
    bool update(const Pose& previous, ScanResult& r);
    void rest_on(const Prediction* before, bool updated, const ScanDiagnostics& scan);
    void collect_rest(ScanResult& r);
    void grow_map(const MeasureGroup& group, ScanResult& r);
    void finish(ScanResult& r) const;

    PoseUncertainty uncertainty_;
    RestCloud rest_cloud_;  ///< map frame
    bool first_scan_ = true;
    int failures_ = 0;  ///< refused updates in a row
    Stamp first_begin_ = 0;
    std::vector<Eigen::Vector3f> cloud_;
    StopWatch watch_;
};

void Host::Impl::begin_epoch() {
    first_scan_ = true;
    failures_ = 0;
    imu_.reset();
    map_.clear();
    adapter_.reset();
    rest_.reset();
    rest_cloud_.clear();
    uncertainty_.clear();
}

std::optional<ScanResult> Host::Impl::step() {
    ScanResult r;
    std::optional<MeasureGroup> group = intake_.next(r);
    if (!group) return std::nullopt;
    StopWatch total;
    matched_ = false;
    watch_.lap();
    process(*group, r);
    r.times.total = total.lap();
    finish(r);
    return r;
}

void Host::Impl::process(MeasureGroup& group, ScanResult& r) {
    if (start_up(group, r)) return;
    const Pose previous = x_.T_map_imu();
    if (adapter_.starts_at_rest()) rest_.watch(group.imu);
    if (!predict(group, r)) return;
    rest_.record(imu_.steps());
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
    if (update(previous, r)) return;
    if (!rest_.watched()) rest_cloud_.clear();
    if (r.status != ScanStatus::kNumericalFailure) grow_map(group, r);
}

/// Why the estimate cannot be carried over to this scan; empty if it can.
std::string Host::Impl::reset_reason(const MeasureGroup& group) const {
    if (failures_ >= kMaxFailures) return std::to_string(failures_) + " updates refused in a row";
    return intake_.reset_reason(group, imu_.initialised());
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

bool Host::Impl::predict(MeasureGroup& group, ScanResult& r) {
    const NavState before = x_;
    const double noise_scale = intake_.loosen(group, imu_.mean_period(), r);
    if (!adapter_.reads_surfaces()) {
        uncertainty_.clear();
    } else if (!map_.empty() && !uncertainty_.begun()) {
        uncertainty_.take(P_);
    }
    const auto& knots = imu_.propagate(group, noise_scale, x_, P_);
    if (!x_.is_finite() || !P_.allFinite()) {
        begin_epoch();
        ++resets_;
        r.status = ScanStatus::kReset;
        r.new_epoch = true;
        say(r, "prediction is not finite: starting anew");
        return false;
    }
    if (uncertainty_.begun()) {
        uncertainty_.predict(before, x_, imu_.steps(), noise_scale * imu_.integrated_noise());
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
    const std::vector<Eigen::Vector3f>& points = matcher_.to_map(x_);
    map_.build(points);
    if (adapter_.reads_surfaces()) uncertainty_.begin(P_);
    if (adapter_.starts_at_rest()) {
        rest_.begin(x_, P_);
        rest_cloud_.add(points);
    }
    r.status = ScanStatus::kMapInitialised;
    r.times.map = watch_.lap();
}

/// @returns whether the pose was held: then the map has been seen to.
bool Host::Impl::update(const Pose& previous, ScanResult& r) {
    const Pose predicted = x_.T_map_imu();
    const ScanInput input{{previous.R.data(), previous.t.data()},
                          {predicted.R.data(), predicted.t.data()},
                          P_.data(),
                          StateIndex::kSize,
                          StateIndex::kPos,
                          StateIndex::kRot,
                          downsampled_.size(),
                          rest_.held()};
    std::optional<Prediction> before;
    if (rest_.held()) before = Prediction{x_, P_};
    adapter_.begin_scan(input);
    matched_ = true;
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
    if (updated && uncertainty_.begun()) uncertainty_.update(x_, ieskf_.match(P_));
    rest_on(before ? &*before : nullptr, updated, r.diagnostics);
    if (rest_.held() && uncertainty_.begun()) uncertainty_.begin(P_);
    r.times.search = matcher_.search_ms();
    r.times.update = watch_.lap() - r.times.search;
    if (rest_.watched() || rest_.held()) collect_rest(r);
    return rest_.held();
}

/// At rest the pose is that of the start and the velocity zero, which teaches the filter its biases
/// and gravity; what the scan would say of the pose is only the noise of its match.
/// @param before the prediction, where the pose was held until now.
void Host::Impl::rest_on(const Prediction* before, bool updated, const ScanDiagnostics& scan) {
    switch (updated ? rest_.judge(x_.T_map_imu(), scan) : RestStart::Event::kNothing) {
        case RestStart::Event::kConfirmed:
            rest_.replay(imu_.accel_scale(), config_.exact_jacobians, x_, P_);
            break;
        case RestStart::Event::kContradicted:
            reopen(P_);
            if (uncertainty_.begun()) uncertainty_.take(P_);
            return;
        case RestStart::Event::kNothing:
            if (!rest_.held()) return;
            x_ = before->x;
            P_ = before->P;
            hold_still(rest_.pose(), x_, P_);
    }
    imu_.expect(*rest_.noise(imu_.accel_scale()));
}

/// The map at rest is the mean of its scans, all taken at one pose.
void Host::Impl::collect_rest(ScanResult& r) {
    NavState at_rest = x_;
    at_rest.pos = rest_.pose().t;
    at_rest.rot = rest_.pose().R;
    rest_cloud_.add(matcher_.to_map(at_rest));
    if (!rest_.held() || !rest_cloud_.grown()) return;
    map_.clear();
    map_.build(rest_cloud_.mean(config_.filter_size_map));
    r.times.map = watch_.lap();
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
    static const std::vector<Nearest> kNoNeighbours;
    const bool settled = seconds_between(group.begin, first_begin_) >= kInitTime;
    const auto fill =
        r.diagnostics.blind > 0 ? LocalMap::Fill::kEmpty : LocalMap::Fill::kNearestToCentre;
    const std::size_t added =
        map_.insert(matcher_.to_map(x_), settled ? matcher_.neighbours() : kNoNeighbours, fill);
    if (uncertainty_.begun()) {
        uncertainty_.grow(x_,
                          static_cast<double>(added) / static_cast<double>(downsampled_.size()));
    }
    r.times.map = watch_.lap();
}

void Host::Impl::finish(ScanResult& r) const {
    r.map_points = map_.tree().size();
    if (!r.has_pose) return;
    r.state = x_;
    r.covariance = uncertainty_.begun() ? uncertainty_.covariance(x_) : pose_covariance(x_, P_);
}

Mat6 pose_covariance(const NavState& x, const Mat23x23& P) {
    // Both blocks are contiguous (position 0-2, rotation 3-5); the body tangent turns into the map.
    Mat6 J = Mat6::Identity();
    J.bottomRightCorner<3, 3>() = x.rot;
    return J * P.topLeftCorner<6, 6>() * J.transpose();
}

Host::Host(const ParamMap& params, int threads) : impl_(std::make_unique<Impl>(params, threads)) {}
Host::~Host() = default;
Host::Host(Host&&) noexcept = default;
Host& Host::operator=(Host&&) noexcept = default;

std::vector<ParamInfo> Host::describe() {
    HostConfig config;
    ParamTable table;
    config.bind(table);
    return d2lio::describe(table, Adapter());
}

PushStatus Host::add_imu(const ImuSample& sample) { return impl_->intake_.add_imu(sample); }
PushStatus Host::add_scan(Scan scan) { return impl_->intake_.add_scan(std::move(scan)); }
void Host::finish() { impl_->intake_.finish(); }
std::optional<ScanResult> Host::step() { return impl_->step(); }
void Host::reconfigure(const ParamMap& changes) {
    Adapter scratch;
    d2lio::reconfigure(changes, scratch, impl_->adapter_, impl_->params_);
    if (!impl_->map_.empty()) impl_->rest_.end();  // what began meanwhile was not watched
}

std::vector<Eigen::Vector3f> Host::scan_points() const {
    std::vector<Eigen::Vector3f> out;
    if (!impl_->matched_) return out;
    const Pose T = impl_->x_.T_map_lidar();
    for (const Eigen::Vector3f& p : impl_->downsampled_) {
        out.push_back((T * p.cast<double>()).cast<float>());
    }
    return out;
}

std::vector<Verdict> Host::verdicts() const {
    std::vector<Verdict> out;
    if (!impl_->matched_) return out;
    for (std::size_t i = 0; i < impl_->adapter_.verdict_count(); ++i) {
        out.push_back(impl_->adapter_.verdict(i));
    }
    return out;
}

std::vector<Eigen::Vector3f> Host::map_points() const { return impl_->map_.tree().points(); }
HostCounts Host::counts() const {
    return {impl_->intake_.sync_counts(), impl_->intake_.filter_counts(), impl_->resets_, {}};
}
SyncReport Host::sync_report() const { return impl_->intake_.report(); }
std::size_t Host::map_bytes() const { return impl_->map_.tree().memory_bytes(); }
const Mat23x23& Host::covariance() const { return impl_->P_; }

}  // namespace d2lio::fastlio
