// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "d2lio/ros1/recorder.hpp"

#include <Eigen/Geometry>
#include <filesystem>
#include <system_error>

#include "d2lio/ros1/text.hpp"

namespace d2lio::ros1 {
namespace {

namespace fs = std::filesystem;

Eigen::Quaterniond canonical_quaternion(const Mat3& R) {
    Eigen::Quaterniond q(R);
    q.normalize();
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();
    return q;
}

template <typename Map>
std::string json_counts(const Map& map) {
    std::string out = "{";
    for (const auto& [key, value] : map) {
        out += (out.size() > 1 ? ", " : "") + json_text(key) + ": " + std::to_string(value);
    }
    return out + "}";
}

std::string json_texts(const std::map<std::string, std::string>& map) {
    std::string out = "{";
    for (const auto& [key, value] : map) {
        out += (out.size() > 1 ? ", " : "") + json_text(key) + ": " + json_text(value);
    }
    return out + "}";
}

std::string json_list(const std::vector<std::string>& texts) {
    std::string out = "[";
    for (const std::string& text : texts) out += (out.size() > 1 ? ", " : "") + json_text(text);
    return out + "]";
}

}  // namespace

std::string tum_line(const TimedPose& p) {
    std::string out = seconds_text(p.stamp);
    const bool finite = p.pose.R.allFinite() && p.pose.t.allFinite();
    const Eigen::Vector4d q =
        finite ? canonical_quaternion(p.pose.R).coeffs() : Eigen::Vector4d::Constant(kNaN).eval();
    for (int i = 0; i < 3; ++i) out += " " + shortest(p.pose.t[i]);
    for (int i = 0; i < 4; ++i) out += " " + shortest(q[i]);
    return out + "\n";
}

std::vector<std::pair<std::string, std::string>> diagnostics_row(const ScanResult& r) {
    std::vector<std::pair<std::string, std::string>> out{{"stamp_ns", std::to_string(r.stamp)},
                                                         {"status", to_string(r.status)},
                                                         {"health", to_string(r.health)}};
    for (const auto& [name, value] : r.columns()) out.emplace_back(name, figure(name, value));
    out.emplace_back("message", r.message);
    return out;
}

std::string replace_file(const std::string& path, const std::string& content) {
    const std::string partial = path + ".tmp";
    std::error_code error;
    const fs::path parent = fs::path(path).parent_path();
    if (!parent.empty()) fs::create_directories(parent, error);
    std::ofstream out(partial, std::ios::binary);
    out << content;
    out.close();
    if (!out) {
        fs::remove(partial, error);
        return path + " cannot be written";
    }
    fs::rename(partial, path, error);
    return error ? path + ": " + error.message() : std::string();
}

Recorder::Recorder(std::string folder) : folder_(std::move(folder)) {
    if (folder_.empty()) return;
    std::error_code error;
    fs::create_directories(folder_, error);
    // Of an earlier run; what this one writes must not mix with it.
    for (int i = 1; fs::remove(finished_name(i), error); ++i) {
    }
    diagnostics_.open(folder_ + "/diagnostics.csv");
    begin_trajectory();
    if (!diagnostics_ || !trajectory_) error_ = folder_ + " cannot be written";
}

std::string Recorder::finished_name(int epoch) const {
    return folder_ + "/trajectory." + std::to_string(epoch) + ".tum";
}

void Recorder::begin_trajectory() {
    if (!folder_.empty()) trajectory_.open(folder_ + "/trajectory.tum");
}

void Recorder::begin_epoch() {
    if (poses_.empty()) return;
    ++epochs_;
    poses_.clear();
    if (!trajectory_.is_open()) return;
    trajectory_.close();
    std::error_code error;
    fs::rename(folder_ + "/trajectory.tum", finished_name(epochs_), error);
    begin_trajectory();
}

void Recorder::add(const ScanResult& r) {
    if (!poses_.empty() && r.stamp <= poses_.back().stamp) begin_epoch();
    count(r);
    if (r.has_pose) {
        poses_.push_back({r.stamp, r.state.T_map_imu()});
        if (trajectory_.is_open()) trajectory_ << tum_line(poses_.back()) << std::flush;
    }
    if (!diagnostics_.is_open()) return;
    std::string names, values;
    for (const auto& [name, value] : diagnostics_row(r)) {
        names += (names.empty() ? "" : ",") + name;
        values += (values.empty() ? "" : ",") + csv_field(value);
    }
    if (!header_written_) diagnostics_ << names << '\n';
    header_written_ = true;
    diagnostics_ << values << std::endl;
}

void Recorder::count(const ScanResult& r) {
    ++results_;
    ++health_[to_string(r.health)];
    ++status_[to_string(r.status)];
    offered_ += r.diagnostics.counts.offered;
    accepted_ += r.diagnostics.counts.accepted;
    if (!r.has_pose) {
        ++without_pose_[to_string(r.status)];
        return;
    }
    if (!poses_.empty()) path_m_ += (r.state.pos - poses_.back().pose.t).norm();
    if (pose_count_++ == 0) first_stamp_ = r.stamp;
    last_stamp_ = r.stamp;
}

std::string Recorder::trajectory_text() const {
    std::string out;
    for (const TimedPose& pose : poses_) out += tum_line(pose);
    return out;
}

void Recorder::finish(const RunSummary& summary) {
    if (folder_.empty()) return;
    trajectory_.close();
    diagnostics_.close();
    if (!trajectory_ || !diagnostics_) error_ = folder_ + ": not everything could be written";
    const std::string error = replace_file(folder_ + "/run.json", run_json(summary));
    if (!error.empty()) error_ = error;
}

std::string Recorder::run_json(const RunSummary& s) const {
    std::map<std::string, std::size_t> dropped = s.dropped;
    for (const auto& [status, n] : without_pose_) dropped["no_pose_" + status] = n;
    std::size_t known = pose_count_;
    for (const auto& [reason, n] : dropped) known += n;
    if (s.scans_read > known) dropped["before_processing"] = s.scans_read - known;
    const bool failed = pose_count_ == 0;
    std::string out = "{\n";
    const auto add = [&out](const char* key, const std::string& value) {
        out += (out.size() > 2 ? ",\n  \"" : "  \"") + std::string(key) + "\": " + value;
    };
    add("status", json_text(failed ? "failed" : s.status));
    add("reason", json_text(failed ? "no scan gave a pose" : s.reason));
    add("version", json_text(s.version));
    add("command", json_list({"ros"}));
    add("sequence", json_text(s.name));
    add("host", json_text(s.host));
    add("params", json_texts(s.params));
    add("threads", std::to_string(s.threads));
    add("scans", "{\"read\": " + std::to_string(s.scans_read) + ", \"processed\": " +
                     std::to_string(pose_count_) + ", \"dropped\": " + json_counts(dropped) + "}");
    add("imu_read", std::to_string(s.imu_read));
    add("health", json_counts(health_));
    add("scan_status", json_counts(status_));
    add("host_counts", json_counts(s.host_counts));
    add("accepted_share", offered_ > 0.0 ? shortest(accepted_ / offered_) : "null");
    add("wall_s", shortest(s.wall_s));
    add("host_s", shortest(s.host_s));
    add("path_m", shortest(path_m_));
    add("duration_s", shortest(seconds_between(last_stamp_, first_stamp_)));
    add("notes", json_list(s.notes));
    return out + "\n}\n";
}

}  // namespace d2lio::ros1
