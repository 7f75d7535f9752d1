// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
#include "config.hpp"

#include "d2lio/geometry/plane.hpp"

namespace d2lio::liosam {
namespace {

constexpr Range kLeaf{0.01, 100.0};
constexpr Range kSigma{1e-9, 1e6};
constexpr Range kNoise{1e-9, 1e3};

}  // namespace

HostConfig::HostConfig(Preset preset) {
    intake.filter.blind = 1.0;
    intake.filter.max_range = 1000.0;
    intake.init_samples = 20;
    if (preset == Preset::kLioSam) return;
    front_end = FrontEnd::kDirect;
    mapping_interval = 0.0;
    imu.max_speed = 100.0;  // cars on a motorway pass LIO-SAM's 30 m/s
    // The mixed-unit test would take a well-seen scan of 1500 voxel points for degenerate.
    matching.eigenvalue_threshold = 0.0;
}

ParamMap adapter_defaults(Preset preset) {
    if (preset == Preset::kLioSam) return {};
    return {{"rejection.mode", "point_adaptive"}, {"degeneracy.method", "noise_aware"}};
}

void HostConfig::bind(ParamTable& t) {
    intake.bind(t);
    t.add("front_end", front_end, {"features", "direct"}, "what is matched with the map");
    t.add("deskew", deskew, {"rotation", "full"}, "motion taken out of a scan");
    t.add("mappingProcessInterval", mapping_interval, {0.0, 10.0}, "s",
          "scans that come sooner after the last processed one get no pose");
    t.add("N_SCAN", projection.rings, {1, 1024}, "", "rings of the LiDAR, front end features");
    t.add("Horizon_SCAN", projection.columns, {16, 16384}, "", "columns of the range image");
    t.add("downsampleRate", projection.ring_step, {1, 64}, "", "every n-th ring is used");
    t.add("columnByOrder", projection.column_by_order,
          "columns count the points of a line (Livox) instead of azimuth");
    t.add("edgeThreshold", edge_threshold, {0.0, 1e6}, "", "least curvature of a corner");
    t.add("surfThreshold", surface_threshold, {0.0, 1e6}, "",
          "curvature below which a point is a surface");
    t.add("edgeFeatureMinValidNum", min_corners, {0, 100000}, "", "corners that matching needs");
    t.add("surfFeatureMinValidNum", min_surfaces, {1, 100000}, "", "surfaces that matching needs");
    t.add("odometrySurfLeafSize", odometry_leaf, kLeaf, "m", "voxel of a ring's surfaces");
    t.add("mappingCornerLeafSize", corner_leaf, kLeaf, "m", "voxel of corners, scan and map");
    t.add("mappingSurfLeafSize", surface_leaf, kLeaf, "m", "voxel of surfaces, scan and map");
    t.add("direct.leaf", direct_leaf, kLeaf, "m", "voxel of the scan, front end direct");
    t.add("direct.map_leaf", direct_map_leaf, kLeaf, "m", "voxel of the map, front end direct");
    t.add("direct.kernel_scale", kernel_scale, {1e-3, 100.0}, "m",
          "distance at which a point's weight is halved (Cauchy kernel), front end direct");
    t.add("mapping.max_iterations", matching.max_iterations, {1, 1000}, "",
          "Gauss-Newton iterations of a scan");
    t.add("mapping.eigenvalue_threshold", matching.eigenvalue_threshold, {0.0, 1e9}, "",
          "LIO-SAM's own solution remapping where degeneracy.method is none; 0 switches it off");
    t.add("mapping.variance", matching.variance, {1e-9, 1e3}, "m^2",
          "of a point-to-plane distance: turns a prior's information into rows");
    t.add("surroundingkeyframeAddingDistThreshold", submap.keyframe_distance, {0.0, 1e3}, "m",
          "a keyframe is added after this motion");
    t.add("surroundingkeyframeAddingAngleThreshold", submap.keyframe_angle, {0.0, 3.15}, "rad",
          "or after this rotation");
    t.add("map.keyframe_interval", submap.keyframe_interval_s, {0.0, 1e6}, "s",
          "or after this time; 0: never");
    t.add("surroundingKeyframeDensity", submap.density, {0.1, 1e3}, "m",
          "spacing of the keyframes in the submap");
    t.add("surroundingKeyframeSearchRadius", submap.search_radius, {1.0, 1e4}, "m",
          "radius of the submap");
    t.add("map.recent", submap.recent_s, {0.0, 1e4}, "s", "younger keyframes all enter the submap");
    t.add("map.max_clouds", max_clouds, {10, 1000000}, "",
          "keyframe clouds kept; beyond it the farthest are forgotten");
    t.add("imuAccNoise", imu.accel_noise, kNoise, "m/s^2/sqrt(Hz)", "accelerometer noise");
    t.add("imuGyrNoise", imu.gyro_noise, kNoise, "rad/s/sqrt(Hz)", "gyroscope noise");
    t.add("imuAccBiasN", imu.accel_bias_walk, kNoise, "m/s^3/sqrt(Hz)", "accelerometer bias walk");
    t.add("imuGyrBiasN", imu.gyro_bias_walk, kNoise, "rad/s^2/sqrt(Hz)", "gyroscope bias walk");
    t.add("imuGravity", imu.gravity, {9.0, 10.5}, "m/s^2", "length of gravity");
    t.add("imuRPYWeight", rpy_weight, {0.0, 1.0}, "",
          "share of a 9-axis IMU's roll and pitch in the estimate");
    t.add("imu.use_orientation", use_orientation,
          "use a 9-axis IMU's orientation where there is one");
    t.add("imu.prior_bias", imu.prior_bias_sigma, kSigma, "m/s^2, rad/s",
          "sigma of the biases at start");
    t.add("imu.correction_rotation", correction_rotation, kSigma, "rad",
          "sigma of a matched pose in the inertial graph");
    t.add("imu.correction_translation", correction_translation, kSigma, "m", "likewise");
    t.add("imu.degenerate_rotation", degenerate_rotation, kSigma, "rad",
          "sigma along directions that the scan leaves weak");
    t.add("imu.degenerate_translation", degenerate_translation, kSigma, "m", "likewise");
    t.add("imu.max_speed", imu.max_speed, {0.1, 1e4}, "m/s",
          "a faster estimate starts the graph anew");
    t.add("imu.max_bias", imu.max_bias, {1e-3, 1e3}, "m/s^2, rad/s", "so does a larger bias");
    bind_loop(t);
}

void HostConfig::bind_loop(ParamTable& t) {
    t.add("loopClosureEnableFlag", loop.enabled,
          "correct the keyframes where a place is seen again");
    t.add("historyKeyframeSearchRadius", loop.search_radius, {0.1, 1e4}, "m",
          "how near a keyframe must be to close a loop");
    t.add("historyKeyframeSearchTimeDiff", loop.min_time, {0.0, 1e6}, "s",
          "and how much older than the newest");
    t.add("historyKeyframeSearchNum", loop.neighbours, {0, 10000}, "",
          "keyframes on either side that are aligned with");
    t.add("historyKeyframeFitnessScore", loop.max_fitness, {0.0, 1e4}, "m^2",
          "largest mean squared distance of an accepted loop");
    t.add("loop.interval", loop.interval, {0.0, 1e6}, "s", "time between two attempts");
}

void HostConfig::validate() const {
    intake.validate();
    check_threads(threads);
}

FeatureOptions HostConfig::feature_options() const {
    FeatureOptions o;
    o.edge_threshold = static_cast<float>(edge_threshold);
    o.surface_threshold = static_cast<float>(surface_threshold);
    o.surface_leaf = static_cast<float>(odometry_leaf);
    return o;
}

SubmapOptions HostConfig::submap_options() const {
    SubmapOptions o = submap;
    o.corner_leaf = static_cast<float>(corner_leaf);
    o.surface_leaf = static_cast<float>(map_leaf());
    o.max_clouds = static_cast<std::size_t>(max_clouds);
    return o;
}

MatchOptions HostConfig::match_options() const {
    MatchOptions o = matching;
    o.map_leaf = map_leaf();
    if (front_end == FrontEnd::kFeatures) return o;
    o.kernel_scale = kernel_scale;
    o.min_spread_ratio = PlaneFitOptions{}.min_spread_ratio;
    return o;
}

}  // namespace d2lio::liosam
