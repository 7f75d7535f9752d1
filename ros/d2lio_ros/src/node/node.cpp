// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/node.hpp"

namespace d2lio::ros1 {
namespace {

constexpr char kVersion[] = D2LIO_VERSION;
constexpr std::chrono::seconds kPatience{8};  // roslaunch waits 15 s from SIGINT to SIGTERM
constexpr std::chrono::seconds kRecent{3};    // complaints that the diagnostics still show
constexpr double kTick = 0.5;                 // s

RawMessage raw_message(const topic_tools::ShapeShifter& message) {
    RawMessage out{message.getDataType(), std::vector<std::uint8_t>(message.size())};
    ros::serialization::OStream stream(out.bytes.data(), message.size());
    message.write(stream);
    return out;
}

void log(const std::string& text) { ROS_WARN_STREAM(text); }

}  // namespace

Node::Node(Configuration& config, Recorder& recorder)
    : config_(config),
      recorder_(recorder),
      complaints_(log),
      worker_(config, recorder, complaints_),
      watch_(config.node.lidar_topic, config.node.imu_topic),
      private_("~"),
      services_("~"),
      outputs_(nh_, config, ros::this_node::getName()),
      spinner_(1),
      service_spinner_(1, &service_queue_) {
    services_.setCallbackQueue(&service_queue_);
}

Node::~Node() { stop(); }

void Node::start() {
    worker_.start([this](const auto& r, const auto& c) { on_result(r, c); },
                  [this] { return outputs_.wants_scans(); });
    servers_ = {services_.advertiseService("save_map", &Node::save_map, this),
                services_.advertiseService("save_trajectory", &Node::save_trajectory, this),
                services_.advertiseService("set_mode", &Node::set_mode, this),
                services_.advertiseService("reset", &Node::reset, this),
                services_.advertiseService("publish_map", &Node::publish_map, this)};
    timer_ = services_.createWallTimer(ros::WallDuration(kTick),
                                       [this](const ros::WallTimerEvent&) { on_timer(); });
    // The callbacks only queue, so nothing piles up in roscpp; what is too much our queue drops,
    // and counts.
    const auto hints = ros::TransportHints().tcpNoDelay();
    subscribers_ = {nh_.subscribe(config_.node.imu_topic, 0, &Node::on_imu, this, hints),
                    nh_.subscribe(config_.node.lidar_topic, 0, &Node::on_cloud, this, hints)};
    spinner_.start();
    service_spinner_.start();
}

void Node::stop() {
    if (stopped_) return;
    stopped_ = true;
    for (ros::Subscriber& s : subscribers_) s.shutdown();
    spinner_.stop();
    timer_.stop();
    for (ros::ServiceServer& s : servers_) s.shutdown();
    service_spinner_.stop();
    worker_.stop(kPatience);
    recorder_.finish(summary());
    if (recorder_.folder().empty()) return;
    const std::string error =
        replace_file(recorder_.folder() + "/map.pcd", to_pcd(worker_.map_points()));
    if (!error.empty() || !recorder_.error().empty()) {
        ROS_ERROR_STREAM("not everything was saved: " << error << " " << recorder_.error());
    } else {
        ROS_INFO_STREAM("saved to " << recorder_.folder());
    }
}

/// Nothing that a message brings may end the node.
template <typename F>
void Node::guarded(const F& f) {
    try {
        f();
    } catch (const std::exception& e) {
        complaints_.tell("exception", std::string("a message was given up: ") + e.what());
    }
}

void Node::on_imu(const Message::ConstPtr& message) {
    guarded([&] { take_imu(*message); });
}

void Node::on_cloud(const Message::ConstPtr& message) {
    guarded([&] { take_cloud(*message); });
}

void Node::on_timer() {
    guarded([this] { tell_input(); });
}

void Node::take_imu(const Message& message) {
    const Clock::time_point now = Clock::now();
    if (message.getDataType() != kImuType) {
        complaints_.tell("imu_type", config_.node.imu_topic + " carries " + message.getDataType() +
                                         ", not " + kImuType + ": nothing can be estimated");
        return;
    }
    ImuSample sample;
    if (!decode_imu(raw_message(message), config_.source.accel_scale(), config_.source.orientation,
                    sample)) {
        complaints_.tell("imu_message", "a message on " + config_.node.imu_topic + " is truncated");
        return;
    }
    watch_.imu(sample.stamp, now);
    worker_.queue().push(sample, now);
}

bool Node::right_lidar_type(const std::string& type) {
    const LidarType found = lidar_type_of(type), wanted = config_.node.lidar_type;
    if (found != LidarType::kAuto && (wanted == LidarType::kAuto || wanted == found)) return true;
    const std::string expected =
        wanted == LidarType::kAuto
            ? "a PointCloud2, a Livox CustomMsg or a VelodyneScan"
            : "what lidar_type " + lidar_type_names()[static_cast<std::size_t>(wanted)] + " says";
    complaints_.tell("lidar_type", config_.node.lidar_topic + " carries " + type + ", not " +
                                       expected + ": nothing can be estimated");
    return false;
}

void Node::take_cloud(const Message& message) {
    const Clock::time_point now = Clock::now();
    if (!right_lidar_type(message.getDataType())) return;
    QueuedScan scan{raw_message(message), 0, now};
    const std::optional<Stamp> stamp = scan.message.stamp();
    if (!stamp) {
        complaints_.tell("scan_message",
                         "a message on " + config_.node.lidar_topic + " is truncated");
        return;
    }
    scan.stamp = *stamp;
    watch_.scan(*stamp, now);
    worker_.queue().push(std::move(scan));
}

void Node::on_result(const ScanResult& result, const ResultContext& context) {
    outputs_.publish(result, context);
    if (outputs_.wants_points() && result.has_pose) {
        outputs_.publish_points(worker_.scan_points(), result.stamp);
    }
    if (outputs_.map_due()) outputs_.publish_map(worker_.map_points());
    if (!result.message.empty()) {
        const std::string kind = result.new_epoch ? "new_epoch" : to_string(result.status);
        complaints_.tell("scan_" + kind, result.message);
    }
}

void Node::tell_input() {
    const InputQueue::Counts q = worker_.queue().counts();
    const std::string silent = watch_.complaint(Clock::now());
    if (!silent.empty()) complaints_.tell("silent", silent);
    if (q.scans_dropped > dropped_) {
        const std::string why = silent.empty() ? "the estimator cannot keep up" : "no estimate";
        complaints_.tell("queue_full", why + ": " + std::to_string(q.scans_dropped) +
                                           " scans dropped so far (queue_scans " +
                                           std::to_string(config_.node.queue_scans) + ")");
    }
    dropped_ = q.scans_dropped;
    std::string message;
    for (const std::string& text : complaints_.recent(kRecent)) {
        message += (message.empty() ? "" : "; ") + text;
    }
    std::map<std::string, std::size_t> counts = worker_.counts();
    counts["scans_received"] = q.scans_received;
    counts["imu_received"] = q.imu_received;
    counts["scans_queue_full"] = q.scans_dropped;
    counts["queue"] = worker_.queue().waiting_scans();
    for (const auto& [kind, count] : complaints_.counts()) counts["complaints_" + kind] = count;
    using Status = diagnostic_msgs::DiagnosticStatus;
    const std::uint8_t level =
        silent.empty() ? message.empty() ? Status::OK : Status::WARN : Status::ERROR;
    outputs_.input_status(level, message.empty() ? "data flow" : message, counts);
}

RunSummary Node::summary() const {
    RunSummary s;
    s.version = kVersion;
    s.name = config_.source.name.empty() ? ros::this_node::getName() : config_.source.name;
    s.host = config_.kind->name;
    for (const ParamInfo& p : config_.kind->params) s.params[p.key] = p.default_value;
    for (const auto& [key, value] : worker_.params()) s.params[key] = value;
    s.threads = config_.node.threads;
    const auto counts = worker_.counts();
    const auto count = [&counts](const std::string& key) {
        const auto it = counts.find(key);
        return it == counts.end() ? std::size_t{0} : it->second;
    };
    s.scans_read = count("scans_received");
    s.imu_read = count("imu_received");
    for (const char* key : {"scans_bad_message", "scans_bad_times", "scans_empty",
                            "scans_queue_full", "scans_cut_off"}) {
        if (count(key) > 0) s.dropped[key] = count(key);
    }
    s.host_counts = counts;
    s.wall_s = std::chrono::duration<double>(Clock::now() - begin_).count();
    s.host_s = worker_.host_seconds();
    s.notes = complaints_.texts();
    if (!worker_.timing_message().empty()) s.notes.push_back(worker_.timing_message());
    return s;
}

}  // namespace d2lio::ros1
