// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include "d2lio/fastlio/adapter.hpp"
#include "d2lio/fastlio/host.hpp"
#include "drive.hpp"

namespace d2lio::fastlio {
namespace {

using test::SyntheticRoom;

/// A VLP-16's worth of points per scan, generated once.
struct Recording {
    static constexpr int kScans = 40;
    std::vector<Scan> scans;
    std::vector<ImuSample> imu;

    Recording() {
        SyntheticRoom room;
        room.columns = 1800;
        for (int i = 0; i < kScans; ++i) {
            scans.push_back(room.scan(SyntheticRoom::kStart + i * SyntheticRoom::kScanPeriod));
        }
        const Stamp end = SyntheticRoom::kStart + (kScans + 1) * SyntheticRoom::kScanPeriod;
        for (Stamp t = SyntheticRoom::kStart; t < end; t += SyntheticRoom::kImuPeriod) {
            imu.push_back(room.imu(t));
        }
    }
};

const Recording& recording() {
    static const Recording r;
    return r;
}

Host fed_host(const ParamMap& params, int threads) {
    Host host(test::room_params(params), threads);
    for (const ImuSample& s : recording().imu) host.add_imu(s);
    return host;
}

/// Whole host per scan, with the time of every stage as a counter (ms).
void scan_time(benchmark::State& state, const ParamMap& params) {
    StageTimes sum;
    double scans = 0.0, points = 0.0;
    for (auto _ : state) {
        state.PauseTiming();
        Host host = fed_host(params, static_cast<int>(state.range(0)));
        state.ResumeTiming();
        for (const Scan& scan : recording().scans) {
            host.add_scan(scan);
            while (auto r = host.step()) {
                if (r->status != ScanStatus::kOk) continue;
                sum.preprocess += r->times.preprocess;
                sum.deskew += r->times.deskew;
                sum.downsample += r->times.downsample;
                sum.search += r->times.search;
                sum.update += r->times.update;
                sum.map += r->times.map;
                sum.total += r->times.total;
                points += static_cast<double>(r->points_downsampled);
                ++scans;
            }
        }
    }
    state.counters["preprocess_ms"] = sum.preprocess / scans;
    state.counters["deskew_ms"] = sum.deskew / scans;
    state.counters["downsample_ms"] = sum.downsample / scans;
    state.counters["search_ms"] = sum.search / scans;
    state.counters["update_ms"] = sum.update / scans;
    state.counters["map_ms"] = sum.map / scans;
    state.counters["total_ms"] = sum.total / scans;
    state.counters["points"] = points / scans;
}

void BM_ScanOff(benchmark::State& state) { scan_time(state, {}); }
BENCHMARK(BM_ScanOff)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

void BM_ScanPointAdaptivePaper(benchmark::State& state) {
    scan_time(state, {{"rejection.mode", "point_adaptive"}, {"degeneracy.method", "paper"}});
}
BENCHMARK(BM_ScanPointAdaptivePaper)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// What the plug-in itself costs: the same decisions with and without it, scan by scan in turn. The
/// threshold is out of reach and the prior weightless, so both hosts do the same work otherwise.
void BM_PluginCost(benchmark::State& state) {
    const ParamMap idle{{"rejection.mode", "point_adaptive"},
                        {"rejection.keep_host_gate", "true"},
                        {"rejection.epsilon_0", "1e6"},
                        {"degeneracy.method", "paper"},
                        {"degeneracy.w", "1e-12"}};
    double off = 0.0, on = 0.0;
    for (auto _ : state) {
        Host without = fed_host({}, 1), with = fed_host(idle, 1);
        for (const Scan& scan : recording().scans) {
            for (Host* host : {&without, &with}) {
                host->add_scan(scan);
                while (auto r = host->step()) {
                    (host == &with ? on : off) += r->times.search + r->times.update;
                }
            }
        }
    }
    state.counters["off_ms"] = off;
    state.counters["on_ms"] = on;
    state.counters["share_percent"] = 100.0 * (on - off) / off;
}
BENCHMARK(BM_PluginCost)->Unit(benchmark::kMillisecond)->Iterations(20)->Repetitions(5);

/// Analysis and prior rows of one iteration over 1 000 correspondences: what BM_PluginCost cannot
/// show, since the host analyses every scan for its diagnostics, with mode off too.
void BM_Condition(benchmark::State& state) {
    constexpr Eigen::Index kRows = 1000;
    test::Random random(1);
    Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor> H(kRows, 12);
    for (Eigen::Index i = 0; i < kRows; ++i) H.row(i) = random.vector(12, 1.0).transpose();
    Eigen::VectorXd r = Eigen::VectorXd::Zero(kRows);
    const Pose pose;
    const PoseView view{pose.R.data(), pose.t.data()};
    const Mat23x23 P = Mat23x23::Identity();
    Adapter adapter;
    adapter.set("degeneracy.method", "paper");
    adapter.begin_scan({view, view, P.data(), 23, 0, 3, 1, false});
    PriorBlock prior{};
    for (auto _ : state) {
        adapter.condition({H.data(), r.data(), kRows, 12, 1, 0, 3, 6}, view, 0.001, &prior);
        benchmark::DoNotOptimize(prior);
    }
}
BENCHMARK(BM_Condition)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace d2lio::fastlio
