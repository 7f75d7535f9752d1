// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "d2lio/host/result.hpp"
#include "d2lio/types.hpp"

namespace d2lio::ros1 {

struct TimedPose {
    Stamp stamp = 0;
    Pose pose;  ///< T_map_imu
};

/// `t x y z qx qy qz qw`, as `d2lio run` writes it, with the line's end.
std::string tum_line(const TimedPose& pose);
/// Names and texts of a row of diagnostics.csv: stamp_ns, status, health, the columns, message.
std::vector<std::pair<std::string, std::string>> diagnostics_row(const ScanResult& result);
/// Writes a file in one go: it is the former one or whole. @return why not, empty if done
std::string replace_file(const std::string& path, const std::string& content);

/// What a node adds to run.json.
struct RunSummary {
    std::string version, name, host, status = "complete", reason;
    std::map<std::string, std::string> params;
    int threads = 1;
    std::size_t scans_read = 0, imu_read = 0;
    std::map<std::string, std::size_t> dropped;      ///< scans, by reason
    std::map<std::string, std::size_t> host_counts;  ///< of the estimator
    double wall_s = 0.0, host_s = 0.0;
    std::vector<std::string> notes;
};

/// The run's poses in memory and, where a folder is given, trajectory.tum, diagnostics.csv and
/// run.json in it, line by line, so that a killed node leaves them too. When stamps jump back, the
/// finished trajectory becomes trajectory.1.tum and so on; trajectory.tum is the running one.
class Recorder {
  public:
    /// @param folder made where missing; empty: nothing is written
    explicit Recorder(std::string folder);

    void add(const ScanResult& result);
    /// What follows is another trajectory.
    void begin_epoch();
    /// Closes the files and writes run.json.
    void finish(const RunSummary& summary);
    /// Why the folder cannot be written, empty if it can.
    const std::string& error() const { return error_; }
    const std::string& folder() const { return folder_; }
    /// Poses of the running epoch.
    const std::vector<TimedPose>& poses() const { return poses_; }
    std::string trajectory_text() const;

  private:
    void begin_trajectory();
    std::string finished_name(int epoch) const;
    void count(const ScanResult& result);
    std::string run_json(const RunSummary& summary) const;

    std::string folder_, error_;
    std::ofstream trajectory_, diagnostics_;
    bool header_written_ = false;
    int epochs_ = 0;  ///< finished ones
    std::vector<TimedPose> poses_;
    std::map<std::string, std::size_t> health_, status_, without_pose_;
    std::size_t pose_count_ = 0, results_ = 0;
    double offered_ = 0.0, accepted_ = 0.0, path_m_ = 0.0;
    Stamp first_stamp_ = 0, last_stamp_ = 0;
};

}  // namespace d2lio::ros1
