// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "config.hpp"
#include "d2lio/host/configure.hpp"
#include "front_end.hpp"
#include "graph/imu_graph_sim.hpp"
#include "keyframe_graph.hpp"
#include "predictor.hpp"
#include "samples.hpp"
#include "street.hpp"

namespace d2lio::liosam {
namespace {

using bench::Samples;
using bench::Street;

constexpr double kSpacing = 1.1;         ///< m between keyframes
constexpr int kSubmap = 50;              ///< keyframes before the first one measured
constexpr int kRuns = 40;                ///< keyframes measured
constexpr Stamp kBetween = 100'000'000;  ///< ns between keyframes

HostConfig config_of(Preset preset) {
    HostConfig config(preset);
    if (config.front_end == FrontEnd::kDirect) config.matching.kernel_scale = config.kernel_scale;
    return config;
}

/// The preset's front end.
class Front {
  public:
    explicit Front(const HostConfig& c)
        : direct_(c.front_end == FrontEnd::kDirect),
          features_front_(c.projection, c.feature_options(), static_cast<float>(c.corner_leaf),
                          static_cast<float>(c.surface_leaf)),
          direct_front_(static_cast<float>(c.direct_leaf)) {}

    void run(const std::vector<LidarPoint>& points, MatchCloud& out) {
        if (direct_) {
            direct_front_.run(points, Street::T_imu_lidar(), out);
        } else {
            features_front_.run(points, points, Street::T_imu_lidar(), out);
        }
    }

  private:
    bool direct_;
    FeatureFrontEnd features_front_;
    DirectFrontEnd direct_front_;
};

/// What keyframes along the street leave of their scans, for one preset.
struct Keyframes {
    explicit Keyframes(Preset preset) : config(config_of(preset)) {
        Street street(8.0);
        Front front(config);
        for (int i = 0; i < kSubmap + kRuns; ++i) {
            clouds.emplace_back();
            front.run(street.snapshot(i * kSpacing).points, clouds.back());
        }
    }
    void add_to(KeyframeMap& map, int i) const {
        const MatchCloud& c = clouds[static_cast<std::size_t>(i)];
        map.add(Street::pose_at(i * kSpacing), Street::kStart + i * kBetween, c.corners,
                c.surfaces);
    }

    HostConfig config;
    std::vector<MatchCloud> clouds;
};

const Keyframes& keyframes(Preset preset) {
    static const Keyframes liosam(Preset::kLioSam), d2lio(Preset::kD2Lio);
    return preset == Preset::kLioSam ? liosam : d2lio;
}

/// Down-sampling included: range image, curvature and features, or voxels alone.
void front_end(benchmark::State& state, Preset preset) {
    const Scan scan = Street(8.0).snapshot(55.0);
    Front front(config_of(preset));
    MatchCloud cloud;
    for (auto _ : state) {
        front.run(scan.points, cloud);
        benchmark::DoNotOptimize(cloud);
    }
    state.counters["points"] = static_cast<double>(scan.points.size());
    state.counters["corners"] = static_cast<double>(cloud.corners.size());
    state.counters["surfaces"] = static_cast<double>(cloud.surfaces.size());
}
BENCHMARK_CAPTURE(front_end, features, Preset::kLioSam)
    ->Name("BM_FeatureFrontEnd")
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(front_end, direct, Preset::kD2Lio)
    ->Name("BM_DirectFrontEnd")
    ->Unit(benchmark::kMillisecond);

void BM_Projection(benchmark::State& state) {
    const Scan scan = Street(8.0).snapshot(55.0);
    Projection projection(config_of(Preset::kLioSam).projection);
    OrderedScan ordered;
    for (auto _ : state) {
        projection.project(scan.points, scan.points, ordered);
        benchmark::DoNotOptimize(ordered);
    }
}
BENCHMARK(BM_Projection)->Unit(benchmark::kMillisecond);

/// The submap's update after one more keyframe: choice, voxels, tree.
void submap_refresh(benchmark::State& state, Preset preset) {
    const Keyframes& keys = keyframes(preset);
    KeyframeMap map(keys.config.submap_options());
    int next = 0;
    for (; next < kSubmap; ++next) keys.add_to(map, next);
    map.refresh(Street::kStart + next * kBetween);
    Samples samples;
    for (auto _ : state) {
        keys.add_to(map, next++);
        samples.start();
        map.refresh(Street::kStart + next * kBetween);
        samples.stop(state);
    }
    samples.report(state);
    state.counters["keyframes"] = static_cast<double>(map.submap().size());
    state.counters["map_points"] =
        static_cast<double>(map.corners().size() + map.surfaces().size());
}
BENCHMARK_CAPTURE(submap_refresh, features, Preset::kLioSam)
    ->Name("BM_SubmapRefresh/liosam")
    ->UseManualTime()
    ->Iterations(kRuns)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(submap_refresh, direct, Preset::kD2Lio)
    ->Name("BM_SubmapRefresh/d2lio")
    ->UseManualTime()
    ->Iterations(kRuns)
    ->Unit(benchmark::kMillisecond);

/// Scan-to-map matching from a guess 10 cm and 0.6 deg off; counter per_iteration_ms.
void scan_to_map(benchmark::State& state, Preset preset, const ParamMap& params) {
    const Keyframes& keys = keyframes(preset);
    KeyframeMap map(keys.config.submap_options());
    for (int i = 0; i < kSubmap; ++i) keys.add_to(map, i);
    map.refresh(Street::kStart + kSubmap * kBetween);
    const MatchCloud& cloud = keys.clouds[kSubmap];
    const Pose truth = Street::pose_at(kSubmap * kSpacing);
    const Pose guess{truth.R * exp_so3(Vec3(0.003, -0.002, 0.01)),
                     truth.t + Vec3(0.08, -0.05, 0.02)};
    const Mat6 P = 1e-4 * Mat6::Identity();

    Adapter adapter;
    ParamTable none;
    configure(adapter_defaults(preset), none, adapter);
    configure(params, none, adapter);
    finish_configuration(adapter, keys.config.map_leaf());
    ScanToMap matcher(adapter, keys.config.matching, 1);
    const Pose previous = Street::pose_at((kSubmap - 1) * kSpacing);
    Samples samples;
    double search = 0.0, iterations = 0.0;
    Pose estimate;
    for (auto _ : state) {
        estimate = guess;
        samples.start();
        adapter.begin_scan({{previous.R.data(), previous.t.data()},
                            {guess.R.data(), guess.t.data()},
                            P.data(),
                            cloud.corners.size(),
                            cloud.surfaces.size()});
        const MatchReport report =
            matcher.align({cloud.corners, cloud.surfaces, map.corners(), map.surfaces()}, estimate);
        adapter.end_scan({estimate.R.data(), estimate.t.data()}, report.converged);
        samples.stop(state);
        search += report.search_ms;
        iterations += report.iterations;
        if (report.status != MatchStatus::kOk) state.SkipWithError("no match");
    }
    const auto runs = static_cast<double>(state.iterations());
    samples.report(state);
    state.counters["per_iteration_ms"] = samples.mean() * runs / iterations;
    state.counters["cpu_per_iteration_ms"] = samples.mean_cpu() * runs / iterations;
    state.counters["search_ms"] = search / runs;
    state.counters["gn_iterations"] = iterations / runs;
    state.counters["points_matched"] =
        static_cast<double>(cloud.corners.size() + cloud.surfaces.size());
    state.counters["error_m"] = (estimate.t - truth.t).norm();
}
const ParamMap kOff{{"rejection.mode", "off"}, {"degeneracy.method", "none"}};
BENCHMARK_CAPTURE(scan_to_map, liosam, Preset::kLioSam, {})
    ->Name("BM_ScanToMap/liosam")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scan_to_map, d2lio, Preset::kD2Lio, {})
    ->Name("BM_ScanToMap/d2lio")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(scan_to_map, d2lio_off, Preset::kD2Lio, kOff)
    ->Name("BM_ScanToMap/d2lio_off")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

/// What the adapter itself does in one iteration over 2 000 correspondences, without any search.
void BM_LioSamPlugin(benchmark::State& state) {
    constexpr std::size_t kPoints = 2000;
    Adapter adapter;
    ParamTable none;
    configure(adapter_defaults(Preset::kD2Lio), none, adapter);
    finish_configuration(adapter, 0.4);
    const Pose pose;
    const PoseView view{pose.R.data(), pose.t.data()};
    const Mat6 P = 1e-4 * Mat6::Identity();
    adapter.begin_scan({view, view, P.data(), 0, kPoints});
    const float sq_distances[] = {0.01F, 0.02F, 0.04F, 0.06F, 0.08F};
    Vec6 diagonal;
    diagonal << 4e5, 5e5, 6e5, 100.0, 900.0, 1000.0;
    for (auto _ : state) {
        double sum = 0.0;
        for (std::size_t i = 0; i < kPoints; ++i) {
            const double range = 1.0 + 0.02 * static_cast<double>(i);
            const float gate = adapter.gate({Feature::kSurface, i, range, sq_distances, 1, 5});
            if (gate < 1.0F) sum += adapter.weigh(Feature::kSurface, i, 0.9);
        }
        Mat6 AtA = diagonal.asDiagonal();
        Vec6 Atb = Vec6::Constant(sum);
        adapter.condition_tangent(view, 1e-3, {AtA.data(), Atb.data()});
        benchmark::DoNotOptimize(Atb);
    }
}
BENCHMARK(BM_LioSamPlugin)->Unit(benchmark::kMicrosecond);

/// One scan's correction with 20 inertial samples, over many shrinkings of the graph.
void BM_ImuGraphCorrect(benchmark::State& state) {
    constexpr int kSteps = 20;
    constexpr double kDt = 0.005;  // s
    const ImuGraphOptions options;
    test::ImuSim sim(1, options);
    ImuGraph graph(options);
    const Mat6 C = test::matcher_covariance();
    graph.start(sim.truth.pose, sim.truth.vel, Vec3::Zero(), Vec3::Zero());
    Samples samples;
    for (auto _ : state) {
        const std::vector<ImuStep> steps = sim.advance(kSteps, kDt);
        const Pose measured = sim.measure(C);
        samples.start();
        const GraphStatus status = graph.correct(measured, C, steps);
        samples.stop(state);
        if (status != GraphStatus::kOk) state.SkipWithError("the graph did not take the pose");
    }
    samples.report(state);
}
BENCHMARK(BM_ImuGraphCorrect)->UseManualTime()->Iterations(1000)->Unit(benchmark::kMillisecond);

/// The prediction over one scan of 20 inertial samples.
void BM_PredictorAdvance(benchmark::State& state) {
    const HostConfig config(Preset::kD2Lio);
    Predictor predictor(config);
    Street street(8.0);
    MeasureGroup group;
    Stamp now = Street::kStart;
    const auto collect = [&] {
        group.begin = now;
        group.end = now + Street::kScanPeriod;
        group.imu.clear();
        for (; now < group.end; now += Street::kImuPeriod) {
            group.imu.push_back(street.imu(now + Street::kImuPeriod));
        }
    };
    collect();
    if (!predictor.initialise(group.imu)) state.SkipWithError("no start");
    const GraphState graph;
    Samples samples;
    for (auto _ : state) {
        collect();
        samples.start();
        predictor.advance(group, 1.0);
        samples.stop(state);
        predictor.correct(predictor.state().T_map_imu(), Mat3::Identity(), graph, true);
    }
    samples.report(state);
}
BENCHMARK(BM_PredictorAdvance)->UseManualTime()->Unit(benchmark::kMicrosecond);

/// @param benchmark argument: keyframes already in the graph.
void BM_KeyframeGraphAdd(benchmark::State& state) {
    KeyframeGraph graph;
    int next = 0;
    while (next < state.range(0)) graph.add(Street::pose_at(kSpacing * next++));
    Samples samples;
    for (auto _ : state) {
        const Pose pose = Street::pose_at(kSpacing * next++);
        samples.start();
        graph.add(pose);
        samples.stop(state);
    }
    samples.report(state);
}
BENCHMARK(BM_KeyframeGraphAdd)
    ->Arg(50)
    ->Arg(2000)
    ->UseManualTime()
    ->Iterations(100)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace d2lio::liosam
