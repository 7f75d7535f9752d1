// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "d2lio/map/ikd_tree.hpp"

namespace {

using d2lio::Box;
using d2lio::IkdTree;
using d2lio::Neighbours;
using Points = std::vector<Eigen::Vector3f>;

constexpr std::size_t kScan = 2000;  ///< points a down-sampled scan brings into the map

float side_of(std::size_t n) { return 0.25F * std::sqrt(static_cast<float>(n)); }

/// A street grid: ground and walls every tenth of the side, 16 points/m^2 of ground, 2 cm noise.
Points surface(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> u(0.F, 1.F);
    std::uniform_int_distribution<int> pick(0, 9);
    std::normal_distribution<float> noise(0.F, 0.02F);
    const float side = side_of(n);
    Points points(n);
    for (Eigen::Vector3f& p : points) {
        const int kind = pick(random);
        const float along = side * u(random), wall = 0.1F * side * static_cast<float>(pick(random));
        const float across = kind < 5 ? side * u(random) : wall,
                    up = kind < 5 ? 0.F : 8.F * u(random);
        p = {along, across, up};
        if (kind > 7) std::swap(p.x(), p.y());
        p += Eigen::Vector3f(noise(random), noise(random), noise(random));
    }
    return points;
}

std::size_t size_of(const benchmark::State& state) {
    return static_cast<std::size_t>(state.range(0));
}

void per_item(benchmark::State& state, std::size_t items) {
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(items));
}

void bm_build(benchmark::State& state) {
    const Points points = surface(size_of(state), 1);
    IkdTree tree;
    for (auto _ : state) benchmark::DoNotOptimize(tree.build(points));
    per_item(state, points.size());
    IkdTree fresh;
    fresh.build(points);
    state.counters["bytes_per_point"] =
        static_cast<double>(fresh.memory_bytes()) / static_cast<double>(fresh.size());
}

/// A scan at a time into a map that is itself down-sampled, as an odometry does.
void bm_insert_downsampled(benchmark::State& state) {
    IkdTree tree;
    tree.insert(surface(size_of(state), 1), true);
    const Points map = tree.points(), scans = surface(size_of(state), 2);
    std::size_t next = 0;
    for (auto _ : state) {
        state.PauseTiming();
        if (next + kScan > scans.size()) {
            tree.build(map);
            next = 0;
        }
        const auto first = scans.begin() + static_cast<std::ptrdiff_t>(next);
        const Points scan(first, first + kScan);
        next += kScan;
        state.ResumeTiming();
        benchmark::DoNotOptimize(tree.insert(scan, true));
    }
    per_item(state, kScan);
}

void bm_erase_box(benchmark::State& state) {
    const Points map = surface(size_of(state), 1);
    const float side = side_of(map.size());
    const Box strip{{-1.F, -1.F, -1.F}, {0.1F * side, side + 1.F, 9.F}};
    IkdTree tree;
    std::size_t removed = 0;
    for (auto _ : state) {
        state.PauseTiming();
        tree.build(map);
        state.ResumeTiming();
        removed = tree.erase_box(strip);
    }
    per_item(state, removed);
}

void bm_knn5(benchmark::State& state) {
    const Points map = surface(size_of(state), 1);
    const Points queries = surface(map.size(), 3);
    IkdTree tree;
    tree.build(map);
    Neighbours found;
    std::size_t next = 0;
    for (auto _ : state) {
        tree.knn(queries[next], 5, std::numeric_limits<float>::infinity(), found);
        benchmark::DoNotOptimize(found);
        next = next + 1 == queries.size() ? 0 : next + 1;
    }
    per_item(state, 1);
}

void sizes(benchmark::internal::Benchmark* bench) { bench->Arg(10000)->Arg(100000)->Arg(1000000); }

BENCHMARK(bm_build)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(bm_insert_downsampled)->Apply(sizes)->Unit(benchmark::kMicrosecond);
// Each needs a map of its own, whose building is not timed but takes its time.
BENCHMARK(bm_erase_box)->Apply(sizes)->Iterations(10)->Unit(benchmark::kMicrosecond);
BENCHMARK(bm_knn5)->Apply(sizes);

}  // namespace
