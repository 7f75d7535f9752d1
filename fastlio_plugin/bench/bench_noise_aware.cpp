// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <ctime>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/preprocess/voxel_grid.hpp"
#include "drive.hpp"
#include "ieskf.hpp"
#include "scan_matcher.hpp"

namespace d2lio::fastlio {
namespace {

using test::SyntheticRoom;

constexpr float kLeaf = 0.5F;  ///< m, of map and scan, as FAST-LIO2
constexpr double kVariance = 0.001;

/// A map of thirty scans from their true poses, and the scan after them.
struct Situation {
    IkdTree map{IkdTreeOptions{kLeaf}};
    std::vector<Eigen::Vector3f> scan;  ///< LiDAR frame at the scan's end
    NavState predicted;                 ///< 2 cm and 2 mrad from the truth
    Mat23x23 P = Mat23x23::Identity() * 1e-4;

    /// @param pipe radius of a round tunnel, m; 0: a room.
    explicit Situation(double pipe) {
        SyntheticRoom room(1, 0.02);
        room.columns = 1800;
        room.pipe = pipe;
        if (pipe > 0.0) room.half = {100.0, pipe, pipe};
        constexpr int kScans = 30;
        std::vector<Eigen::Vector3f> points;
        Stamp stamp = SyntheticRoom::kStart;
        for (int i = 0; i <= kScans; ++i, stamp += SyntheticRoom::kScanPeriod) {
            points.clear();
            for (const LidarPoint& p : room.scan(stamp).points) {
                const Pose T = pose_at(stamp + p.dt_ns) * SyntheticRoom::T_imu_lidar();
                points.push_back((T * p.xyz().cast<double>()).cast<float>());
            }
            if (i < kScans) map.insert(points, true);
        }
        const Pose end = pose_at(stamp);
        const Pose T = (end * SyntheticRoom::T_imu_lidar()).inverse();
        for (Eigen::Vector3f& p : points) p = (T * p.cast<double>()).cast<float>();
        VoxelGrid(kLeaf).filter(points, scan);
        predicted.pos = end.t + Vec3(0.02, -0.01, 0.01);
        predicted.rot = end.R * exp_so3(Vec3(1e-3, -1e-3, 2e-3));
        predicted.extrinsic_rot = SyntheticRoom::T_imu_lidar().R;
        predicted.extrinsic_pos = SyntheticRoom::T_imu_lidar().t;
    }

    static Pose pose_at(Stamp t) {
        return SyntheticRoom::pose(seconds_between(t, SyntheticRoom::kStart));
    }
};

/// FAST-LIO2's update of one scan by one method.
class Updater {
  public:
    Updater(const Situation& s, const char* method)
        : s_(s), matcher_(adapter_, false, kVariance, 1), ieskf_(options()) {
        adapter_.set("degeneracy.method", method);
        adapter_.set_map_voxel(static_cast<double>(kLeaf));
        if (adapter_.reads_surfaces()) uncertainty_.begin(s_.P);
    }

    /// @returns its CPU time, ms: on a busy machine the wall's would compare who waited when.
    double run() {
        const std::clock_t begin = std::clock();
        NavState x = s_.predicted;
        Mat23x23 P = s_.P;
        const Pose before = x.T_map_imu();
        const PoseView at{before.R.data(), before.t.data()};
        adapter_.begin_scan({at, at, P.data(), StateIndex::kSize, StateIndex::kPos,
                             StateIndex::kRot, s_.scan.size(), false});
        matcher_.begin(s_.scan, s_.map);
        const UpdateReport report =
            ieskf_.update(x, P, [this](const NavState& state, bool search, Linearisation& out) {
                return matcher_.measure(state, search, out);
            });
        const Pose after = x.T_map_imu();
        adapter_.end_scan({after.R.data(), after.t.data()}, report.converged, P.data(),
                          StateIndex::kSize);
        if (uncertainty_.begun()) {
            uncertainty_.update(x, ieskf_.match(P));
            uncertainty_.grow(x, 0.01);
        }
        iterations_ = report.iterations;
        return 1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    }
    int iterations() const { return iterations_; }
    const ScanDiagnostics& diagnostics() const { return adapter_.diagnostics(); }

  private:
    static IeskfOptions options() {
        IeskfOptions o;
        o.variance = kVariance;
        return o;
    }

    const Situation& s_;
    Adapter adapter_;
    ScanMatcher matcher_;
    Ieskf ieskf_;
    PoseUncertainty uncertainty_;
    int iterations_ = 0;
};

/// What method noise_aware adds to the update of one and the same scan, in turn with `none`.
void BM_NoiseAwareCost(benchmark::State& state) {
    const Situation situation(static_cast<double>(state.range(0)));
    Updater none(situation, "none"), ours(situation, "noise_aware");
    for (int i = 0; i < 50; ++i) ours.run();  // learns the velocity and the bends
    double off = 0.0, on = 0.0;
    for (auto _ : state) {
        off += none.run();
        on += ours.run();
    }
    const auto runs = static_cast<double>(state.iterations());
    state.counters["points"] = static_cast<double>(situation.scan.size());
    state.counters["off_ms"] = off / runs;
    state.counters["on_ms"] = on / runs;
    state.counters["off_iterations"] = none.iterations();
    state.counters["on_iterations"] = ours.iterations();
    state.counters["blind"] = ours.diagnostics().blind;
    state.counters["cleaned"] = ours.diagnostics().cleaned;
    state.counters["share_percent"] = 100.0 * (on - off) / off;
}
BENCHMARK(BM_NoiseAwareCost)
    ->ArgName("pipe")
    ->Arg(0)
    ->Arg(3)
    ->Unit(benchmark::kMillisecond)
    ->Iterations(300)
    ->Repetitions(5);

}  // namespace
}  // namespace d2lio::fastlio
