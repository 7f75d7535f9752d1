// SPDX-FileCopyrightText: 2026 D2-LIO contributors
// SPDX-License-Identifier: BSD-3-Clause
//
// A small scan-to-map matcher with the names that the hooks of LIO-SAM look for. C++11.
#include <ros/ros.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include "matrix.h"
#include "standin/grid_map.h"
#include "utility.h"

using Eigen::Vector3d;
using Eigen::Vector3f;
using standin::Mat;

struct Point {
    float x, y, z;
};
using Points = std::vector<Point>;

/// A map with the name of PCL's search.
struct Tree : standin::GridMap<Point> {
    using standin::GridMap<Point>::GridMap;
    void nearestKSearch(const Point& p, std::size_t k, Points& found,
                        std::vector<float>& sq) const {
        search(p, k, found, sq);
    }
};

constexpr int kNeighbours = 5;
constexpr int kIterations = 30;
constexpr float kRadius = 1.5F;         // m, of the search
constexpr float kMaxSqDistance = 1.F;   // m^2
constexpr double kPlaneDistance = 0.2;  // m
constexpr double kLineShare = 0.75;
constexpr float kLeastScore = 0.1F;
constexpr float kLeastInformation = 70.F;
constexpr float kConverged = 5e-4F;  // m and rad
constexpr int kLeastRows = 50;

Point to_point(const Eigen::Vector3d& p) {
    return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}
Vector3f to_vector(const Point& p) { return {p.x, p.y, p.z}; }

std::array<Vector3d, kNeighbours> to_array(const Points& points) {
    std::array<Vector3d, kNeighbours> out;
    for (std::size_t j = 0; j < out.size(); ++j) out[j] = to_vector(points[j]).cast<double>();
    return out;
}

/// A feature's pull: unit direction and distance, times its weight.
struct Row {
    bool used;
    Point point;
    Vector3f direction;
    float distance;
};

class mapOptimization : public ParamServer {
  public:
    EIGEN_MAKE_ALIGNED_OPERATOR_NEW

    std::unique_ptr<Tree> kdtreeCornerFromMap, kdtreeSurfFromMap;
    Points corners, surfaces;
    int laserCloudCornerLastDSNum = 0, laserCloudSurfLastDSNum = 0;
    std::vector<Row> corner_rows, surface_rows;
    float transformTobeMapped[6] = {};
    double timeLaserInfoCur = 0.0;
    bool isDegenerate = false;
    Mat matP;
    Eigen::Affine3f transPointAssociateToMap;
    standin::Noise scan_noise{5}, odometry_noise{11};
    double fed_until = 0.0;

    mapOptimization(int argc, char** argv) : ParamServer(argc, argv) {
        allocateMemory();
        update_transform();
    }

    void allocateMemory() {
        kdtreeCornerFromMap.reset(new Tree(0.05F, kRadius));
        kdtreeSurfFromMap.reset(new Tree(mappingSurfLeafSize, kRadius));
        matP = Mat(6, 6);
    }

    void run() {
        for (int k = 0; k < standin::kScans; ++k) handler(k * standin::kPeriod);
    }

    void handler(double stamp) {
        feed_imu(stamp);
        read_scan(stamp);
        updateInitialGuess();
        if (stamp > 0.0) {
            scan2MapOptimization();
            publish();
        }
        extend_map();
    }

    /// Everything up to the scan, as a node's spinner would have delivered it.
    void feed_imu(double stamp) {
        for (; fed_until < stamp + standin::kImuPeriod / 2; fed_until += standin::kImuPeriod) {
            Eigen::Vector3d force, rate;
            standin::imu(fed_until, force, rate);
            standin::ImuMessage message;
            standin::set_stamp(message, fed_until);
            message.linear_acceleration = {force.x(), force.y(), force.z()};
            message.angular_velocity = {rate.x(), rate.y(), rate.z()};
            host().deliver(message);
        }
    }

    void read_scan(double stamp) {
        timeLaserInfoCur = stamp;
        corners.clear();
        surfaces.clear();
        const standin::Pose pose = standin::truth(stamp);
        for (const auto& p : standin::edges(pose, scan_noise)) {
            corners.push_back(to_point(p));
        }
        for (const auto& p : standin::scan(pose, scan_noise)) {
            surfaces.push_back(to_point(p));
        }
        laserCloudCornerLastDSNum = static_cast<int>(corners.size());
        laserCloudSurfLastDSNum = static_cast<int>(surfaces.size());
        corner_rows.resize(corners.size());
        surface_rows.resize(surfaces.size());
    }

    void updateInitialGuess() {
        if (timeLaserInfoCur <= 0.0) return;
        const standin::Pose step = standin::odometry(timeLaserInfoCur - standin::kPeriod,
                                                     timeLaserInfoCur, odometry_noise);
        const Eigen::Matrix3f R = rotation();
        const Vector3f t = R * step.t.cast<float>();
        for (int i = 0; i < 3; ++i) transformTobeMapped[3 + i] += t[i];
        const Eigen::Matrix3f turned = R * step.R.cast<float>();
        transformTobeMapped[0] = std::atan2(turned(2, 1), turned(2, 2));
        transformTobeMapped[1] = -std::asin(turned(2, 0));
        transformTobeMapped[2] = std::atan2(turned(1, 0), turned(0, 0));
    }

    Eigen::Matrix3f rotation() const {
        const float* x = transformTobeMapped;
        return standin::rotation(x[0], x[1], x[2]).cast<float>();
    }

    void update_transform() {
        transPointAssociateToMap.setIdentity();
        transPointAssociateToMap.linear() = rotation();
        for (int i = 0; i < 3; ++i) {
            transPointAssociateToMap.translation()[i] = transformTobeMapped[3 + i];
        }
    }

    Point to_map(const Point& p) const {
        const Vector3f q = transPointAssociateToMap * to_vector(p);
        return {q.x(), q.y(), q.z()};
    }

    void match_corners() {
        update_transform();
#pragma omp parallel for
        for (int i = 0; i < laserCloudCornerLastDSNum; i++) {
            const Point pointOri = corners[i], moved = to_map(pointOri);
            Points found;
            std::vector<float> pointSearchSqDis;
            Row& row = corner_rows[i];
            row.used = false;
            kdtreeCornerFromMap->nearestKSearch(moved, kNeighbours, found, pointSearchSqDis);
            if (pointSearchSqDis.size() < kNeighbours || pointSearchSqDis[4] >= kMaxSqDistance)
                continue;
            Vector3d centre, along;
            if (standin::fit_line(to_array(found), centre, along) <= kLineShare) continue;
            const Vector3f to = to_vector(moved) - centre.cast<float>();
            const Vector3f off = to - along.cast<float>().dot(to) * along.cast<float>();
            const float ld2 = off.norm();
            float s = 1.F - 0.9F * std::fabs(ld2);
            if (s <= kLeastScore || ld2 == 0.F) continue;
            row = Row{true, pointOri, s * off / ld2, s * ld2};
        }
    }

    void match_surfaces() {
        update_transform();
#pragma omp parallel for
        for (int i = 0; i < laserCloudSurfLastDSNum; i++) {
            const Point pointOri = surfaces[i], moved = to_map(pointOri);
            Points found;
            std::vector<float> pointSearchSqDis;
            Row& row = surface_rows[i];
            row.used = false;
            kdtreeSurfFromMap->nearestKSearch(moved, kNeighbours, found, pointSearchSqDis);
            if (pointSearchSqDis.size() < kNeighbours || pointSearchSqDis[4] >= kMaxSqDistance)
                continue;
            Vector3d n;
            double offset;
            if (!(standin::fit_plane(to_array(found), n, offset) <= kPlaneDistance)) continue;
            const Vector3f normal = n.cast<float>();
            const float pd2 = normal.dot(to_vector(moved)) + static_cast<float>(offset);
            float s = 1.F - 0.9F * std::fabs(pd2) / std::sqrt(to_vector(pointOri).norm());
            if (s <= kLeastScore) continue;
            row = Row{true, pointOri, s * normal, s * pd2};
        }
    }

    /// Derivatives of the rotation by roll, pitch and yaw, by differences.
    void derivatives(Eigen::Matrix3f out[3]) const {
        constexpr double h = 1e-4;
        for (int k = 0; k < 3; ++k) {
            double high[3], low[3];
            for (int j = 0; j < 3; ++j) high[j] = low[j] = transformTobeMapped[j];
            high[k] += h;
            low[k] -= h;
            const Eigen::Matrix3d difference = standin::rotation(high[0], high[1], high[2]) -
                                               standin::rotation(low[0], low[1], low[2]);
            out[k] = (difference / (2.0 * h)).cast<float>();
        }
    }

    std::vector<Row> rows() const {
        std::vector<Row> used;
        for (const auto* all : {&corner_rows, &surface_rows}) {
            for (const Row& row : *all) {
                if (row.used) used.push_back(row);
            }
        }
        return used;
    }

    bool LMOptimization(int iterCount) {
        const std::vector<Row> used = rows();
        const int count = static_cast<int>(used.size());
        if (count < kLeastRows) return false;
        Eigen::Matrix3f dR[3];
        derivatives(dR);
        Mat rows_of_A(count, 6), rows_of_b(count, 1);
        for (int r = 0; r < count; ++r) {
            const Row& row = used[static_cast<std::size_t>(r)];
            for (int k = 0; k < 3; ++k) {
                rows_of_A.at<float>(r, k) = row.direction.dot(dR[k] * to_vector(row.point));
                rows_of_A.at<float>(r, 3 + k) = row.direction[k];
            }
            rows_of_b.at<float>(r, 0) = -row.distance;
        }
        Mat matAtA = transposed(rows_of_A) * rows_of_A, matAtB = transposed(rows_of_A) * rows_of_b,
            matX;
        standin::solve(matAtA, matAtB, matX);
        if (iterCount == 0) find_degeneracy(matAtA);
        if (isDegenerate) {
            Mat matX2;
            matX.copyTo(matX2);
            matX = matP * matX2;
        }
        float largest = 0.F;
        for (int i = 0; i < 6; ++i) {
            transformTobeMapped[i] += matX.at<float>(i, 0);
            largest = std::max(largest, std::abs(matX.at<float>(i, 0)));
        }
        return largest < kConverged;
    }

    /// A projector onto the variables with enough information.
    void find_degeneracy(const Mat& matAtA) {
        matP = Mat(6, 6);
        isDegenerate = false;
        for (int k = 0; k < 6; ++k) {
            const bool known = matAtA.at<float>(k, k) >= kLeastInformation;
            matP.at<float>(k, k) = known ? 1.F : 0.F;
            isDegenerate = isDegenerate || !known;
        }
    }

    void scan2MapOptimization() {
        for (int iterCount = 0; iterCount < kIterations; iterCount++) {
            match_corners();
            match_surfaces();
            if (LMOptimization(iterCount)) break;
        }
        transformUpdate();
    }

    /// The room's floor is level enough.
    void transformUpdate() {
        for (int i = 0; i < 2; ++i) {
            transformTobeMapped[i] = std::max(-0.3F, std::min(0.3F, transformTobeMapped[i]));
        }
    }

    void extend_map() {
        update_transform();
        for (const Point& p : corners) kdtreeCornerFromMap->add(to_map(p));
        for (const Point& p : surfaces) kdtreeSurfFromMap->add(to_map(p));
    }

    /// Stamp, position, roll, pitch, yaw, whether degenerate.
    void publish() const {
        const float* x = transformTobeMapped;
        std::printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g %d\n", timeLaserInfoCur, x[3], x[4],
                    x[5], x[0], x[1], x[2], isDegenerate ? 1 : 0);
    }
};

int main(int argc, char** argv) {
    std::unique_ptr<mapOptimization> node(new mapOptimization(argc, argv));
    node->run();
    return 0;
}
