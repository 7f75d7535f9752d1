// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
//
// A small LiDAR-inertial odometry with the names that the hooks of FAST_LIO look for.
#include <omp.h>
#include <ros/ros.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "filter.h"
#include "preprocess.h"
#include "standin/node.h"
#include "standin/room.h"

using standin::Point;
using standin::Points;

constexpr double LASER_POINT_COV = 0.001;  // m^2
constexpr int kNeighbours = 5;
constexpr float kMaxSqDistance = 5.F;   // m^2
constexpr double kPlaneDistance = 0.1;  // m
constexpr double kLeaf = 0.3;           // m
constexpr float kRadius = 1.F;          // m, of the search

void h_share_model(standin::State& s, standin::Measurement& ekfom_data);

/// Moves the filter on by what the odometry says.
struct ImuProcess {
    standin::Noise noise{11};
    void Process(double from, double to, standin::Filter& filter) {
        const standin::Pose step = standin::odometry(from, to, noise);
        filter.predict(step.R, step.t, 1e-4, 1e-5);
    }
};

struct Odometry {
    struct {
        std::array<double, 36> covariance{};
    } pose;
};

standin::Filter kf(h_share_model);
standin::GridMap<Point> ikdtree(kLeaf, kRadius);
std::vector<Eigen::Vector3d> feats_down_body;
int feats_down_size = 0;
double lidar_end_time = 0.0, solve_time = 0.0, filter_size_map_min = kLeaf;
std::vector<double> extrinR;
std::vector<Points> Nearest_Points;
std::vector<char> point_selected_surf;
std::vector<double> res_last;
auto normvec = std::make_shared<standin::Cloud>();
Odometry odomAftMapped;
std::shared_ptr<ImuProcess> p_imu(new ImuProcess);

Point to_map(const standin::State& s, const Eigen::Vector3d& p_body) {
    const Eigen::Vector3d p = s.rot * (s.offset_R_L_I * p_body + s.offset_T_L_I) + s.pos;
    Point out;
    out.x = static_cast<float>(p.x());
    out.y = static_cast<float>(p.y());
    out.z = static_cast<float>(p.z());
    return out;
}

bool fit(const Points& near, Eigen::Vector3d& normal, double& offset) {
    std::array<Eigen::Vector3d, kNeighbours> points;
    for (int j = 0; j < kNeighbours; ++j) points[j] << near[j].x, near[j].y, near[j].z;
    return standin::fit_plane(points, normal, offset) <= kPlaneDistance;
}

/// A row per point: normal; lever arm times normal. The extrinsic is not estimated.
void fill_rows(const standin::State& s, const std::vector<int>& chosen,
               standin::Measurement& ekfom_data) {
    const auto count = static_cast<Eigen::Index>(chosen.size());
    ekfom_data.h_x.setZero(count, standin::kStateSize);
    ekfom_data.h.resize(count);
    for (Eigen::Index r = 0; r < count; ++r) {
        const int i = chosen[static_cast<std::size_t>(r)];
        const Point& plane = normvec->points[i];
        const Eigen::Vector3d n(plane.x, plane.y, plane.z);
        const Eigen::Vector3d arm = s.offset_R_L_I * feats_down_body[i] + s.offset_T_L_I;
        ekfom_data.h_x.block<1, 3>(r, 0) = n.transpose();
        ekfom_data.h_x.block<1, 3>(r, 3) = arm.cross(s.rot.conjugate() * n).transpose();
        ekfom_data.h(r) = -static_cast<double>(plane.intensity);
    }
}

void h_share_model(standin::State& s, standin::Measurement& ekfom_data) {
#pragma omp parallel for
    for (int i = 0; i < feats_down_size; i++) {
        const Eigen::Vector3d& p_body = feats_down_body[i];
        const Point point_world = to_map(s, p_body);
        Points& points_near = Nearest_Points[i];
        std::vector<float> pointSearchSqDis;
        if (ekfom_data.converge) {
            ikdtree.search(point_world, kNeighbours, points_near, pointSearchSqDis);
            point_selected_surf[i] = points_near.size() == kNeighbours &&
                                     pointSearchSqDis[kNeighbours - 1] <= kMaxSqDistance;
        }
        if (!point_selected_surf[i]) continue;
        point_selected_surf[i] = 0;
        Eigen::Vector3d n;
        double offset;
        if (!fit(points_near, n, offset)) continue;
        const double pd2 =
            n.x() * point_world.x + n.y() * point_world.y + n.z() * point_world.z + offset;
        if (1.0 - 0.9 * std::abs(pd2) / std::sqrt(p_body.norm()) <= 0.9) continue;
        point_selected_surf[i] = 1;
        normvec->points[i].x = static_cast<float>(n.x());
        normvec->points[i].y = static_cast<float>(n.y());
        normvec->points[i].z = static_cast<float>(n.z());
        normvec->points[i].intensity = static_cast<float>(pd2);
        res_last[i] = std::abs(pd2);
    }
    std::vector<int> chosen;
    for (int i = 0; i < feats_down_size; i++) {
        if (point_selected_surf[i]) chosen.push_back(i);
    }
    ekfom_data.valid = !chosen.empty();
    if (!ekfom_data.valid) return;
    const double begin = omp_get_wtime();
    fill_rows(s, chosen, ekfom_data);
    solve_time += omp_get_wtime() - begin;
}

void set_posestamp(Odometry& out) { out.pose.covariance.fill(0.0); }

/// Stamp, position, quaternion, first and last entry of the covariance.
void publish_odometry() {
    set_posestamp(odomAftMapped);
    const standin::State x = kf.get_x();
    const auto& c = odomAftMapped.pose.covariance;
    std::printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", lidar_end_time,
                x.pos.x(), x.pos.y(), x.pos.z(), x.rot.x(), x.rot.y(), x.rot.z(), x.rot.w(),
                c.front(), c.back());
}

class LaserMapping {
  public:
    LaserMapping(int argc, char** argv) : nh(argc, argv) {
        nh.param("mapping/extrinsic_R", extrinR, std::vector<double>(9, 0.0));
    }

    void run() {
        for (int k = 0; k < standin::kScans; ++k) {
            read_scan(k * standin::kPeriod);
            if (k > 0) match();
            for (const Eigen::Vector3d& p : feats_down_body) ikdtree.add(to_map(kf.get_x(), p));
        }
    }

  private:
    /// The LiDAR sits off the IMU by the extrinsic.
    void read_scan(double stamp) {
        const standin::State mount;
        standin::Pose lidar = standin::truth(stamp);
        lidar.t += lidar.R * mount.offset_T_L_I;
        lidar.R = lidar.R * mount.offset_R_L_I.toRotationMatrix();
        feats_down_body = standin::scan(lidar, noise_);
        feats_down_size = static_cast<int>(feats_down_body.size());
        Nearest_Points.resize(feats_down_body.size());
        normvec->points.resize(feats_down_body.size());
        point_selected_surf.assign(feats_down_body.size(), 1);
        res_last.assign(feats_down_body.size(), 0.0);
        lidar_end_time = stamp;
    }

    void match() {
        p_imu->Process(lidar_end_time - standin::kPeriod, lidar_end_time, kf);
        kf.update_iterated_dyn_share_modified(LASER_POINT_COV, solve_time);
        publish_odometry();
    }

    standin::Noise noise_{5};
    standin::Node nh;
};

int main(int argc, char** argv) {
    LaserMapping node(argc, argv);
    node.run();
    return 0;
}
